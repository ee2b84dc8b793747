#!/usr/bin/env python3
"""Trainings, populations and packing killed at random moments, resumed, compared to the bit with
undisturbed runs.

    kills.py TRAIN INSPECT REPOSITORY [--each N] [--seed S] [--programs avatar,...]
             [--output docs/results/faults.json]

Small sizes: a mannequin at `nano`, the shipped population `nano`. N times each of SIGKILL, SIGHUP
(the terminal goes away) and SIGXFSZ (the limit of a file's size, lowered at that moment to a random
one: with the signal ignored, as figurine does, writing fails from then on) at a moment drawn
uniformly from the length of an undisturbed run. Afterwards no file is half and no older one lost;
the same command with --resume and the same threads ends in the bits of the undisturbed run, and no
temporary is left. Exit code 1 if anything is otherwise. The campaign is N = 100 (about two hours of
a core), scripts/test runs N = 2 of the quick programs.
"""
import argparse
import hashlib
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

SIGNALS = (signal.SIGKILL, signal.SIGHUP, signal.SIGXFSZ)
RECIPE = {
    "name": "small", "body": "mannequin", "preset": "nano", "seed": 5,
    "motions": [{"clip": "walk.fgn"}],
    "capture": {"frames": 16, "views": 6, "size_px": 48},  # enough to hold some out
    "groups": [{"split": "train", "first": 0, "count": 2}],
    "initial_weights": {"identities": 1, "rounds": 1, "iterations": 10, "first_step": 0.5,
                        "last_step": 0.25},
    "training": {"iterations": 20}}


def is_whole(path, tools):
    if path.suffix == ".safetensors":
        data = path.read_bytes()
        length = int.from_bytes(data[:8], "little")
        try:
            header = json.loads(data[8:8 + length])
        except ValueError:
            return False
        ends = [entry["data_offsets"][1] for name, entry in header.items()
                if name != "__metadata__"]
        return len(data) == 8 + length + max(ends, default=0)
    if path.suffix == ".json":
        try:
            json.loads(path.read_text())
        except ValueError:
            return False
    if path.suffix == ".fgn":
        return subprocess.run([tools.inspect, str(path)], capture_output=True).returncode == 0
    return True


class Tools:
    def __init__(self, train, inspect, repository, top):
        self.train, self.inspect, self.top = train, inspect, top
        packages = pathlib.Path(repository) / "samples"
        self.walk = packages / "packages/walk.fgn"
        self.population = packages / "populations/nano.fgn"
        self.sampler_body = packages / "populations/nano_body.fgn"
        self.body = top / "body.fgn"
        self.captures = top / "captures"

    def run(self, *words):
        result = subprocess.run([self.train, *map(str, words)], capture_output=True, text=True)
        if result.returncode != 0:
            sys.exit(f"kills: {' '.join(map(str, words))}: {result.stderr}")

    def prepare(self):
        self.run("body", "--mannequin", "--uv", 32, "-o", self.body)
        self.run("capture", "--body", self.body, "--identities", 1, "--views", 3, "--bust-views", 0,
                 "--frames", 6, "--size", "48x48", "--motion", self.walk, "--threads", 1,
                 "-o", self.captures)

    def same_values(self, a, b):
        result = subprocess.run([self.inspect, str(a), "--diff", str(b), "--json"],
                                capture_output=True, text=True)
        return result.returncode == 0 and json.loads(result.stdout)["tensors"] == []


class Avatar:
    def __init__(self, tools):
        self.tools = tools

    def command(self, folder, resume):
        if resume and (folder / "run.json").exists():
            return ["avatar", "-o", folder, "--resume"]
        return ["avatar", "--data", self.tools.captures / "000000", "--body", self.tools.body,
                "-o", folder, "--preset", "nano", "--uv", 32, "--iterations", 60,
                "--threads", 1, "--checkpoint-seconds", 0.2]

    def end(self, folder):
        return hashlib.sha256((folder / "weights.safetensors").read_bytes()).hexdigest()

    def same(self, folder, other):
        return self.end(folder) == self.end(other)


class Sampler(Avatar):
    def command(self, folder, resume):
        words = ["sampler", "--population", self.tools.population, "-o", folder, "--quiet"]
        if resume and (folder / "run.json").exists():
            return [*words, "--resume"]
        words += ["--body", self.tools.sampler_body]
        return [*words, "--variant", "basis", "--size", "small", "--rank", 4, "--batch", 4,
                "--members", 8, "--iterations", 60, "--threads", 1, "--checkpoint-seconds", 0.2]


class Population:
    def __init__(self, tools):
        self.tools = tools
        self.recipe = tools.top / "recipe/small.json"
        self.recipe.parent.mkdir()
        self.recipe.write_text(json.dumps(RECIPE))
        shutil.copy(tools.walk, self.recipe.parent / "walk.fgn")

    def command(self, folder, resume):
        return ["population", self.recipe, "-o", folder, "--slots", 1, "--quiet"]

    def same(self, folder, other):
        return self.tools.same_values(folder / "population.fgn", other / "population.fgn")


class Pack:
    """Over an older package, which must stay or be replaced as a whole."""

    def __init__(self, tools):
        self.tools = tools
        self.run = tools.top / "pack_run"
        tools.run(*Avatar(tools).command(self.run, False))

    def command(self, folder, resume):
        folder.mkdir(exist_ok=True)
        package = folder / "person.fgn"
        if not package.exists() and not resume:
            shutil.copy(self.tools.body, package)
        return ["pack", self.run, "--threads", 1, "-o", package]

    def same(self, folder, other):
        return self.tools.same_values(folder / "person.fgn", other / "person.fgn")


PROGRAMS = {"avatar": Avatar, "sampler": Sampler, "population": Population, "pack": Pack}


def files_of(folder):
    return {path for path in folder.rglob("*") if path.is_file()}


class Campaign:
    def __init__(self, tools, generator):
        self.tools, self.generator = tools, generator
        self.findings = []

    def start(self, words):
        return subprocess.Popen([self.tools.train, *map(str, words)], stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, start_new_session=True)

    def finish(self, words):
        process = self.start(words)
        error = process.communicate()[1].decode(errors="replace")
        return process.returncode, error

    def disturb(self, process, kind):
        if kind == signal.SIGXFSZ:
            size = self.generator.choice((0, 100, 1000, 20000))
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
        process.send_signal(kind)

    def trial(self, program, kind, seconds, reference, folder, row):
        process = self.start(program.command(folder, False))
        time.sleep(self.generator.uniform(0, seconds))
        if process.poll() is None:
            self.disturb(process, kind)
            row["kills"] += 1
        else:
            row["ended_before"] += 1
        error = process.communicate()[1].decode(errors="replace")
        what = f"{row['program']}, {row['signal']}"
        # A population names every member that failed.
        lines = error.splitlines()
        one = isinstance(program, Population) or len(lines) == 1
        if process.returncode > 0 and not (
                one and all(line.startswith("figurine-train: ") for line in lines)):
            self.find(row, "not_one_line", f"{what}: {error!r}")
        time.sleep(0.1)
        before = files_of(folder) if folder.exists() else set()
        for path in before:
            if path.exists() and not path.name.endswith(".figurine.tmp") \
                    and not is_whole(path, self.tools):
                self.find(row, "half_files", f"{what}: {path} is half")
        if isinstance(program, Pack) and not (folder / "person.fgn").exists():
            self.find(row, "lost_files", f"{what}: the older package is lost")
        code, error = self.finish(program.command(folder, True))
        if code != 0:
            return self.find(row, "not_resumed", f"{what}: {error!r}")
        lasting = {path for path in before if path.suffix in (".safetensors", ".fgn", ".csv")
                   and "runs" not in path.parts and "captures" not in path.parts
                   and "initial" not in path.parts}
        for path in lasting - files_of(folder):
            self.find(row, "lost_files", f"{what}: {path} is lost")
        if not program.same(folder, reference):
            self.find(row, "other_ends", f"{what}: ends in other bits")
        for path in folder.rglob("*.figurine.tmp"):
            self.find(row, "temporaries_left", f"{what}: {path}")
        return None

    def find(self, row, kind, text):
        row[kind] += 1
        self.findings.append(text)
        print(f"kills: {text}", file=sys.stderr, flush=True)

    def program(self, name, each):
        program = PROGRAMS[name](self.tools)
        reference = self.tools.top / f"{name}_reference"
        begin = time.monotonic()
        code, error = self.finish(program.command(reference, False))
        seconds = time.monotonic() - begin
        if code != 0:
            sys.exit(f"kills: {name}: {error}")
        rows = []
        for kind in SIGNALS:
            row = {"program": name, "signal": kind.name, "kills": 0, "ended_before": 0,
                   "half_files": 0, "lost_files": 0, "other_ends": 0, "not_resumed": 0,
                   "not_one_line": 0, "temporaries_left": 0}
            # Those that ended before are drawn again, a few times.
            for trial in range(2 * each):
                if row["kills"] == each:
                    break
                folder = self.tools.top / f"{name}_{kind.name}_{trial}"
                self.trial(program, kind, 0.95 * seconds, reference, folder, row)
                shutil.rmtree(folder, ignore_errors=True)
            rows.append(row)
            print(f"kills: {row}", flush=True)
        return rows


def machine():
    cpu = next((line.split(":", 1)[1].strip()
                for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
                if line.startswith("model name")), "unknown")
    return {"cpu": cpu, "cores": os.cpu_count(), "system": os.uname().sysname}


def totals_of(rows):
    return {key: sum(row[key] for row in rows) for key in rows[0] if key not in
            ("program", "signal", "ended_before")}


def write(arguments, rows):
    if not arguments.output:
        return
    sys.path.insert(0, str(pathlib.Path(arguments.repository) / "scripts/experiments"))
    import results
    done = ",".join(dict.fromkeys(row["program"] for row in rows))
    command = f"tests/faults/kills.py --each {arguments.each} --seed {arguments.seed} " \
              f"--programs {done}"
    path = pathlib.Path(arguments.output)
    injected = (results.read(path) or {}).get("injected")  # of injected.py
    results.write(path, {**results.head(command), "machine": machine(), **totals_of(rows),
                         "rows": rows, **({"injected": injected} if injected else {})})


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("train")
    parser.add_argument("inspect")
    parser.add_argument("repository")
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--programs", default=",".join(PROGRAMS))
    parser.add_argument("--output")
    arguments = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory(prefix="figurine_kills_") as top:
        tools = Tools(arguments.train, arguments.inspect, arguments.repository, pathlib.Path(top))
        tools.prepare()
        campaign = Campaign(tools, random.Random(arguments.seed))
        rows = []
        for name in arguments.programs.split(","):
            rows += campaign.program(name, arguments.each)
            write(arguments, rows)  # a campaign that is stopped has done something
    print(f"kills: {totals_of(rows)}")
    return 1 if campaign.findings else 0


if __name__ == "__main__":
    sys.exit(main())
