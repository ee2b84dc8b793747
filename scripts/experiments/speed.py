"""What a frame costs beside what it cost before, by instruction set, threads and tier.

    scripts/run python3 scripts/experiments/speed.py BEFORE AFTER [--peers SPLAT_PEERS] [-o OUTPUT]

BEFORE and AFTER are checkouts with a build of `figurine` in build/release; each draws the person
that it ships (512x512, its golden pose swaying: a fresh pose and a run of the network a frame), and
both the same person of capsules (scripts/experiments/capsule.py, 1024x1024, seen once). All cases
take turns, ROUNDS times. Writes the medians over rounds of each run's medians to OUTPUT
(docs/results/speed.json), prints them, and holds the pictures of the capsules against each other;
about a minute and a half on idle CPUs. FIGURINE_BIND=FOLDER shows scripts/run a checkout elsewhere.

SPLAT_PEERS is a build of tests/bench/peers, which then draws the capsules by other splatters and by
this one, taking turns: "peers". What other scripts of this folder have measured of the same person,
what is left out, the network beside other runtimes, instructions on ARM, is taken over from their
files where they are there, with where and when it was measured.

What XNNPACK runs does not depend on --isa, which limits figurine's own kernels: every row has its
time without the network beside it.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

import pfm
import results

ROUNDS = 5
FRAMES = 60
EQUAL_DB = 300  # what splat_peers says of pictures without a difference
FIGURINE = "build/release/samples/figurine/figurine"
PERSON = "samples/packages/person.fgn"


def run(checkout, *arguments):
    command = [pathlib.Path(checkout, FIGURINE).resolve(), *map(str, arguments), "--json"]
    if arguments[0] == "bench":
        command.append("-")
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"speed: {' '.join(map(str, command))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def person(checkout, threads, *options):
    command = ["bench", PERSON, "--size", "512x512", "--frames", FRAMES, "--precision", "q8"]
    report = run(checkout, *command, "--threads", threads, *options)
    (lane,) = [lane for lane in report["runs"] if lane["threads"] == threads]
    stages = {stage: times["median"] for stage, times in lane["stages_ms"].items()}
    row = {
        "p50_ms": stages["total"],
        "p99_ms": lane["stages_ms"]["total"].get("p99"),
        "missed_60hz": lane.get("missed_60hz"),
        "first_frame_ms": report["first_frame_ms"]["total"],
    }
    return row, stages, report["machine"]["cpu"]


def capsules(checkout, scene, picture, *options):
    command = ["splat", scene, "--size", "1024x1024", "--threads", 1, "-o", picture]
    report = run(checkout, *command, *options)
    stages = {stage: times["median"] for stage, times in report["stages_ms"].items()}
    # A single frame also waits for memory that it touches first, which no stage counts.
    total = sum(ms for stage, ms in stages.items() if stage != "total")
    return {"p50_ms": total}, stages, report["machine"]["cpu"]


def supported_isas(checkout):
    """Those of this CPU, the baseline first."""
    isas = ["baseline", "neon", "sse41", "avx2", "avx512"]
    program = pathlib.Path(checkout, FIGURINE).resolve()
    command = [program, "selftest", PERSON, "--isa"]
    return [
        isa
        for isa in isas
        if subprocess.run([*command, isa], cwd=checkout, capture_output=True).returncode == 0
    ]


def cases(before, after, folder):
    """{(scene, build, isa, threads, tier): function} of everything that is measured."""
    scene = pathlib.Path(folder, "capsules.ply")
    maker = pathlib.Path(__file__).with_name("capsule.py")
    subprocess.run([sys.executable, maker, scene], check=True)
    table = {}
    for threads in (1, 2):
        table["person", "before", "", threads, "exact"] = lambda t=threads: person(before, t)
    picture = pathlib.Path(folder, "before.pfm")
    table["capsules", "before", "", 1, "exact"] = lambda: capsules(before, scene, picture)
    for isa in supported_isas(after):
        for threads in (1, 2):
            table["person", "after", isa, threads, "exact"] = (
                lambda i=isa, t=threads: person(after, t, "--isa", i)
            )
        table["person", "after", isa, 1, "fast"] = (
            lambda i=isa: person(after, 1, "--isa", i, "--fast-blend")
        )
        out = pathlib.Path(folder, f"{isa}.pfm")
        table["capsules", "after", isa, 1, "exact"] = (
            lambda i=isa, o=out: capsules(after, scene, o, "--isa", i)
        )
    return table


def time_of(rows, **wanted):
    for row in rows:
        if all(row[key] == value for key, value in wanted.items()):
            return row["p50_ms"]
    return None


def summary_of(rows):
    def ratio(over, under):
        return over / under if over and under else None

    before = {
        scene: time_of(rows, scene=scene, build="before", threads=1)
        for scene in ("person", "capsules")
    }
    summary = {}
    for isa in ("baseline", "neon", "sse41", "avx2", "avx512"):
        after = {"build": "after", "isa": isa, "threads": 1, "tier": "exact"}
        for name, scene in (("frame", "person"), ("capsule_1024", "capsules")):
            speedup = ratio(before[scene], time_of(rows, scene=scene, **after))
            if speedup:
                summary[f"{name}_speedup_{isa}"] = speedup
    best = [row for row in rows if row["build"] == "after" and row["scene"] == "person"][-1]["isa"]
    same = {"scene": "person", "build": "after", "isa": best, "tier": "exact"}
    one, two = time_of(rows, threads=1, **same), time_of(rows, threads=2, **same)
    summary["two_core_scaling"] = ratio(one, two)
    (first,) = [
        row["first_frame_ms"]
        for row in rows
        if row["threads"] == 1 and all(row[key] == value for key, value in same.items())
    ]
    return summary | {"first_frame_ms": first}


def splat_peers(program, folder):
    """Other splatters on the capsules, and this one: medians of repetitions that take turns."""
    command = [program, pathlib.Path(folder, "capsules.ply"), "--benchmark_format=json"]
    command += ["--benchmark_enable_random_interleaving=true", "--benchmark_repetitions=9"]
    command += ["--benchmark_report_aggregates_only=true", "--benchmark_min_time=0.05s"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    rows = [
        {"name": entry["run_name"].split("/iterations")[0], "ms": entry["real_time"]}
        | {"psnr_db": entry["psnr_db"] if entry["psnr_db"] < EQUAL_DB else None}
        for entry in json.loads(done.stdout)["benchmarks"]
        if entry["aggregate_name"] == "median"
    ]
    rows.sort(key=lambda row: row["ms"])
    fastest = min(row["ms"] for row in rows if row["name"].startswith("figurine/"))
    return [row | {"times_figurine": row["ms"] / fastest} for row in rows]


def measured_elsewhere(name, *keys):
    """Parts of another report of this folder, and where they are from, if it is there."""
    path = pathlib.Path("docs/results", f"{name}.json")
    if not path.exists():
        return {}
    report = json.loads(path.read_text())
    kept = ("command", "commit", "date", "machine", *keys)
    return {key: report[key] for key in kept if key in report}


def main():
    parser = argparse.ArgumentParser(prog="speed.py", allow_abbrev=False)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("--peers", metavar="SPLAT_PEERS")
    parser.add_argument("-o", "--output", type=pathlib.Path, default="docs/results/speed.json")
    arguments = parser.parse_args()
    load, seen, cpu, peers = os.getloadavg()[0], {}, "", []
    with tempfile.TemporaryDirectory() as folder:
        table = cases(arguments.before, arguments.after, folder)
        if arguments.peers:
            peers = splat_peers(arguments.peers, folder)
        order = list(table)
        for turn in range(ROUNDS):
            for key in order if turn % 2 == 0 else reversed(order):
                row, stages, cpu = table[key]()
                seen.setdefault(key, []).append((row, stages))
        rows = []
        for key, runs in seen.items():
            row = dict(zip(("scene", "build", "isa", "threads", "tier"), key))
            for field in runs[0][0]:
                values = [run[field] for run, _ in runs if run[field] is not None]
                row[field] = statistics.median(values) if values else None
            row["fps"] = 1000 / row["p50_ms"]
            stages = {
                stage: statistics.median(stages[stage] for _, stages in runs)
                for stage in runs[0][1]
            }
            row["without_network_ms"] = row["p50_ms"] - stages.get("network", 0)
            row["stages_ms"] = stages
            rows.append(row)
            print(", ".join(f"{k} {v}" for k, v in results.rounded(row).items() if v != ""))
        pictures = {
            path.stem: pfm.psnr_db(path, pathlib.Path(folder, "before.pfm"))
            for path in sorted(pathlib.Path(folder).glob("*.pfm"))
            if path.stem in ("baseline", "neon", "sse41", "avx2", "avx512")
        }
    arm = measured_elsewhere("arm_instructions", "summary")
    report = results.head("scripts/experiments/speed.py BEFORE AFTER --peers SPLAT_PEERS")
    report |= {
        "machine": {"cpu": cpu, "cpus": len(os.sched_getaffinity(0)), "load_before": load},
        "before": os.environ.get("FIGURINE_BEFORE", "unknown"),
        "rounds": ROUNDS,
        "summary": summary_of(rows) | arm.get("summary", {}),
        "capsules_psnr_to_before_db": pictures,  # null: equal to the bit
        "rows": rows,
        "peers": {"splat": peers, "network": measured_elsewhere("network_peers", "rows")},
        "arm_instructions": arm,
        "left_out": measured_elsewhere("left_out", "rows"),
        "crowd": measured_elsewhere("crowd", "rows"),
    }
    results.write(arguments.output, report)


if __name__ == "__main__":
    main()
