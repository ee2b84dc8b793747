"""scripts/test on a project of one trivial test a preset: it runs them all, says so in its last
line, and fails when anything fails or nothing is selected."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECT = """cmake_minimum_required(VERSION 3.25)
project(tiny LANGUAGES NONE)
enable_testing()
get_filename_component(preset "${CMAKE_BINARY_DIR}" NAME)
add_custom_target(quick_test)
foreach(library words formats writer runtime)  # what preset strict builds
  add_custom_target(figurine_${library} ALL)
endforeach()
if(NOT preset STREQUAL "empty_preset")
  add_test(NAME quick_test COMMAND test ! -e "${CMAKE_SOURCE_DIR}/break-${preset}")
  set_tests_properties(quick_test PROPERTIES LABELS threads)
  add_test(NAME slow_test COMMAND true)
  set_tests_properties(slow_test PROPERTIES LABELS any_core)
endif()
"""


class TestScript(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name, "checkout")
        (self.root / "scripts").mkdir(parents=True)
        for name in ["test", "run", "environment.sh"]:
            shutil.copy(ROOT / "scripts" / name, self.root / "scripts" / name)
        for name in ["setup", "format", "check_symbols"]:  # not what is tested here
            self.script(name, "exit 0")
        self.script("check_golden",
                    '[ "$1" = --list ] && echo host || echo "check_golden: $1: cafe"')
        shutil.copy(ROOT / "CMakePresets.json", self.root)
        (self.root / "cmake").mkdir()
        (self.root / "cmake" / "toolchain-aarch64.cmake").touch()
        self.write_project(PROJECT)

    def script(self, name, text):
        path = self.root / "scripts" / name
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)

    def write_project(self, text):
        (self.root / "CMakeLists.txt").write_text(text, encoding="utf-8")

    def run_script(self, *options):
        environment = {
            name: value for name, value in os.environ.items() if not name.startswith("CTEST_")
        }
        run = subprocess.run([str(self.root / "scripts" / "test"), *options], capture_output=True,
                             text=True, check=False, env=environment)
        return run.returncode, run.stdout, run.stderr

    def test_runs_every_preset_and_ends_with_ctests_closing_line(self):
        code, output, errors = self.run_script()
        self.assertEqual(code, 0, output + errors)
        # dev, asan, scalar and the first ARM core run both tests, tsan and the second core one;
        # format, symbols and golden frames come on top.
        self.assertEqual(output.strip().splitlines()[-1],
                         "100% tests passed, 0 tests failed out of 13")
        for name in [
                "dev/quick_test", "asan/slow_test", "scalar/quick_test", "tsan/quick_test",
                "format", "release/symbols", "golden/host", "aarch64-cortex-a76/slow_test",
                "aarch64-cortex-a53/quick_test"
        ]:
            self.assertIn(name, output)
        for name in ["tsan/slow_test", "aarch64-cortex-a53/slow_test"]:
            self.assertNotIn(name, output)
        self.assertIn("golden: host: cafe", errors)

    def test_passes_options_on(self):
        code, output, errors = self.run_script("-R", "tsan/")
        self.assertEqual((code, output.strip().splitlines()[-1]),
                         (0, "100% tests passed, 0 tests failed out of 1"), output + errors)

    def test_one_broken_test_of_any_preset_is_a_failure(self):
        for preset, shown, failures in [("dev", "dev", 1), ("asan", "asan", 1),
                                        ("scalar", "scalar", 1), ("tsan", "tsan", 1),
                                        ("aarch64", "aarch64-cortex-a53", 2)]:
            with self.subTest(preset=preset):
                broken = self.root / f"break-{preset}"
                broken.touch()
                code, output, _ = self.run_script()
                broken.unlink()
                self.assertNotEqual(code, 0)
                self.assertEqual(output.strip().splitlines()[-1],
                                 f"{round(100 - 100 * failures / 13)}% tests passed, "
                                 f"{failures} tests failed out of 13")
                self.assertIn(f"{shown}/quick_test", output)

    def test_failing_checks_and_builds_are_failures(self):
        self.script("check_symbols", "exit 1")
        code, output, _ = self.run_script()
        self.assertNotEqual(code, 0)
        self.assertIn("1 tests failed out of 13", output)
        self.write_project(PROJECT + 'add_custom_target(broken ALL COMMAND false)\n')
        code, output, errors = self.run_script()
        self.assertNotEqual(code, 0)
        self.assertIn("failed", errors)

    def test_selecting_nothing_is_a_failure(self):
        code, output, _ = self.run_script("-R", "no-such-test")
        self.assertNotEqual(code, 0)
        self.write_project(PROJECT.replace("empty_preset", "asan"))  # one preset without tests
        code, output, errors = self.run_script()
        self.assertNotEqual(code, 0)
        self.assertIn("preset asan has no test", errors)


if __name__ == "__main__":
    unittest.main()
