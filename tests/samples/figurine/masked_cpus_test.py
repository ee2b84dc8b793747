"""What the program does where the system hides its list of CPUs, as containers and phones may.

    masked_cpus_test.py FIGURINE

XNNPACK cannot start then on ARM, and can on x86-64: either way pictures are right or not there, and
what is wrong is said in one line. Needs a mount namespace; without the right to one, the exit code
is 77.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
FIGURINE = sys.argv[1]
CPUS = "/sys/devices/system/cpu"
OWN_MOUNTS = ["unshare", "--mount", "--propagation", "unchanged"]
if os.getuid() != 0:
    OWN_MOUNTS += ["--user", "--map-root-user"]


def run_masked(*command):
    """With an empty folder in the place of the CPUs."""
    with tempfile.TemporaryDirectory() as empty:
        script = f'mount --make-rprivate /sys && mount --bind {empty} {CPUS} && exec "$@"'
        return subprocess.run([*OWN_MOUNTS, "sh", "-c", script, "sh", *map(str, command)],
                              capture_output=True, text=True, check=False)


class MaskedCpus(unittest.TestCase):
    def test_an_avatar_is_drawn_or_one_line_says_why_not(self):
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder, "person.png")
            run = run_masked(FIGURINE, "render", ROOT / "samples/packages/person.fgn", "--size",
                             "32x32", "-o", picture)
            if run.returncode == 0:
                self.assertTrue(picture.is_file())
                return
            self.assertEqual(run.returncode, 1, run.stderr)
            self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
            self.assertIn(CPUS, run.stderr)
            self.assertIn("person.fgn", run.stderr)
            self.assertFalse(picture.exists())

    def test_what_needs_no_network_is_not_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            scene, picture = pathlib.Path(folder, "one.ply"), pathlib.Path(folder, "one.png")
            names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
                     "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
            values = "0 0 0 1 0 0 4 -2 -2 -2 1 0 0 0"
            head = ["ply", "format ascii 1.0", "element vertex 1"]
            head += [f"property float {name}" for name in names]
            scene.write_text("\n".join([*head, "end_header", values]) + "\n", encoding="utf-8")
            run = run_masked(FIGURINE, "splat", scene, "--size", "32x32", "-o", picture)
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertTrue(picture.is_file())


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as anywhere:
        if run_masked("true").returncode != 0:
            print("masked_cpus_test: no right to a mount namespace")
            sys.exit(77)
    unittest.main(argv=sys.argv[:1])
