"""What threads cost where CPUs are few or busy: threads x busy neighbours, rendering and training.

    scripts/run python3 scripts/experiments/threads.py BEFORE AFTER TRAIN [OUTPUT]

BEFORE and AFTER are two builds of `figurine`. Both render the same 60 frames of the shipped walker
in int8 at 512x512, by turns; a neighbour is a process that only spins. AFTER renders them once more
with --force-threads where more threads are asked for than there are CPUs.

TRAIN is a `figurine-train`. It trains an edge avatar of the mannequin for 40 iterations, by turns
as it is ("libgomp": its threads look 300,000 times for work before they sleep) and with
GOMP_SPINCOUNT=1000 in its environment ("short", about 50 us).

Writes medians of wall and CPU seconds to OUTPUT (docs/results/threads.json), and prints them; about
fifteen minutes. No program need be of this checkout: FIGURINE_BIND=FOLDER shows scripts/run another
one. FIGURINE_QUICK=1 runs each case once, on 1 and 2 threads, to see that everything works.
"""

import datetime
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time

import neighbours
import results

QUICK = os.environ.get("FIGURINE_QUICK", "") != ""
THREADS = (1, 2) if QUICK else (1, 2, 3, 4, 8)
TRAINING_THREADS = (1, 2) if QUICK else (1, 2, 4)
NEIGHBOURS = (0, 1) if QUICK else (0, 1, 2)
RUNS = 1 if QUICK else 5
LONG_S = 10  # a case whose first run takes longer is run once
LIMIT_S = 60  # what takes longer counts as this
FRAMES = 60
ITERATIONS = 40
PRESET = "edge"
PACKAGES = pathlib.Path("samples/packages")
SHORT = {"GOMP_SPINCOUNT": "1000"}


def timed(command, environment=None):
    """Wall and CPU seconds of one process, which is ended after LIMIT_S."""
    begin = time.monotonic()
    process = subprocess.Popen(
        [str(word) for word in command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **(environment or {})},
    )
    limit = threading.Timer(LIMIT_S, process.kill)
    limit.start()
    _, status, usage = os.wait4(process.pid, 0)
    limit.cancel()
    wall = time.monotonic() - begin
    if status != 0 and wall < LIMIT_S:
        code = os.waitstatus_to_exitcode(status)
        sys.exit(f"threads.py: {' '.join(str(word) for word in command)}: failed with {code}")
    return wall, usage.ru_utime + usage.ru_stime


def rendering(program, threads, folder, forced=False):
    command = [program, "render", PACKAGES / "person.fgn", "--motion", PACKAGES / "walk.fgn"]
    command += ["--frames", f"0:{FRAMES}", "--size", "512x512", "--precision", "q8"]
    command += ["--threads", threads, "-o", folder / "frames.y4m"]
    return lambda: timed([*command, *(["--force-threads"] if forced else [])])


def training(program, threads, folder, environment=None):
    def train():
        with tempfile.TemporaryDirectory(dir=folder) as run:
            command = [program, "avatar", "--data", folder / "capture/000000"]
            command += ["--body", folder / "body.fgn", "-o", pathlib.Path(run, "run"), "--quiet"]
            command += ["--preset", PRESET, "--iterations", ITERATIONS]
            return timed([*command, "--threads", threads, "--force-threads"], environment)

    return train


def write_capture(program, folder):
    """The mannequin, walking, from eight cameras."""
    timed([program, "body", "--mannequin", "--uv", 128, "-o", folder / "body.fgn"])
    command = [program, "capture", "--body", folder / "body.fgn", "--identities", 1, "--seed", 1]
    command += ["--views", 8, "--bust-views", 0, "--frames", 8, "--size", "256x256"]
    timed([*command, "-o", folder / "capture"])


def measure(cases, count):
    """{case: {wall_s, cpu_s, runs}}; cases: {name: what gives wall and CPU seconds}, by turns."""
    seen = {name: [] for name in cases}
    with neighbours.busy(count):
        for _ in range(RUNS):
            for name, case in cases.items():
                if not seen[name] or seen[name][0][0] < LONG_S:
                    seen[name].append(case())
    return {
        name: {
            "wall_s": round(statistics.median(wall for wall, _ in runs), 3),
            "cpu_s": round(statistics.median(cpu for _, cpu in runs), 3),
            "runs": len(runs),
        }
        for name, runs in seen.items()
    }


def measure_all(what, thread_counts, cases_of):
    """A row for threads x neighbours; cases_of: the cases of so many threads."""
    rows = []
    for threads in thread_counts:
        for count in NEIGHBOURS:
            seen = measure(cases_of(threads), count)
            rows.append({"threads": threads, "neighbours": count} | seen)
            walls = ", ".join(f"{name} {case['wall_s']:.2f} s" for name, case in seen.items())
            print(f"{what}: {threads} threads, {count} neighbours: {walls}", flush=True)
    return rows


def cpu_name():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown"


def main():
    if len(sys.argv) not in (4, 5):
        sys.exit("usage: threads.py BEFORE AFTER TRAIN [OUTPUT]")
    before, after, train = sys.argv[1:4]
    output = pathlib.Path(sys.argv[4] if len(sys.argv) == 5 else "docs/results/threads.json")
    cpus, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def renderings(threads):
            cases = {"before": rendering(before, threads, folder),
                     "after": rendering(after, threads, folder)}
            forced = {"forced": rendering(after, threads, folder, forced=True)}
            return cases | (forced if threads > cpus else {})

        def trainings(threads):
            return {"libgomp": training(train, threads, folder),
                    "short": training(train, threads, folder, SHORT)}

        rows = measure_all("rendering", THREADS, renderings)
        write_capture(train, folder)
        training_rows = measure_all("training", TRAINING_THREADS, trainings)
    result = {
        "frames": FRAMES,
        "limit_s": LIMIT_S,
        "rows": rows,
        "training": {"iterations": ITERATIONS, "preset": PRESET, "rows": training_rows},
        "command": "scripts/experiments/threads.py BEFORE AFTER TRAIN",
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "machine": {"cpu": cpu_name(), "cpus": cpus, "load_before": round(load, 2)},
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    results.write(output, result)


if __name__ == "__main__":
    main()
