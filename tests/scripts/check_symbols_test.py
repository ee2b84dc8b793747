"""scripts/check_symbols must pass a sound build, name a forbidden symbol of each kind, and refuse a
build without its files."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECKER = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_symbols"
SO, ARCHIVE = "runtime/libfigurine_runtime.so", "runtime/libfigurine_runtime.a"
PROGRAMS = ["samples/figurine/figurine", "samples/inspect/figurine-inspect"]
SOUND = '#include <cstdlib>\nvoid* memory(unsigned long n) { return std::malloc(n); }\n'
PROGRAM = "int main() { return 0; }\n"

BREACHES = [  # (file, source, words of the finding)
    (SO, "void f(int x) { if (x) throw x; }", "exception: __cxa_throw"),
    (SO, "#include <cstdio>\nbool f(const char* name) { return std::fopen(name, \"r\"); }",
     "file: fopen"),
    (SO, "#include <ctime>\nlong f() { timespec t; clock_gettime(CLOCK_MONOTONIC, &t); "
         "return t.tv_sec; }", "clock: clock_gettime"),
    (SO, "#include <chrono>\nlong f() { return std::chrono::steady_clock::now()"
         ".time_since_epoch().count(); }", "clock: std::chrono"),
    (SO, "#include <cstdlib>\nchar* f() { return std::getenv(\"HOME\"); }", "environment: getenv"),
    (SO, "#include <iostream>\nvoid f() { std::cout << 1; }", "stream: std::cout"),
    (SO, "namespace torch { void grad(); }\nvoid f() { torch::grad(); }",
     "LibTorch: torch::grad()"),
    (SO, "extern char large[];\nchar large[500000] = {1};\n#include <cstdlib>\n"
         "void* f() { return std::malloc(1); }", "the limit is 400000"),
    (ARCHIVE, "#include <cmath>\nfloat f(float x) { return std::exp(x); }", "libm: expf"),
]


def build(folder, sources):
    for name, source in sources.items():
        path = pathlib.Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        text, item = path.with_suffix(".cpp"), path.with_suffix(".o")
        text.write_text(source, encoding="utf-8")
        if name in PROGRAMS:
            subprocess.run(["g++", str(text), "-o", str(path)], check=True)
        elif name == SO:
            command = ["g++", "-O1", "-shared", "-fPIC", str(text), "-o", str(path)]
            subprocess.run(command, check=True)
        else:
            subprocess.run(["g++", "-O1", "-c", str(text), "-o", str(item)], check=True)
            subprocess.run(["ar", "rc", str(path), str(item)], check=True)


def check(folder):
    run = subprocess.run([sys.executable, str(CHECKER), str(folder)], capture_output=True,
                         text=True, check=False)
    return run.returncode, run.stdout + run.stderr


class CheckSymbols(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        build(self.folder.name, {SO: SOUND, ARCHIVE: SOUND, **{name: PROGRAM for name in PROGRAMS}})

    def test_passes_a_sound_build_and_prints_its_size(self):
        code, report = check(self.folder.name)
        self.assertEqual(code, 0, report)
        self.assertRegex(report, r"0 findings; \d+ bytes stripped")

    def test_names_every_kind_of_breach(self):
        for name, source, words in BREACHES:
            with self.subTest(words=words):
                build(self.folder.name, {name: source})
                code, report = check(self.folder.name)
                self.assertEqual(code, 1, report)
                self.assertIn(f"{name}: ", report)
                self.assertIn(words, report)
                build(self.folder.name, {name: SOUND})

    def test_a_missing_file_is_a_failure(self):
        for name in [SO, ARCHIVE, *PROGRAMS]:
            with self.subTest(name=name):
                kept = pathlib.Path(self.folder.name, name).read_bytes()
                pathlib.Path(self.folder.name, name).unlink()
                self.assertEqual(check(self.folder.name)[0], 1)
                pathlib.Path(self.folder.name, name).write_bytes(kept)
                pathlib.Path(self.folder.name, name).chmod(0o755)


if __name__ == "__main__":
    unittest.main()
