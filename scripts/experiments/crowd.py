"""A crowd of small figures beside one large one: time, and what a coarse tier changes.

    scripts/run python3 scripts/experiments/crowd.py [COARSE.fgn]

COARSE.fgn is the same person in less detail; without one those rows are left out.

Draws 64 of the shipped person (512x512, in the shipped walk, int8, one core), each some 60 pixels
high and in a pose of its own, exactly and with what may be left out of small figures, and one
figure of 400 pixels, by turns, ROUNDS times, by the build of `figurine` in build/release; then the
crowd as float pictures, each held against the exact ones over the pixels that show somebody. Writes
docs/results/crowd.json, and prints it; some minutes on an idle core.
"""

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
BENCH_FRAMES = 24
PICTURE_FRAMES = "8:12"
FIGURINE = pathlib.Path("build/release/samples/figurine/figurine")
PERSON = ["samples/packages/person.fgn", "--motion", "samples/packages/walk.fgn"]
FRAME = ["--size", "512x512", "--precision", "q8", "--threads", "1"]
# From far and above, so that rows do not hide each other.
CROWD = ["--crowd", "64", "--spacing", "1.6", "--camera", "orbit:20,35,40,19"]
OUTPUT = pathlib.Path("docs/results/crowd.json")

CASES = {
    "one": ["--framing", "body"],
    "exact": CROWD,
    "network at one of 4 frames": [*CROWD, "--network-hz", "7.5"],
    "averted above 0.25": [*CROWD, "--averted-above", "0.25"],
}


def with_coarse(package):
    coarse = [*CROWD, "--coarse", package, "--coarse-below-px", "100"]
    faster = [*coarse, "--averted-above", "0.25", "--fast-blend"]
    return {"coarse": coarse, "coarse, averted above 0.25, fast blend": faster}


def run(*arguments):
    command = [str(FIGURINE.resolve()), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"crowd: {' '.join(command)}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def bench(options):
    report = run("bench", *PERSON, *FRAME, "--frames", BENCH_FRAMES, "--json", "-", *options)
    (lane,) = report["runs"]
    return lane, report["machine"]["cpu"]


def draw(folder, name, options):
    out = pathlib.Path(folder, f"{name}_%04d.pfm")
    run("render", *PERSON, *FRAME, "--frames", PICTURE_FRAMES, "-o", out, "--json", *options)
    return sorted(pathlib.Path(folder).glob(f"{name}_*.pfm"))


def error_db(truths, pictures):
    squares, count = 0.0, 0
    for truth, picture in zip(truths, pictures):
        more, values = pfm.foreground_error(truth, picture)
        squares, count = squares + more, count + values
    return pfm.decibels(squares, count)


def main():
    if len(sys.argv) > 2:
        sys.exit("usage: crowd.py [COARSE.fgn]")
    cases = CASES | (with_coarse(sys.argv[1]) if len(sys.argv) == 2 else {})
    load, lanes, cpu = os.getloadavg()[0], {name: [] for name in cases}, ""
    for turn in range(ROUNDS):
        for name in list(cases)[:: 1 if turn % 2 else -1]:
            lane, cpu = bench(cases[name])
            lanes[name].append(lane)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        truths = draw(folder, "exact", cases["exact"])
        for i, (name, options) in enumerate(cases.items()):
            row = {"tier": name, "figures": 1 if name == "one" else 64}
            row["options"] = " ".join(options[len(CROWD) if name != "one" else 0 :])
            for field in ("total", "network", "blend"):
                times = [lane["stages_ms"][field]["median"] for lane in lanes[name]]
                row[f"{field}_ms"] = statistics.median(times)
            row["gaussians"] = lanes[name][0]["work"]["gaussians"]
            row["of_one_figure"] = row["total_ms"] / (rows[0] if rows else row)["total_ms"]
            row["psnr_db"] = (
                None if name in ("one", "exact")
                else error_db(truths, draw(folder, f"picture{i}", options))
            )  # fmt: skip
            rows.append(row)
            print(", ".join(f"{key} {value}" for key, value in results.rounded(row).items()))
    report = results.head(" ".join(["scripts/experiments/crowd.py", *sys.argv[1:]]))
    report["machine"] = {"cpu": cpu, "load_before": load}
    report |= {"rounds": ROUNDS, "frames": BENCH_FRAMES, "rows": rows}
    results.write(OUTPUT, report)


if __name__ == "__main__":
    main()
