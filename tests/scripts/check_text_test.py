"""scripts/check_text must pass clean text and name each thing that it looks for."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECKER = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_text"

# Split where the checker would find them in this very file.
BREACHES = [("a.cpp", "int x;  // TO" + "DO later\n", "unfinished"), ("scripts/b", "echo FIX" + "ME\n", "unfinished"),
            ("a.md", "see /ho" + "me/somebody/notes\n", "somebody's machine"), ("a.h", "int x;\r\n", "carriage return"),
            ("a.md", "wide " * 20 + "w\n", "101 columns"),
            ("a.cpp", "int x;\n" * 801, "801 lines"), ("a.bin", "x" * (2 << 20) + "x", "2097153 bytes"), ("b.h", "// DESIGN se" + "ction 5\n", "outside the repository")]


def check(files, name="checkout"):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder, name)
        for file, text in files.items():
            path = root / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.replace("@PARENT@", folder).encode())
        run = subprocess.run([sys.executable, str(CHECKER), str(root)], capture_output=True, text=True, check=False)
        return run.returncode, run.stdout


class CheckText(unittest.TestCase):
    def test_passes_clean_text(self):
        code, report = check({"a.cpp": "// a map of tmp and home\nint x;\n", "b.md": "words\n"})
        self.assertEqual((code, report), (0, "check_text: 2 files, 0 findings\n"))

    def test_lets_rows_of_tables_and_addresses_be_wide(self):
        row, address = "| " + "wide " * 30 + "|\n", "https://" + "w" * 120 + "\n"
        code, report = check({"a.md": row + address + "w" * 49 + " " + "ü" * 50 + "\n"})
        self.assertEqual(code, 0, report)

    def test_an_empty_tree_is_a_failure(self):
        self.assertEqual(check({})[0], 1)

    def test_names_every_finding(self):
        for name, text, words in BREACHES:
            with self.subTest(words=words):
                code, report = check({name: text, "sound.h": "int y;\n"})
                self.assertEqual(code, 1, report)
                self.assertIn(f"{name}:", report)
                self.assertIn(words, report)

    def test_finds_the_folder_of_the_checkout(self):
        code, report = check({"a.md": "built in @PARENT@/elsewhere\n"})
        self.assertEqual(code, 1)
        self.assertIn("names this machine", report)


if __name__ == "__main__":
    unittest.main()
