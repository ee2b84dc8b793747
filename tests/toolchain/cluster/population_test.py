"""toolchain/cluster/population.sbatch on a real Slurm of two nodes on loopback: an array makes the
members of a population, and a part whose program is killed comes back and makes the rest.

    population_test.py FIGURINE_TRAIN MAKE_MOTION
"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

from loopback_cluster import LoopbackCluster

ROOT = pathlib.Path(__file__).resolve().parents[3]
SCRIPT = ROOT / "toolchain" / "cluster" / "population.sbatch"
TRAIN, MAKE_MOTION = "", ""
RECIPE = {
    "name": "small", "body": "mannequin", "preset": "nano", "seed": 5,
    "motions": [{"clip": "swinging.fgn"}],
    "capture": {"frames": 16, "views": 6, "size_px": 64},
    "groups": [{"split": "train", "first": 0, "count": 4},
               {"split": "test", "first": 10, "count": 2}],
    "shared_network": {"identities": 2, "iterations": 40},
    "training": {"iterations": 60, "static_grids": "all:T", "network_size": 16},
}
NAMES = ["000000", "000001", "000002", "000003", "000010", "000011"]


class Population(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        missing = [name for name in ["slurmctld", "slurmd", "sbatch"] if shutil.which(name) is None]
        if missing:
            raise AssertionError(f"no {missing[0]} here: scripts/setup cluster installs it")
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        subprocess.run([MAKE_MOTION, cls.folder / "swinging.fgn"], check=True)
        cls.recipe = cls.folder / "recipe.json"
        cls.recipe.write_text(json.dumps(RECIPE), encoding="utf-8")
        cls.cluster = cls.enterClassContext(
            LoopbackCluster(cls.enterClassContext(tempfile.TemporaryDirectory()), nodes=2))

    def train(self, state, *options):
        return subprocess.run([TRAIN, "population", self.recipe, "-o", state, "--quiet", *options],
                              capture_output=True, text=True, check=False)

    def states(self, number):
        """Of the tasks of an array, by their places in it."""
        text = self.cluster.command("scontrol", "show", "job", number)
        found = {}
        for block in text.split("\n\n"):
            fields = dict(word.split("=", 1) for word in block.split() if "=" in word)
            if "ArrayTaskId" in fields:
                found[fields["ArrayTaskId"]] = fields
        return found

    def outputs(self):
        return "".join(f"--- {path.name}\n{path.read_text(encoding='utf-8')}"
                       for path in sorted(self.folder.glob("task-*.out")))

    def wait_until(self, number, condition, limit_s=120):
        try:
            self.cluster.wait_for(condition, f"array {number}", limit_s)
        except AssertionError as late:
            raise AssertionError(f"{late}\n{self.outputs()}") from None

    def program_of(self, part):
        """The process that makes a part; nothing while there is none."""
        for folder in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().decode().split("\0")
            except OSError:
                continue
            if words[0] == TRAIN and part in words:
                return int(folder.name)
        return None

    def test_an_array_makes_the_members_and_a_killed_part_comes_back(self):
        straight, state = self.folder / "straight", self.folder / "state"
        early = self.train(state, "--part", "0/2")
        self.assertEqual(early.returncode, 1)
        self.assertIn("--initial-weights-only", early.stderr)
        self.assertEqual(self.train(state, "--initial-weights-only").returncode, 0)
        number = self.cluster.command(
            "sbatch", "--parsable", "--array=1-2", "--cpus-per-task=1", "--time=15",
            f"--output={self.folder / 'task-%a.out'}", SCRIPT, self.recipe, "-o", state,
            FIGURINE_TRAIN=TRAIN).strip()
        self.assertTrue(number.isdigit(), self.cluster.logs())
        self.wait_until(number, lambda: self.program_of("1/2") is not None)
        os.kill(self.program_of("1/2"), signal.SIGKILL)
        done = lambda task: self.states(number).get(task, {}).get("JobState") == "COMPLETED"
        self.wait_until(number, lambda: done("1") and done("2"))
        output = self.outputs()
        self.assertEqual(self.states(number)["2"].get("Restarts"), "1", output)
        self.assertIn("part 1/2, start 1: ended with code 137, back into the queue", output)
        self.assertIn("3 of 3 members of part 1 of 2", output)
        self.assertFalse((state / "population.fgn").exists())
        self.assertEqual(self.train(state).returncode, 0)
        self.assertTrue((state / "population.fgn").exists())
        self.assertFalse((state / "parts").exists())
        # What one process makes by itself.
        self.assertEqual(self.train(straight).returncode, 0)
        for name in NAMES:
            self.assertEqual(*(self.quality(folder, name) for folder in (straight, state)), name)

    @staticmethod
    def quality(folder, name):
        row = json.loads((folder / "members" / f"{name}.json").read_text(encoding="utf-8"))
        return row["quality"]["held_out_views"]["psnr_db"], row["training_psnr_db"]


if __name__ == "__main__":
    TRAIN, MAKE_MOTION = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
    unittest.main(argv=sys.argv[:1])
