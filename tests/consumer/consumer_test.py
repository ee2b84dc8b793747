"""What an application does with figurine: installs it, moves the prefix, builds the minimal program
in C and in C++ against it by CMake and by pkg-config, and draws a frame with each. Whose threads
XNNPACK runs on then, by what the dynamic linker says of itself.

    consumer_test.py BUILD

BUILD is a build folder in which the device's libraries are built; nothing of them is compiled here.
"""
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = ROOT / "tests/consumer"
MINIMAL = ROOT / "samples/minimal"
PACKAGES = [ROOT / "samples/packages" / name for name in ("person.fgn", "body-128.fgn")]
BUILD = pathlib.Path()
SIZE = 64
OURS, SYSTEMS = "libfigurine_pthreadpool", "libpthreadpool"
# Loads libraries, each for itself, then the plugin, and lets it draw on so many threads.
LOADER = """
import ctypes, sys
plugin, threads, avatar, body, size, *before = sys.argv[1:]
kept = [ctypes.CDLL(name) for name in before]
pixels = ctypes.create_string_buffer(4 * int(size) ** 2)
draw = ctypes.CDLL(plugin).draw_on_threads
assert draw(int(threads), avatar.encode(), body.encode(), int(size), pixels) == int(threads)
sys.stdout.buffer.write(pixels.raw)
"""


def run(*command, environment=None, error=None):
    """The output of a command that must work; error: a list that gets what it said besides."""
    done = subprocess.run([str(word) for word in command], capture_output=True, check=False,
                          env={**os.environ, **(environment or {})})
    if done.returncode != 0:
        raise AssertionError(f"{shlex.join(str(word) for word in command)}:\n"
                             f"{done.stdout.decode(errors='replace')[-3000:]}\n"
                             f"{done.stderr.decode(errors='replace')[-3000:]}")
    if error is not None:
        error.append(done.stderr.decode(errors="replace"))
    return done.stdout


def pools_of_xnnpack(linker_says):
    """The libraries where XNNPACK found the functions of pthreadpool."""
    return set(re.findall(r"binding file \S*/libXNNPACK\.\S+ \[\d+\] to \S*/(\w+)\.\S+ \[\d+\]: "
                          r".*`pthreadpool_", linker_says))


class Consumer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(dir=BUILD)
        cls.addClassCleanup(cls.folder.cleanup)
        cls.work = pathlib.Path(cls.folder.name)
        installed = cls.work / "installed"
        for component in ("runtime", "development"):
            run("cmake", "--install", BUILD, "--prefix", installed, "--component", component)
        cls.prefix = cls.work / "moved"
        installed.rename(cls.prefix)
        cls.library = next(cls.prefix.rglob("libfigurine.so")).parent
        cls.pictures = {}

    def draw(self, program, pools=None):
        """The program's frame, which is no empty one. pools: whose functions XNNPACK is to find."""
        return self.drawn(program, *PACKAGES, SIZE, SIZE, pools=pools)

    def drawn(self, *command, pools=None, preload=""):
        error = []
        rgba = run(*command, error=error, environment={
            "LD_LIBRARY_PATH": str(self.library), "LD_PRELOAD": preload,
            "LD_DEBUG": "bindings" if pools else ""})
        if pools:
            self.assertEqual(pools_of_xnnpack(error[0]), {pools})
        self.assertEqual(len(rgba), 4 * SIZE * SIZE)
        self.assertGreater(sum(alpha > 127 for alpha in rgba[3::4]), 100)
        return rgba

    def build(self, project, target):
        folder = self.work / project
        run("cmake", "-G", "Ninja", "-S", HERE / project, "-B", folder, f"-DMINIMAL={MINIMAL}",
            f"-DCMAKE_PREFIX_PATH={self.prefix}", "-DCMAKE_BUILD_TYPE=Release")
        run("cmake", "--build", folder)
        return folder / target

    def flags(self, *packages):
        return run("pkg-config", "--cflags", "--libs", *packages, environment={
            "PKG_CONFIG_PATH": str(self.library / "pkgconfig")}).decode().split()

    def test_all_four_draw_the_same(self):
        cpp = self.build("cpp", "minimal")
        by_cmake = [self.draw(self.build("c", "minimal_c"), OURS), self.draw(cpp, SYSTEMS),
                    self.draw(cpp.with_name("minimal_gives_way"), OURS)]
        self.assertEqual(by_cmake, by_cmake[:1] * 3)

        program = self.work / "by-pkg-config"
        run("cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", MINIMAL / "minimal.c",
            *self.flags("figurine"), "-o", program)
        self.assertEqual(self.draw(program), by_cmake[0])
        for first, pools in [((), SYSTEMS), (("figurine-pthreadpool",), OURS)]:
            run("c++", "-std=c++20", MINIMAL / "minimal.cpp",
                *self.flags(*first, "figurine-runtime"), "-o", program)
            self.assertEqual(self.draw(program, pools), by_cmake[0])

    def test_a_plugin_has_threads_that_give_way(self):
        plugin = self.work / "plugin.so"
        run("cc", "-std=c11", "-shared", "-fPIC", f"-I{MINIMAL}", HERE / "plugin/plugin.c",
            *self.flags("figurine"), "-o", plugin)
        xnnpack = re.search(r"=> (\S+/libXNNPACK\S+)", run(
            "ldd", self.library / "libfigurine.so").decode()).group(1)

        def draw(threads, *before, pools, preload=""):
            return self.drawn(sys.executable, "-c", LOADER, plugin, threads, *PACKAGES, SIZE,
                              *before, pools=pools, preload=preload)
        alone = draw(1, pools=OURS)
        threads = min(2, len(os.sched_getaffinity(0)))
        self.assertEqual(draw(threads, pools=OURS), alone)
        # Loaded before, XNNPACK keeps what it found: it is given none of our pools then. A program
        # that brings the system's pool is likewise, unless it brings ours ahead of it.
        self.assertEqual(draw(threads, xnnpack, pools=SYSTEMS), alone)
        system = f"{SYSTEMS}.so.0"
        self.assertEqual(draw(threads, pools=SYSTEMS, preload=system), alone)
        self.assertEqual(draw(threads, pools=OURS, preload=f"{OURS}.so.0:{system}"), alone)

    def test_the_pool_is_as_whole_as_the_systems(self):
        def functions(library):
            lines = run("nm", "-D", "--defined-only", library).decode().splitlines()
            return {line.split()[-1] for line in lines if " pthreadpool_" in line}
        system = re.search(r"=> (\S+/libpthreadpool\S+)", run(
            "ldd", self.library / "libfigurine.so").decode()).group(1)
        self.assertGreater(len(functions(system)), 30)
        self.assertEqual(
            functions(system), functions(self.library / "libfigurine_pthreadpool.so"))

    def test_installed_headers_need_nothing_else(self):
        include = self.prefix / "include"
        headers = [header.relative_to(include) for header in sorted(include.rglob("*.h"))]
        self.assertIn(pathlib.Path("figurine.h"), headers)
        self.assertIn(pathlib.Path("figurine/detail/half.h"), headers)
        self.assertFalse([header for header in headers if "src" in header.parts])
        sources = [f'#include "{header}"\n' for header in headers]
        text = self.work / "headers.cpp"
        for source in ["".join(sources), "".join(reversed(sources))]:
            text.write_text(source, encoding="utf-8")
            run("c++", "-std=c++20", "-fsyntax-only", f"-I{include}", text)

    def test_no_path_of_the_build_is_installed(self):
        for file in self.prefix.rglob("*"):
            if file.suffix in {".cmake", ".pc", ".h"}:
                text = file.read_text(encoding="utf-8")
                for path in (BUILD, ROOT, self.work):
                    self.assertNotIn(str(path), text, file)

    def test_a_wrong_component_is_named(self):
        folder = self.work / "wrong"
        folder.mkdir()
        (folder / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.25)\nproject(wrong LANGUAGES C)\n"
            "find_package(figurine REQUIRED COMPONENTS trainer)\n", encoding="utf-8")
        done = subprocess.run(
            ["cmake", "-G", "Ninja", "-S", folder, "-B", folder / "build",
             f"-DCMAKE_PREFIX_PATH={self.prefix}"], capture_output=True, text=True, check=False)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("no component 'trainer'", " ".join(done.stderr.split()))

    def test_works_as_a_subdirectory(self):
        folder = self.work / "subdirectory"
        run("cmake", "-G", "Ninja", "-S", HERE / "subdirectory", "-B", folder,
            f"-DFIGURINE_SOURCE={ROOT}")
        plan = (folder / "build.ninja").read_text(encoding="utf-8")
        self.assertIn("build minimal_c: ", plan)
        self.assertIn("build minimal: ", plan)
        self.assertIn("libfigurine_runtime.a: ", plan)
        self.assertNotIn("figurine-inspect", plan, "brings its tools along")
        self.assertNotIn("c_api_test", plan, "brings its tests along")


if __name__ == "__main__":
    if len(sys.argv) != 2 or not pathlib.Path(sys.argv[1]).is_dir():
        sys.exit("usage: consumer_test.py BUILD")
    BUILD = pathlib.Path(sys.argv.pop()).resolve()
    if not shutil.which("pkg-config"):
        sys.exit("consumer_test: no pkg-config")
    unittest.main()
