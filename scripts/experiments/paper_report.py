"""Puts the two runs of scripts/experiments/paper.sh together: FOLDER/runs/{paper,edge} and their
packages -> docs/results/paper.json.

    paper_report.py FOLDER OUTPUT FIGURINE COMMAND

FIGURINE is a build of `figurine`, which draws both for their milliseconds, by turns, on one thread
in the size that they were trained at.
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile

import results
from results import read
from sharp_report import row

PRESETS = {"paper": "body_paper.fgn", "edge": "body.fgn"}
SIZE = "750x1024"  # of the training images
RUNS = 3  # of figurine bench a package, by turns


def bench(figurine, package, body, folder):
    report = pathlib.Path(folder) / "bench.json"
    command = [figurine, "bench", package, "--body", body, "--threads", "1", "--frames", "10"]
    command += ["--size", SIZE]
    subprocess.run([*command, "--json", report], check=True, stdout=subprocess.DEVNULL)
    (run,) = read(report)["runs"]
    return {stage: times["median"] for stage, times in run["stages_ms"].items()}


def stages_ms(folder, figurine):
    seen = {}
    with tempfile.TemporaryDirectory() as scratch:
        for _ in range(RUNS):
            for preset, body in PRESETS.items():
                for suffix in ("", "_q8"):
                    times = bench(
                        figurine, folder / f"{preset}{suffix}.fgn", folder / body, scratch
                    )
                    seen.setdefault(preset + suffix, []).append(times)
    return {
        name: {stage: statistics.median(run[stage] for run in runs) for stage in runs[0]}
        for name, runs in seen.items()
    }


def main(folder, output, figurine, command):
    folder = pathlib.Path(folder)
    times = stages_ms(folder, figurine)
    rows = []
    for preset in PRESETS:
        entry = row(preset, folder / "runs" / preset)
        if entry is None:
            sys.exit(f"paper_report: {folder}: {preset} is not trained and evaluated")
        for suffix, name in (("", "f32"), ("_q8", "q8")):
            entry[f"package_bytes_{name}"] = (folder / f"{preset}{suffix}.fgn").stat().st_size
            entry[f"stages_ms_{name}"] = times[preset + suffix]
        rows.append(entry)
    results.write(pathlib.Path(output), results.head(command) | {"rows": rows})


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
