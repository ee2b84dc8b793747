"""scripts/check_golden with stand-ins for programs and emulators: it names the hash of every model,
and fails on any that differs or answers nothing."""
import json
import os
import pathlib
import platform
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
X86_MODELS = ["Nehalem", "Haswell"] if platform.machine() == "x86_64" else []
MODELS = ["host", *X86_MODELS, "cortex-a53", "cortex-a76", "max"]
# A package is the inspector's report of it. What a model draws is in the file named after it, or
# else what the package says. The precision is looked for as a word of its own: the package's path,
# with a temporary folder's random name in it, is among the words.
INSPECT = 'cat "$1"'
FIGURINE = """case " $* " in
  *" q8 "*) hash=$(cat "$FOLDER/$MODEL-t${*##* }" 2> /dev/null || echo cafe)
     echo "{\\"passed\\": true, \\"fixed_point\\": {\\"hash\\": \\"$hash\\"}}" ;;
  *) [ ! -e "$FOLDER/$MODEL-float" ] || { echo "figurine: the picture differs" >&2; exit 1; }
     echo '{"passed": true, "psnr_db": 92.04}' ;;
esac"""
STAGES = ('hash=$(cat "$FOLDER/$MODEL-stages" 2> /dev/null || echo beef)\n'
          'echo "golden frame: pixels_rgba8 $hash"')


def avatar(fixed_point_hash, png_bytes):
    golden = {"fixed_point_hash": fixed_point_hash, "png_bytes": png_bytes}
    return {"kind": "avatar", "avatar": {"golden": golden}}


AVATAR = avatar("cafe", 900)


class CheckGolden(unittest.TestCase):
    def setUp(self):
        # Now and then a random name has that in it; this one always does.
        folder = tempfile.TemporaryDirectory(prefix="q8")
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "scripts").mkdir()
        shutil.copy(ROOT / "scripts" / "check_golden", self.root / "scripts")
        for preset in ["dev", "aarch64"]:
            self.program(f"build/{preset}/samples/inspect/figurine-inspect", INSPECT)
            self.program(f"build/{preset}/samples/figurine/figurine", FIGURINE)
            self.program(f"build/{preset}/tests/runtime/golden_frame_test", STAGES)
        self.program("bin/qemu-x86_64", 'MODEL=$2; shift 2; export MODEL; exec "$@"')
        self.program("bin/qemu-aarch64", 'MODEL=$4; shift 4; export MODEL; exec "$@"')
        self.package("body", {"kind": "body"})
        self.package("someone", AVATAR)

    def program(self, name, text):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)

    def package(self, name, report):
        path = self.root / "samples" / "packages" / f"{name}.fgn"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(report), encoding="utf-8")

    def check(self, *models):
        environment = {
            **os.environ, "PATH": f"{self.root}/bin:{os.environ['PATH']}", "FOLDER": str(self.root),
            "MODEL": "host"
        }
        run = subprocess.run([self.root / "scripts" / "check_golden", *models], capture_output=True,
                             text=True, check=False, env=environment)
        self.assertEqual(run.stderr, "")
        return run.returncode, run.stdout.splitlines()

    def test_prints_one_line_a_model_with_its_hashes(self):
        code, lines = self.check()
        self.assertEqual(code, 0, lines)
        self.assertEqual(lines, [
            f"check_golden: {model}: around the network beef; someone cafe, 92.0 dB in float"
            for model in MODELS
        ])
        self.assertEqual(self.check("--list"), (0, MODELS))
        self.assertEqual(len(self.check("max")[1]), 1)

    def test_a_package_is_compared_by_what_it_carries(self):
        self.package("someone", avatar(None, 900))
        self.assertEqual(
            self.check("max"),
            (0, ["check_golden: max: around the network beef; someone 92.0 dB in float"]))
        self.package("someone", avatar("cafe", 0))
        self.assertEqual(self.check("max"),
                         (0, ["check_golden: max: around the network beef; someone cafe"]))
        self.package("someone", {"kind": "avatar", "avatar": {"golden": None}})
        self.assertEqual(
            self.check("max"),
            (1, ["check_golden: max: DIFFERS: someone.fgn: carries nothing to compare with"]))

    def test_one_model_that_differs_is_a_failure_and_the_others_are_still_told(self):
        for name, words in [("cortex-a53-t1", "0bad with 1 threads"),
                            ("cortex-a53-t2", "0bad with 2 threads"),
                            ("cortex-a53-float", "the picture differs")]:
            with self.subTest(name=name):
                (self.root / name).write_text("0bad", encoding="utf-8")
                code, lines = self.check()
                (self.root / name).unlink()
                self.assertEqual((code, len(lines)), (1, len(MODELS)), lines)
                self.assertEqual([line for line in lines if "DIFFERS" in line],
                                 [line for line in lines if "cortex-a53" in line])
                self.assertIn(words, "\n".join(lines))

    def test_nothing_to_run_is_a_failure(self):
        self.assertEqual(self.check("z80")[0], 2)
        (self.root / "build/aarch64/tests/runtime/golden_frame_test").unlink()
        self.assertIn("there is no build/aarch64/tests/runtime/golden_frame_test",
                      self.check("max")[1][0])
        (self.root / "samples/packages/someone.fgn").unlink()
        code, lines = self.check("host")
        self.assertEqual(code, 1)
        self.assertIn("no avatar in", lines[0])


if __name__ == "__main__":
    unittest.main()
