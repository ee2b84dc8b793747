"""Puts an ablation's figures together: FOLDER/generation.json and the runs' losses ->
docs/results/generation_NAME.json, generation_entropy.csv and sampler_loss_NAME.csv.

    variants_report.py FOLDER NAME OUTPUT COMMAND RUN...

FOLDER is that of scripts/experiments/variants.sh. Nothing is computed here.
"""

import csv
import pathlib
import sys

import results
from generation_files import read_generation, write_generation

STEP = 100  # iterations between rows of the losses


def losses(folder, runs):
    """Every STEP-th row of the runs' logs, as CSV."""
    lines = ["run,iteration,seconds,loss,validation_loss"]
    for run in runs:
        with open(folder / run / "log.csv", encoding="utf-8") as log:
            for row in csv.DictReader(log):
                if int(row["iteration"]) % STEP == 0:
                    seconds = f"{float(row['seconds']):.0f}"
                    cells = [run, row["iteration"], seconds, row["loss"], row["validation_loss"]]
                    lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def merged_losses(path, folder, runs):
    """Those of the runs, and what the file has of others."""
    before = path.read_text().splitlines()[1:] if path.exists() else []
    kept = [line for line in before if line.split(",")[0] not in runs]
    head, *rows = losses(folder, runs).splitlines()
    return "\n".join([head, *rows, *kept]) + "\n"


def keep_others(before, now):
    """Rows of trainings that were not judged this time, with the commit and date that they are
    from, if they are of the same population."""
    if before.get("population_hash") != now["population_hash"]:
        return
    trained = {run["name"] for run in now["runs"]}
    for run in before["runs"]:
        if run["name"] in trained:
            continue
        row = next(row for row in before["rows"] if row["name"] == run["name"])
        row.setdefault("kept_from", {key: before[key] for key in ("commit", "date")})
        now["rows"].insert(len(now["runs"]), row)
        now["runs"].append(run)


def main():
    folder, name, output = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
    command, runs = sys.argv[4], sys.argv[5:]
    report = results.read(folder / "generation.json")
    del report["command"]  # of this machine's folders
    now = results.head(command) | report
    keep_others(read_generation(output).get(name, {}), now)
    write_generation(output, {name: now})

    losses_path = output / f"sampler_loss_{name}.csv"
    results.write_text(losses_path, merged_losses(losses_path, folder, runs))


if __name__ == "__main__":
    main()
