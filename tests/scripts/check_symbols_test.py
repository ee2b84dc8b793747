"""scripts/check_symbols must pass a sound build, name a forbidden symbol of each kind, and refuse a
build without its files."""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

CHECKER = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_symbols"
SO = "runtime/libfigurine.so"
POOL = "runtime/libfigurine_pthreadpool.so"
ARCHIVES = [
    "runtime/libfigurine_runtime.a",
    "formats/libfigurine_formats.a",
    "formats/libfigurine_words.a",
]
PROGRAMS = ["samples/figurine/figurine", "samples/inspect/figurine-inspect"]
EXPORTED = 'extern "C" __attribute__((visibility("default"))) void {}() {{}}\n'
POOLS = EXPORTED.format("pthreadpool_create") + EXPORTED.format("figurine_drop_in_pthreadpool")
SOUND = '#include <cstdlib>\nvoid* memory(unsigned long n) { return std::malloc(n); }\n'
PROGRAM = "int main() { return 0; }\n"

CALL = "#include <cmath>\ndouble f(double x, double y) {{ return {} + y; }}"
INEXACT = [  # (call, symbol)
    ("sin(x)", "sin"),
    ("std::sin(float(x))", "sinf"),
    ("asinh(x)", "asinh"),
    ("std::atan2(x, y)", "atan2"),
    ("lgamma(x)", "lgamma"),
    ("std::erfc(x)", "erfc"),
    ("std::hypot(x, y)", "hypot"),
    ("std::fma(x, x, y)", "fma"),
]
EXACT = """#include <cmath>
double f(double x, double y) {
  return std::sqrt(x) + std::floor(x) + std::nearbyint(x) + std::fmod(x, y) + std::remainder(x, y) +
         std::fmax(x, y) + double(std::lround(x)) + std::ldexp(x, 3);
}
"""

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
    (POOL, "#include <cstdlib>\nchar* f() { return std::getenv(\"HOME\"); }",
     "environment: getenv"),
    (SO, "extern char large[];\nchar large[600000] = {1};\n#include <cstdlib>\n"
         "void* f() { return std::malloc(1); }", "the limit is 600000"),
    (POOL, "extern char large[];\nchar large[100000] = {1};\n#include <cstdlib>\n"
           "void* f() { return std::malloc(1); }", "the limit is 80000"),
    *[(archive, CALL.format("std::exp(x)"), "libm: exp") for archive in ARCHIVES],
    *[(ARCHIVES[0], CALL.format(call), f"libm: {symbol}\n") for call, symbol in INEXACT],
]


# A kernel's object as it should be, and two that a linker might take for everybody's.
KERNEL = "namespace figurine::kernels {{ void {}(int& x) {{ x = {}; }} }}\n"
KERNEL_BREACHES = [  # (source, words of the finding)
    ("inline int shared(int x) { return x + 1; }\n"
     "namespace figurine::kernels { void add_dots_baseline(int& x) { x = shared(x); } }\n",
     "kernel add_dots_baseline: defines shared(int): a weak symbol"),
    (KERNEL.format("add_dots_baseline", 1) + "int helper() { return 2; }\n",
     "kernel add_dots_baseline: defines helper(): not its row's"),
    (KERNEL.format("another_name", 1), "kernel add_dots_baseline: there is none"),
]


def baseline_rows():
    text = (CHECKER.parents[1] / "runtime/src/kernels/kernels.inc").read_text(encoding="utf-8")
    return [f"{row}_baseline" for row in re.findall(r"^FIG_KERNEL\(\w+, (\w+), baseline\)", text,
                                                    re.MULTILINE)]


def add_kernel(folder, name, source):
    """Compiles a kernel's object, -O0 so that inline functions stay, into the runtime's archive."""
    text = pathlib.Path(folder, f"{name}.cpp")
    text.write_text(source, encoding="utf-8")
    item = pathlib.Path(folder, f"{name}.cpp.o")
    subprocess.run(["g++", "-c", str(text), "-o", str(item)], check=True)
    subprocess.run(["ar", "rc", str(pathlib.Path(folder, ARCHIVES[0])), str(item)], check=True)


def interface():
    """What the library exports: the functions of figurine.h, by another way than the checker's."""
    lines = (CHECKER.parents[1] / "runtime/include/figurine.h").read_text(encoding="utf-8")
    names = {re.search(r"fig_\w+(?=\()", declaration).group()
             for declaration in re.split(r"^FIG_API ", lines, flags=re.MULTILINE)[1:]}
    for line in lines.splitlines():
        if line.startswith("FIG_DEFAULT("):
            names.add("fig_set_default_" + line.removeprefix("FIG_DEFAULT(").removesuffix(")"))
    return "".join(EXPORTED.format(name) for name in sorted(names))


def build(folder, sources, exported=None):
    for name, source in sources.items():
        path = pathlib.Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        text, item = path.with_suffix(".cpp"), path.with_suffix(".o")
        text.write_text(source, encoding="utf-8")
        if name in PROGRAMS:
            subprocess.run(["g++", str(text), "-o", str(path)], check=True)
        elif name in {SO, POOL}:
            whole = interface() if name == SO else POOLS
            text.write_text(source + (whole if exported is None else exported), encoding="utf-8")
            command = ["g++", "-O1", "-shared", "-fPIC", "-fvisibility=hidden", str(text), "-o",
                       str(path)]
            subprocess.run(command, check=True)
        else:
            subprocess.run(["g++", "-O1", "-c", str(text), "-o", str(item)], check=True)
            subprocess.run(["ar", "rc", str(path), str(item)], check=True)


def check(folder, *options):
    run = subprocess.run([sys.executable, str(CHECKER), *options, str(folder)],
                         capture_output=True, text=True, check=False)
    return run.returncode, run.stdout + run.stderr


class CheckSymbols(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """A sound build, compiled once; every test has a copy."""
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.sound = folder.name
        build(cls.sound,
              dict.fromkeys([SO, POOL, *ARCHIVES], SOUND) | dict.fromkeys(PROGRAMS, PROGRAM))
        for row in baseline_rows():
            add_kernel(cls.sound, row, KERNEL.format(row, 1))

    def setUp(self):
        self.assertGreater(len(baseline_rows()), 3)
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        shutil.copytree(self.sound, self.folder.name, dirs_exist_ok=True)

    def mend(self, name):
        shutil.copy(pathlib.Path(self.sound, name), pathlib.Path(self.folder.name, name))

    def test_passes_a_sound_build_and_prints_its_size(self):
        code, report = check(self.folder.name)
        self.assertEqual(code, 0, report)
        self.assertRegex(report, r"0 findings; \d+ bytes stripped and \d+ of the pool")

    def test_looks_at_programs_unless_only_the_library_is_built(self):
        breach = "#include <cstdlib>\nchar* f() { return std::getenv(\"A\"); }"
        build(self.folder.name, {SO: breach})
        for program in PROGRAMS:
            pathlib.Path(self.folder.name, program).unlink()
        code, report = check(self.folder.name)
        self.assertEqual(code, 1, report)
        self.assertIn(f"there is no {PROGRAMS[0]}", report)
        code, report = check(self.folder.name, "--library")
        self.assertEqual(code, 1, report)
        self.assertIn("environment: getenv", report)
        self.mend(SO)
        self.assertEqual(check(self.folder.name, "--library")[0], 0)

    def test_names_every_kind_of_breach(self):
        for name, source, words in BREACHES:
            with self.subTest(words=words):
                build(self.folder.name, {name: source})
                code, report = check(self.folder.name)
                self.assertEqual(code, 1, report)
                self.assertIn(f"{name}: ", report)
                self.assertIn(words, report)
                self.mend(name)

    def test_the_library_exports_the_interface_and_nothing_else(self):
        whole = interface()
        self.assertGreater(whole.count("fig_"), 40)
        first = whole.splitlines(keepends=True)[0]
        for exported, words in [
                (whole + first.replace("fig_", "fig_extra_"),
                 f"{SO}: exports fig_extra_isa_name, which figurine.h does not"),
                (whole + '__attribute__((visibility("default"))) void plain() {}\n',
                 f"{SO}: exports _Z5plainv, which"),
                (whole.replace(first, ""), f"{SO}: does not export fig_isa_name")]:
            with self.subTest(words=words):
                build(self.folder.name, {SO: SOUND}, exported)
                code, report = check(self.folder.name)
                self.assertEqual(code, 1, report)
                self.assertIn(words, report)

    def test_the_pool_exports_pthreadpool_and_nothing_else(self):
        for exported, words in [
                (POOLS + EXPORTED.format("fig_version"), f"{POOL}: exports fig_version, which"),
                (POOLS + EXPORTED.format("pthreadpool_extra"),
                 f"{POOL}: exports pthreadpool_extra, which pthreadpool.h does not"),
                (EXPORTED.format("pthreadpool_create"),
                 f"{POOL}: does not export figurine_drop_in_pthreadpool")]:
            with self.subTest(words=words):
                build(self.folder.name, {POOL: SOUND}, exported)
                code, report = check(self.folder.name)
                self.assertEqual(code, 1, report)
                self.assertIn(words, report)

    def test_a_kernel_defines_its_row_and_nothing_else(self):
        for source, words in KERNEL_BREACHES:
            with self.subTest(words=words):
                add_kernel(self.folder.name, "add_dots_baseline", source)
                code, report = check(self.folder.name)
                self.assertEqual(code, 1, report)
                self.assertIn(words, report)

    def test_exact_functions_of_libm_are_no_breach(self):
        build(self.folder.name, {ARCHIVES[0]: EXACT})
        command = ["nm", "-u", str(pathlib.Path(self.folder.name, ARCHIVES[0]))]
        asked = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        for symbol in ["sqrt", "fmod", "fmax", "lround"]:
            self.assertIn(f" {symbol}\n", asked)
        code, report = check(self.folder.name)
        self.assertEqual(code, 0, report)

    def test_a_missing_file_is_a_failure(self):
        for name in [SO, POOL, *ARCHIVES, *PROGRAMS]:
            with self.subTest(name=name):
                kept = pathlib.Path(self.folder.name, name).read_bytes()
                pathlib.Path(self.folder.name, name).unlink()
                self.assertEqual(check(self.folder.name)[0], 1)
                pathlib.Path(self.folder.name, name).write_bytes(kept)
                pathlib.Path(self.folder.name, name).chmod(0o755)


if __name__ == "__main__":
    unittest.main()
