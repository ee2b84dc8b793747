"""Frames missed at a steady rate: alone, beside a busy neighbour, and in a control group.

    scripts/run python3 scripts/experiments/deadlines.py [--frames N] [--hz N] [--output FILE]

Draws the shipped person walking (512x512, int8, body framing, a fresh pose and a run of the network
at every frame) with `figurine bench --hz`, by the build of `figurine` in build/release: frames
begin at ticks of a steady clock, and one that ends after the next tick has missed its deadline. On
one thread and on as many as `figurine` chooses:

- alone;
- with a neighbour that spins on the last CPU that the process may run on;
- inside a control group that pays for half a CPU, for one, and for one and a half. It is made with
  whichever of cgroup v2 (`cpu.max`) and v1 (`cpu.cfs_quota_us`) the system has and lets this user
  change; where neither can be had the result says so, with the reason.

10,000 frames at 60 Hz, three minutes a case, unless said. Writes docs/results/deadlines.json, and
prints a line a case.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys

import neighbours
import results

FIGURINE = pathlib.Path("build/release/samples/figurine/figurine")
PERSON = ["samples/packages/person.fgn", "--motion", "samples/packages/walk.fgn"]
FRAME = ["--size", "512x512", "--precision", "q8", "--framing", "body"]
PERIOD_US = 100_000  # of a quota, the kernel's default
QUOTAS = (0.5, 1.0, 1.5)  # CPUs
CGROUPS = pathlib.Path("/sys/fs/cgroup")


def cpu_name():
    for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown"


class Group:
    """A control group of ours with a quota of CPU time, gone when the block ends."""

    def __init__(self, cpus):
        self.quota_us = round(cpus * PERIOD_US)
        self.path = None
        self.version = None

    def __enter__(self):
        reasons = []
        for version, make in (("v2", self.make_v2), ("v1", self.make_v1)):
            for root in self.roots(version):
                path = root / f"figurine-deadlines-{os.getpid()}"
                try:
                    path.mkdir()
                    self.path, self.version = path, version
                    make()
                    return self
                except OSError as error:
                    reasons.append(f"{version} in {root}: {error.strerror}")
                    self.remove()
        raise OSError("; ".join(reasons) or f"no control groups in {CGROUPS}")

    @staticmethod
    def roots(version):
        if version == "v2":
            return [root for root in (CGROUPS, CGROUPS / "unified")
                    if (root / "cgroup.controllers").is_file()]
        return [root for root in (CGROUPS / "cpu,cpuacct", CGROUPS / "cpu")
                if (root / "cpu.cfs_quota_us").is_file() or (root / "cgroup.procs").is_file()][:1]

    def make_v2(self):
        (self.path / "cpu.max").write_text(f"{self.quota_us} {PERIOD_US}", encoding="utf-8")

    def make_v1(self):
        (self.path / "cpu.cfs_period_us").write_text(str(PERIOD_US), encoding="utf-8")
        (self.path / "cpu.cfs_quota_us").write_text(str(self.quota_us), encoding="utf-8")

    def enter(self):
        """In the child, before it becomes `figurine`."""
        (self.path / "cgroup.procs").write_text(str(os.getpid()), encoding="utf-8")

    def throttled(self):
        """Periods that the group was stopped in, and all of them."""
        words = (self.path / "cpu.stat").read_text(encoding="utf-8").split()
        stat = dict(zip(words[::2], words[1::2]))
        return {"throttled_periods": int(stat.get("nr_throttled", 0)),
                "periods": int(stat.get("nr_periods", 0))}

    def remove(self):
        if self.path is None:
            return
        try:
            self.path.rmdir()
        except OSError:
            pass
        self.path = None

    def __exit__(self, *_):
        self.remove()


def measure(options, threads, group=None):
    """A row of one run."""
    command = [FIGURINE, "bench", *PERSON, *FRAME, "--hz", options.hz, "--frames", options.frames]
    command += ["--threads", threads] if threads else []
    run = subprocess.run(
        [str(word) for word in [*command, "--json", "-"]],
        stdout=subprocess.PIPE,
        check=True,
        preexec_fn=group.enter if group else None,
    )
    report = json.loads(run.stdout)
    lane = report["runs"][0]
    return {
        "threads": lane["threads"],
        "threads_chosen": "by figurine" if threads is None else "by option",
        **{key: report["paced"][key] for key in ("missed", "dropped", "latency_ms", "wait_ms")},
        "frame_ms": lane["stages_ms"]["total"],
        "isa": report["machine"]["isa"],
    }


def say(row):
    latency = row["latency_ms"]
    print(
        f"{row['case']}, {row['threads']} threads: {row['missed']} missed, {row['dropped']} "
        f"dropped; p50 {latency['p50']:.2f}, p99 {latency['p99']:.2f}, "
        f"worst {latency['worst']:.2f} ms",
        flush=True,
    )


def rows_of(options):
    """All cases, in turn. A case that this machine does not let us make says why."""
    last_cpu = max(os.sched_getaffinity(0))
    for threads in (1, None):
        yield {"case": "alone"} | measure(options, threads)
        with neighbours.busy(cpu=last_cpu):
            yield {"case": "busy neighbour", "neighbours_cpu": last_cpu} | measure(options, threads)
    for cpus in QUOTAS:
        case = {"case": f"quota of {cpus:g} CPUs", "quota_cpus": cpus}
        try:
            with Group(cpus) as group:
                row = case | {"cgroup": group.version} | measure(options, None, group)
                yield row | group.throttled()
        except OSError as error:
            yield case | {"left_out": str(error)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--hz", type=float, default=60)
    parser.add_argument("--output", type=pathlib.Path,
                        default=pathlib.Path("docs/results/deadlines.json"))
    options = parser.parse_args()
    if not FIGURINE.exists():
        sys.exit(f"deadlines.py: {FIGURINE} is not built")
    load = os.getloadavg()[0]
    rows = []
    for row in rows_of(options):
        rows.append(row)
        if "left_out" in row:
            print(f"{row['case']}: left out: {row['left_out']}", flush=True)
        else:
            say(row)
    head = results.head("scripts/experiments/deadlines.py")
    results.write(options.output, head | {
        "machine": {"cpu": cpu_name(), "cpus": len(os.sched_getaffinity(0)),
                    "load_before": round(load, 2)},
        "frames": options.frames,
        "hz": options.hz,
        "scene": " ".join([*PERSON, *FRAME]),
        "rows": rows,
    })


if __name__ == "__main__":
    main()
