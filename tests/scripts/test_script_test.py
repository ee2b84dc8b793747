"""scripts/test on a project of two trivial tests a preset: it runs them all, says so in its last
line, measures itself, and fails when anything fails or nothing is selected."""
import json
import os
import pathlib
import re
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
# What presets strict and release build.
foreach(library words formats writer runtime c pthreadpool_shared)
  add_custom_target(figurine_${library} ALL)
endforeach()
if(NOT preset STREQUAL "empty_preset")
  add_test(NAME quick_test COMMAND test ! -e "${CMAKE_SOURCE_DIR}/break-${preset}")
  set_tests_properties(quick_test PROPERTIES LABELS threads)
  add_test(NAME slow_test COMMAND true)
  set_tests_properties(slow_test PROPERTIES LABELS "any_core;slow")
endif()
"""


def closing_line(output):
    return output.strip().splitlines()[-1]


class TestScript(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name, "checkout")
        (self.root / "scripts").mkdir(parents=True)
        for name in ["test", "run", "environment.sh", "measured", "test_time"]:
            shutil.copy(ROOT / "scripts" / name, self.root / "scripts" / name)
        for name in ["setup", "format", "lint", "check_symbols"]:  # not what is tested here
            self.script(name, "exit 0")
        self.script("check_golden",
                    '[ "$1" = --list ] && echo host || echo "check_golden: $1: cafe"')
        shutil.copy(ROOT / "CMakePresets.json", self.root)
        (self.root / "cmake").mkdir()
        (self.root / "cmake" / "toolchain-aarch64.cmake").touch()
        self.write_project(PROJECT)
        # A new enough host that nothing was installed on: all programs but the compiler's cache.
        self.path = pathlib.Path(folder.name, "bin")
        self.path.mkdir()
        for program in pathlib.Path("/usr/bin").iterdir():
            if program.name != "ccache":
                (self.path / program.name).symlink_to(program)

    def script(self, name, text):
        path = self.root / "scripts" / name
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)

    def write_project(self, text):
        (self.root / "CMakeLists.txt").write_text(text, encoding="utf-8")

    def run_script(self, *options):
        environment = {name: value for name, value in os.environ.items()
                       if not name.startswith("CTEST_")}
        environment |= {"PATH": str(self.path), "FIGURINE_CACHE": str(self.root.parent / "cache"),
                        "CCACHE_DIR": str(self.root.parent / "ccache")}
        run = subprocess.run([str(self.root / "scripts" / "test"), *options], capture_output=True,
                             text=True, check=False, env=environment)
        return run.returncode, run.stdout, run.stderr

    def test_runs_every_preset_and_ends_with_ctests_closing_line(self):
        code, output, errors = self.run_script()
        self.assertEqual(code, 0, output + errors)
        # dev, asan and the first ARM core run both tests, tsan and the second one;
        # format, symbols and golden frames come on top.
        self.assertEqual(closing_line(output), "100% tests passed, 0 tests failed out of 11")
        for name in ["dev/quick_test", "asan/slow_test", "tsan/quick_test", "format",
                     "release/symbols", "golden/host", "aarch64-cortex-a76/slow_test",
                     "aarch64-cortex-a53/quick_test"]:
            self.assertIn(name, output)
        for name in ["tsan/slow_test", "aarch64-cortex-a53/slow_test"]:
            self.assertNotIn(name, output)
        self.assertIn("golden: host: cafe", errors)

    def measured(self, name="build/all/test_time.json"):
        return json.loads((self.root / name).read_text(encoding="utf-8"))

    def test_measures_itself_by_step_and_by_test_and_knows_a_cold_run(self):
        # More work than any stand-in for a build does. What starting ctest costs, a machine says.
        self.script("setup", "i=0; while [ $i -lt 250000 ]; do i=$((i + 1)); done")
        code, output, errors = self.run_script("-R", "tsan/")
        self.assertEqual(code, 0, output + errors)
        self.assertEqual(closing_line(output), "100% tests passed, 0 tests failed out of 1")
        report = self.measured()
        self.assertEqual([row["step"] for row in report["rows"]],
                         ["set-up", "build strict", "build release", "build asan",
                          "build tsan", "build aarch64", "build dev", "testing"])
        seconds = [row["cpu_seconds"] for row in report["rows"]]
        self.assertEqual(max(seconds[:-1]), seconds[0], report)
        self.assertTrue(all(value > 0 for value in seconds), report)
        self.assertAlmostEqual(report["cpu_minutes"], sum(seconds) / 60, delta=0.006)
        self.assertEqual([row["test"] for row in report["slowest_tests"]], ["tsan/quick_test"])
        self.assertGreater(report["slowest_tests"][0]["cpu_seconds"], 0)
        self.assertEqual((report["cold"], report["command"]), (True, "scripts/test -R tsan/"))
        self.assertTrue(report["machine"]["cpu"] and report["date"] and report["commit"])
        self.assertIn(f"{report['cpu_minutes']:.1f} CPU minutes", errors)
        self.assertFalse((self.root / "docs").exists())  # only where it is asked for

        # Once more, on what the first run left; and with a result to keep.
        self.script("setup", "exit 0")
        (self.root / "docs" / "results").mkdir(parents=True)
        self.assertEqual(self.run_script("--record", "-R", "tsan/")[0], 0)
        self.assertEqual(self.measured("docs/results/test_time.json"), self.measured())
        self.assertIs(self.measured()["cold"], False)

    def test_what_lies_in_the_cache_makes_a_run_warm(self):
        for folder in ["cache/sysroot-arm64/usr", "ccache/a", "checkout/build/a"]:
            with self.subTest(folder=folder):
                shutil.rmtree(self.root / "build", ignore_errors=True)
                (self.root.parent / folder).mkdir(parents=True)
                self.assertEqual(self.run_script("-R", "tsan/")[0], 0)
                self.assertIs(self.measured()["cold"], False)
                shutil.rmtree((self.root.parent / folder).parent)

    def test_quick_runs_the_light_preset_without_slow_tests_and_lints(self):
        code, output, errors = self.run_script("--quick")
        self.assertEqual(code, 0, output + errors)
        self.assertIn("100% tests passed, 0 tests failed out of 1", output)
        self.assertIn("quick_test", output)
        self.assertEqual({path.name for path in (self.root / "build").iterdir()}, {"all", "light"})
        self.script("lint", "exit 1")
        self.assertNotEqual(self.run_script("--quick")[0], 0)
        self.assertNotEqual(self.run_script("--quick", "-R", "no-such-test")[0], 0)
        self.assertEqual(self.run_script("--quick", "--record")[0], 2)

    def test_one_broken_test_of_any_preset_is_a_failure(self):
        for preset in ["dev", "asan", "tsan", "aarch64"]:
            (self.root / f"break-{preset}").touch()
        code, output, _ = self.run_script()
        self.assertNotEqual(code, 0)
        self.assertEqual(set(re.findall(r"^\t *\d+ - (\S+/\S+) \(Failed\)", output, re.MULTILINE)),
                         {"dev/quick_test", "asan/quick_test", "tsan/quick_test",
                          "aarch64-cortex-a76/quick_test",
                          "aarch64-cortex-a53/quick_test"})
        self.assertEqual(closing_line(output), "55% tests passed, 5 tests failed out of 11")

    def test_failing_checks_and_builds_are_failures(self):
        self.script("check_symbols", "exit 1")
        code, output, _ = self.run_script()
        self.assertNotEqual(code, 0)
        self.assertIn("1 tests failed out of 11", output)
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
