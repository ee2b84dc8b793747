"""scripts/check_text must pass clean text and name each thing that it looks for."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECKER = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_text"

# Split where the checker would find them in this very file.
BREACHES = [("a.cpp", "int x;  // TO" + "DO later\n", "unfinished"),
            ("scripts/b", "echo FIX" + "ME\n", "unfinished"),
            ("a.md", "see /ho" + "me/somebody/notes\n", "somebody's machine"),
            ("a.h", "int x;\r\n", "carriage return"), ("a.cpp", "int x;\n" * 801, "801 lines"),
            ("a.bin", "x" * (2 << 20) + "x", "2097153 bytes"),
            ("b.h", "// DESIGN se" + "ction 5\n", "outside the repository")]
WORDS = "word " * 20 + "w\n"  # 101 columns
TOO_WIDE = {
    **{name: WORDS for name in [
        "a.md", "CMakeLists.txt", "a.cmake", "scripts/b", "a.sh", "a.sbatch", "a.py", "a.fbs",
        "a.inc", "a.h", "a.cpp"
    ]},
    "block.md": "```sh\n" + WORDS + "```\n",
    "after_a_block.md": "```json\n1\n```\n" + WORDS,
    "no_table.cpp": "// |" + " cell |" * 20 + "\n",
}
# It just fits, cannot be broken, or a program wrote it so.
WIDE_ENOUGH = {
    "fits.md": WORDS.replace("w\n", "\n"),
    "table.md": "| " + "cell | " * 20 + "\n",
    "link.md": "- https://a.test/" + "x" * 100 + "\n",
    "link.h": "// https://a.test/" + "x" * 100 + "\n",
    "a.json": "[" + "1, " * 50 + "1]\n",
    "quoted.md": "```json\n{" + '"key": 1, ' * 20 + '"end": 1}\n```\n',
}


def check(files, name="checkout"):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder, name)
        for file, text in files.items():
            path = root / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.replace("@PARENT@", folder).encode())
        run = subprocess.run([sys.executable, str(CHECKER), str(root)], capture_output=True,
                             text=True, check=False)
        return run.returncode, run.stdout


class CheckText(unittest.TestCase):
    def test_passes_clean_text(self):
        code, report = check({"a.cpp": "// a map of tmp and home\nint x;\n", "b.md": "words\n"})
        self.assertEqual((code, report), (0, "check_text: 2 files, 0 findings\n"))

    def test_an_empty_tree_is_a_failure(self):
        self.assertEqual(check({})[0], 1)

    def test_names_every_finding(self):
        for name, text, words in BREACHES:
            with self.subTest(words=words):
                code, report = check({name: text, "sound.h": "int y;\n"})
                self.assertEqual(code, 1, report)
                self.assertIn(f"{name}:", report)
                self.assertIn(words, report)

    def test_holds_text_and_code_to_100_columns(self):
        code, report = check(TOO_WIDE | WIDE_ENOUGH)
        self.assertEqual(code, 1)
        self.assertEqual(sorted(line.split(":")[0] for line in report.splitlines()[:-1]),
                         sorted(TOO_WIDE))
        self.assertIn("a.md:1: 101 columns, the limit is 100", report)

    def test_finds_the_folder_of_the_checkout(self):
        code, report = check({"a.md": "built in @PARENT@/elsewhere\n"})
        self.assertEqual(code, 1)
        self.assertIn("names this machine", report)


if __name__ == "__main__":
    unittest.main()
