"""Puts an ablation's figures together: FOLDER/generation.json and the runs' losses ->
docs/results/generation.json and sampler_loss_NAME.csv.

    variants_report.py FOLDER NAME OUTPUT COMMAND RUN...

FOLDER is that of scripts/experiments/variants.sh. Nothing is computed here. Objects of other names
in generation.json stay.
"""

import csv
import datetime
import json
import os
import pathlib
import sys

STEP = 100  # iterations between rows of the losses


def write(path, text):
    fresh = path.with_suffix(path.suffix + ".tmp")
    fresh.write_text(text)
    os.replace(fresh, path)


def losses(folder, runs):
    """Every STEP-th row of the runs' logs, as CSV."""
    lines = ["run,iteration,seconds,loss,validation_loss"]
    for run in runs:
        with open(folder / run / "log.csv", encoding="utf-8") as log:
            for row in csv.DictReader(log):
                if int(row["iteration"]) % STEP == 0:
                    lines.append(f"{run},{row['iteration']},{float(row['seconds']):.0f},"
                                 f"{row['loss']},{row['validation_loss']}")
    return "\n".join(lines) + "\n"


def merged_losses(path, folder, runs):
    """Those of the runs, and what the file has of others."""
    earlier = path.read_text().splitlines()[1:] if path.exists() else []
    kept = [line for line in earlier if line.split(",")[0] not in runs]
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
        row.setdefault("kept_from", {"commit": before["commit"], "date": before["date"]})
        now["rows"].insert(len(now["runs"]), row)
        now["runs"].append(run)


def main():
    folder, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
    name, command, runs = sys.argv[2], sys.argv[4], sys.argv[5:]
    report = json.loads((folder / "generation.json").read_text())
    del report["command"]  # of this machine's folders
    path = output / "generation.json"
    generation = json.loads(path.read_text()) if path.exists() else {}
    before = generation.get(name, {})
    generation[name] = {
        "command": command,
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    } | report
    keep_others(before, generation[name])
    write(path, json.dumps(generation, indent=2, sort_keys=True) + "\n")

    losses_path = output / f"sampler_loss_{name}.csv"
    write(losses_path, merged_losses(losses_path, folder, runs))


if __name__ == "__main__":
    main()
