"""What each stage of a frame costs in two builds, measured by turns.

    scripts/run python3 scripts/experiments/frame_stages.py BEFORE AFTER [OUTPUT]

BEFORE and AFTER are two builds of `figurine`. Both bench the shipped avatar, with one thread and
with two, ROUNDS times each, the first of a round changing places. Writes the medians over rounds of
each run's medians, and AFTER's share of BEFORE, to OUTPUT (docs/results/frame_stages.json), and
prints them; about two minutes. FIGURINE_BIND=FOLDER shows scripts/run a program elsewhere.
"""

import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

import results

ROUNDS = 9
THREADS = (1, 2)
AVATAR = "samples/packages/person.fgn"


def bench(program, threads, folder):
    """{"q8 blend": ms, ..., "first frame": ms} of one run."""
    report = pathlib.Path(folder, "bench.json")
    command = [program, "bench", AVATAR, "--threads", str(threads), "--json", str(report)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    measured = json.loads(report.read_text())
    stages = {
        f"{run['precision']} {stage}": times["median"]
        for run in measured["runs"]
        for stage, times in run["stages_ms"].items()
    }
    return stages | {"first frame": measured["first_frame_ms"]["total"]}, measured["machine"]


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit("usage: frame_stages.py BEFORE AFTER [OUTPUT]")
    builds = {"before": sys.argv[1], "after": sys.argv[2]}
    output = pathlib.Path(sys.argv[3] if len(sys.argv) == 4 else "docs/results/frame_stages.json")
    load, rows, machine = os.getloadavg()[0], [], {}
    with tempfile.TemporaryDirectory() as folder:
        for threads in THREADS:
            seen = {name: [] for name in builds}
            for turn in range(ROUNDS):
                for name in sorted(builds, reverse=turn % 2 == 0):
                    stages, machine = bench(builds[name], threads, folder)
                    seen[name].append(stages)
            for stage in seen["before"][0]:
                times = {
                    name: statistics.median(run[stage] for run in runs)
                    for name, runs in seen.items()
                }
                row = {"threads": threads, "stage": stage}
                row |= {f"{name}_ms": value for name, value in times.items()}
                row["ratio"] = times["after"] / times["before"] if times["before"] else None
                rows.append(row)
                print(", ".join(f"{key} {value}" for key, value in results.rounded(row).items()))
    summary = {
        f"{row['stage'].replace(' ', '_')}_{row['threads']}_threads": row["ratio"]
        for row in rows
        if row["stage"] in ("q8 total", "f32 total", "first frame")
    }
    report = results.head("scripts/experiments/frame_stages.py BEFORE AFTER")
    report |= {
        "machine": {"cpu": machine["cpu"], "cpus": machine["cpus"], "load_before": round(load, 2)},
        "before": os.environ.get("FIGURINE_BEFORE", "unknown"),
        "rounds": ROUNDS,
        "ratio": summary,
        "rows": rows,
    }
    results.write(output, report)


if __name__ == "__main__":
    main()
