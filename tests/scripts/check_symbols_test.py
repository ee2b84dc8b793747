"""scripts/check_symbols must pass a sound build, name a forbidden symbol of each kind, and refuse a build without its libraries."""
import pathlib
import subprocess
import tempfile
import unittest

CHECKER = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_symbols"
SOUND = "extern \"C\" float sqrtf(float);\nfloat root(float x) { return sqrtf(x); }\n"
PROGRAM = "int main() { return 0; }\n"
LIBRARIES = ["formats/libfigurine_words.a", "formats/libfigurine_formats.a", "runtime/libfigurine_runtime.a"]
PROGRAMS = ["samples/figurine/figurine", "formats/inspect/figurine-inspect"]

BREACHES = [  # (library, source, word of the finding)
    (LIBRARIES[2], "void f(int x) { if (x) throw x; }", "exception"),
    (LIBRARIES[0], "#include <cstdio>\nbool f(const char* name) { return std::fopen(name, \"r\"); }", "file"),
    (LIBRARIES[2], "#include <ctime>\nlong f() { timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec; }", "clock"),
    (LIBRARIES[2], "#include <cmath>\nfloat f(float x) { return std::exp(x); }", "libm"),
    (LIBRARIES[1], "#include <cstdlib>\nchar* f() { return std::getenv(\"HOME\"); }", "environment"),
    (LIBRARIES[1], "namespace torch { void grad(); }\nvoid f() { torch::grad(); }", "LibTorch"),
]


def build(folder, sources):
    for name, source in sources.items():
        path = pathlib.Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        text, item = path.with_suffix(".cpp"), path.with_suffix(".o")
        text.write_text(source, encoding="utf-8")
        if name in PROGRAMS:
            subprocess.run(["g++", str(text), "-o", str(path)], check=True)
        else:
            subprocess.run(["g++", "-O1", "-c", str(text), "-o", str(item)], check=True)
            subprocess.run(["ar", "rc", str(path), str(item)], check=True)


def check(folder):
    run = subprocess.run([str(CHECKER), str(folder)], capture_output=True, text=True, check=False)
    return run.returncode, run.stdout + run.stderr


class CheckSymbols(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        build(self.folder.name, {**{name: SOUND for name in LIBRARIES}, **{name: PROGRAM for name in PROGRAMS}})

    def test_passes_a_sound_build_and_prints_its_size(self):
        code, report = check(self.folder.name)
        self.assertEqual(code, 0, report)
        self.assertRegex(report, r"0 findings; runtime and formats: \d+ bytes")

    def test_names_every_kind_of_breach(self):
        for library, source, word in BREACHES:
            with self.subTest(word=word):
                build(self.folder.name, {library: source})
                code, report = check(self.folder.name)
                self.assertEqual(code, 1, report)
                self.assertIn(f"{pathlib.Path(library).name}: ", report)
                self.assertIn(word, report)
                build(self.folder.name, {library: SOUND})

    def test_a_missing_library_is_a_failure(self):
        pathlib.Path(self.folder.name, LIBRARIES[2]).unlink()
        self.assertEqual(check(self.folder.name)[0], 1)


if __name__ == "__main__":
    unittest.main()
