"""What threads cost where CPUs are few or busy: threads x busy neighbours, of two programs.

    scripts/run python3 scripts/experiments/threads.py BEFORE AFTER [OUTPUT]

BEFORE and AFTER are two builds of `figurine`. Both render the same 60 frames of the shipped walker
in int8 at 512x512, by turns; a neighbour is a process that only spins. AFTER renders them once more
with --force-threads where more threads are asked for than there are CPUs. Writes medians of wall
and CPU seconds to OUTPUT (docs/results/threads.json), and prints them; about ten minutes. Neither
program need be of this checkout: FIGURINE_BIND=FOLDER shows scripts/run another one.
"""

import datetime
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time

THREADS = (1, 2, 3, 4, 8)
NEIGHBOURS = (0, 1, 2)
RUNS = 5
LONG_S = 10  # a case whose first run takes longer is run once
LIMIT_S = 60  # what takes longer counts as this
FRAMES = 60
PACKAGES = pathlib.Path("samples/packages")


def render(program, threads, video, forced):
    """Wall and CPU seconds of one process, which is ended after LIMIT_S."""
    command = [program, "render", PACKAGES / "person.fgn", "--motion", PACKAGES / "walk.fgn"]
    command += ["--frames", f"0:{FRAMES}", "--size", "512x512", "--precision", "q8"]
    command += ["--threads", threads]
    command += ["-o", video, *(["--force-threads"] if forced else [])]
    begin = time.monotonic()
    process = subprocess.Popen(
        [str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    limit = threading.Timer(LIMIT_S, process.kill)
    limit.start()
    _, status, usage = os.wait4(process.pid, 0)
    limit.cancel()
    wall = time.monotonic() - begin
    if status != 0 and wall < LIMIT_S:
        sys.exit(f"threads.py: {program}: failed with {os.waitstatus_to_exitcode(status)}")
    return wall, usage.ru_utime + usage.ru_stime


class Neighbours:
    def __init__(self, count):
        self.count = count

    def __enter__(self):
        spin = [sys.executable, "-c", "while True: pass"]
        self.processes = [subprocess.Popen(spin) for _ in range(self.count)]
        time.sleep(0.2 if self.count else 0)

    def __exit__(self, *_):
        for process in self.processes:
            process.kill()
            process.wait()


def measure(builds, threads, neighbours, video):
    """{build: {wall_s, cpu_s, runs}}; builds: {name: (program, forced)}."""
    seen = {name: [] for name in builds}
    with Neighbours(neighbours):
        for _ in range(RUNS):
            for name, (program, forced) in builds.items():
                if not seen[name] or seen[name][0][0] < LONG_S:
                    seen[name].append(render(program, threads, video, forced))
    return {
        name: {
            "wall_s": round(statistics.median(wall for wall, _ in runs), 3),
            "cpu_s": round(statistics.median(cpu for _, cpu in runs), 3),
            "runs": len(runs),
        }
        for name, runs in seen.items()
    }


def cpu_name():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown"


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit("usage: threads.py BEFORE AFTER [OUTPUT]")
    before, after = sys.argv[1:3]
    output = pathlib.Path(sys.argv[3] if len(sys.argv) == 4 else "docs/results/threads.json")
    cpus, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for threads in THREADS:
            builds = {"before": (before, False), "after": (after, False)}
            if threads > cpus:
                builds["forced"] = (after, True)
            for neighbours in NEIGHBOURS:
                video = pathlib.Path(folder, "frames.y4m")
                row = {"threads": threads, "neighbours": neighbours}
                row |= measure(builds, threads, neighbours, video)
                rows.append(row)
                walls = ", ".join(f"{name} {row[name]['wall_s']:.2f} s" for name in builds)
                print(f"{threads} threads, {neighbours} neighbours: {walls}", flush=True)
    result = {
        "frames": FRAMES,
        "limit_s": LIMIT_S,
        "rows": rows,
        "command": "scripts/experiments/threads.py BEFORE AFTER",
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "machine": {"cpu": cpu_name(), "cpus": cpus, "load_before": round(load, 2)},
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    temporary = output.with_suffix(".json.tmp")
    temporary.write_text(json.dumps(result, indent=2) + "\n")
    temporary.replace(output)


if __name__ == "__main__":
    main()
