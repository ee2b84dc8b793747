"""toolchain/cluster/train_sampler.sbatch on a real Slurm of two nodes on loopback.

    train_sampler_test.py FIGURINE_TRAIN MAKE_PEOPLE
"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from loopback_cluster import LoopbackCluster

ROOT = pathlib.Path(__file__).resolve().parents[3]
SCRIPT = ROOT / "toolchain" / "cluster" / "train_sampler.sbatch"
TRAIN, MAKE_PEOPLE = "", ""
SMALL = [
    "--d-model", "16", "--blocks", "1", "--heads", "2", "--feed-forward", "32", "--batch", "8",
    "--rank-timeout", "60"
]


class TrainSampler(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        missing = [name for name in ["slurmctld", "slurmd", "sbatch"] if shutil.which(name) is None]
        if missing:
            raise AssertionError(f"no {missing[0]} here: scripts/setup cluster installs it")
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        subprocess.run([MAKE_PEOPLE, cls.folder / "people.fgn"], check=True)
        cls.cluster = cls.enterClassContext(
            LoopbackCluster(cls.enterClassContext(tempfile.TemporaryDirectory()), nodes=2))

    def submit(self, name, *options):
        """The job's number; its output goes to NAME.out. Fifteen minutes, so that Slurm's own
        signal stays away."""
        text = self.cluster.command("sbatch", "--parsable", "--cpus-per-task=1", "--time=15",
                                    f"--output={self.folder / name}.out", SCRIPT, "--population",
                                    self.folder / "people.fgn", "-o", self.folder / name, *SMALL,
                                    *options, FIGURINE_TRAIN=TRAIN)
        self.assertTrue(text.strip().isdigit(), f"sbatch said '{text}'\n{self.cluster.logs()}")
        return text.strip()

    def job(self, number):
        """The fields of scontrol show job."""
        words = self.cluster.command("scontrol", "show", "job", number).split()
        return dict(word.split("=", 1) for word in words if "=" in word)

    def output(self, name):
        path = self.folder / f"{name}.out"
        return path.read_text(encoding="utf-8") if path.exists() else ""

    def run_json(self, name):
        return json.loads((self.folder / name / "run.json").read_text(encoding="utf-8"))

    def wait_until(self, number, name, condition, limit_s=90):
        try:
            self.cluster.wait_for(condition, f"job {number}: {self.job(number).get('JobState')}",
                                  limit_s)
        except AssertionError as late:
            raise AssertionError(f"{late}\n--- output\n{self.output(name)}") from None

    def wait_for_training(self, number, name):
        self.wait_until(number, name, (self.folder / name / "run.json").exists)
        time.sleep(1.5)  # run.json is written just before the first iteration

    # What Slurm does at the time limit it does here when asked: scancel --signal, too, reaches all
    # ranks of a job but not its script.
    def test_comes_back_when_its_time_is_up_and_finishes(self):
        number = self.submit("run", "--minutes", "0.1")
        self.wait_for_training(number, "run")
        self.cluster.command("scancel", "--signal=TERM", number)
        self.wait_until(number, "run", lambda: self.job(number).get("Restarts") == "1")
        between = self.run_json("run")
        self.assertEqual(between["status"], "interrupted")
        self.assertGreater(between["iterations"], 0)
        self.assertLess(between["train_seconds"], 6)
        self.wait_until(number, "run", lambda: self.job(number).get("JobState") == "COMPLETED")
        output, run = self.output("run"), self.run_json("run")
        self.assertEqual(run["status"], "finished", output)
        self.assertGreaterEqual(run["train_seconds"], 6)
        self.assertGreater(run["iterations"], between["iterations"])
        self.assertIn("start 1: 2 nodes (n[1-2]), rank 0 at 127.0.0.1", output)
        for rank in [0, 1]:  # both took part, and stopped at the same iteration
            self.assertIn(
                f"{rank}: figurine-train: {self.folder / 'run'}: stopped after "
                f"{between['iterations']} iterations", output)
        self.assertIn("time is up, back into the queue", output)
        self.assertRegex(output, r"start 2: .* --resume\n")
        said = f"figurine-train: {self.folder / 'run'}: {run['iterations']} iterations in"
        self.assertIn(f"0: {said}", output)
        self.assertNotIn(f"1: {said}", output)
        self.assertTrue((self.folder / "run" / "weights.safetensors").exists())

    def test_ends_with_one_line_a_rank_when_a_rank_dies(self):
        number = self.submit("killed", "--minutes", "5")
        self.wait_for_training(number, "killed")
        os.kill(self.rank_process(number, 1), signal.SIGKILL)
        self.wait_until(number, "killed", lambda: self.job(number).get("JobState") == "FAILED", 30)
        output = self.output("killed")
        self.assertIn("0: figurine-train: rank 0 of 2: lost another rank", output)
        self.assertIn("--resume goes on from there", output)
        self.assertEqual(self.run_json("killed")["status"], "interrupted")
        self.assertNotIn("back into the queue", output)

    def rank_process(self, number, rank):
        for folder in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                variables = (folder / "environ").read_bytes().split(b"\0")
                command = (folder / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if command[0] == TRAIN.encode() and {
                    f"SLURM_JOB_ID={number}".encode(), f"SLURM_PROCID={rank}".encode()
            } <= set(variables):
                return int(folder.name)
        raise AssertionError(f"no process of rank {rank}\n{self.output('killed')}")


if __name__ == "__main__":
    TRAIN, MAKE_PEOPLE = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
    unittest.main(argv=sys.argv[:1])
