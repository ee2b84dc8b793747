"""Copies over training time: FOLDER/generation.json and the runs' own files -> a table, the budget
that is shipped, and a picture.

    copies_report.py FOLDER OUTPUT.json PLOT.png COMMAND

FOLDER is that of scripts/experiments/copies.sh. Needs scripts/setup plots.
"""

import pathlib
import re
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plot

import results

SHIPPED = "100_mixed_"  # the series that a budget is chosen from
MOST_COPIES = 5  # percent of samples: as many as members are of each other, by definition
SHARP = 0.85  # of training people's high-pass energy
COLOURS = {25: "#2ca02c", 50: "#ff7f0e", 100: "#1f77b4"}


def row_of(name, row, run):
    held_out = row["held_out"].get("draws", row["held_out"])

    def drawn(key):
        value = held_out[key]
        return value["value"] if isinstance(value, dict) else value

    found = re.fullmatch(r"(\d+)_(alone|mixed)_(\d+)", name)
    novelty = row["novelty"]
    table = {
        "name": name,
        "members": run["settings"]["members"],
        "mixed_share": run["settings"]["mixed_share"],
        "series": bool(found),
        "iterations": run["iterations"],
        "train_seconds": run["train_seconds"],
        "loss": run["loss"],
        "validation_loss": run["validation_loss"],
        "copies_percent": 100 * novelty["pictures"]["copy_share"],
        "nearest_ratio": novelty["pictures"]["median_ratio"],
        "mmd_psnr_db": drawn("mmd_psnr_db"),
        "coverage_percent": drawn("coverage_percent"),
        "one_nna_percent": drawn("one_nna_percent"),
        "highpass_ratio": row["highpass_ratio"],
        "mixed_percent": 100 * row["by_part"]["mixed_share"],
    }
    for network in novelty.get("perceptual", {}).values():
        table["copies_network_percent"] = 100 * network["copy_share"]
    if "bust" in row:
        table["bust_highpass_ratio"] = row["bust"]["highpass_ratio"]
    return table


def choose(rows):
    """Among the budgets whose copies of training people are few, in pictures and through the
    network: the shortest that is sharp enough, or else the sharpest."""
    series = [row for row in rows if row["name"].startswith(SHIPPED)]
    few = [row for row in series if max(row["copies_percent"],
                                        row.get("copies_network_percent", 0)) <= MOST_COPIES]
    if not few:
        return None
    sharp = [row for row in few if row["highpass_ratio"] >= SHARP]
    if sharp:
        return min(sharp, key=lambda row: row["iterations"])
    return max(few, key=lambda row: row["highpass_ratio"])


def draw(rows, members, output):
    panels = (("copies_percent", "near copies of training people, %"),
              ("highpass_ratio", "sharpness against training people"),
              ("coverage_percent", "COV of all draws, %"),
              ("one_nna_percent", "1-NNA of all draws, %"),
              ("validation_loss", "loss on validation people"))
    figure, axes = plot.subplots(1, len(panels), figsize=(20, 3.8), dpi=80)
    for axis, (key, title) in zip(axes, panels):
        for count, colour in COLOURS.items():
            for mixed, style in ((True, "o-"), (False, "s:")):
                own = sorted((row["iterations"], row[key]) for row in rows
                             if row["series"] and row["members"] == count
                             and (row["mixed_share"] > 0) == mixed and row[key] is not None)
                if own:
                    axis.semilogx(*zip(*own), style, color=colour,
                                  label=f"{count} people{', mixed by part' if mixed else ''}")
        if key in members:
            axis.axhline(members[key], color="grey", linewidth=0.8)
        axis.set(xlabel="iterations", title=title)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(output, metadata={"Software": None})


def main():
    folder, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    report = results.read(folder / "generation.json")
    runs = {run["name"]: run for run in report["runs"]}
    by_name = {row["name"]: row for row in report["rows"]}
    rows = [row_of(name, by_name[name], run) for name, run in runs.items()]
    held_out, training = by_name["held-out members"], by_name["training members"]
    drawn = training["held_out"].get("draws", training["held_out"])
    members = {
        "copies_percent": 100 * held_out["novelty"]["pictures"]["copy_share"],
        "coverage_percent": drawn["coverage_percent"],
        "one_nna_percent": drawn["one_nna_percent"],
        "highpass_ratio": 1,
    }
    chosen = choose(rows)
    results.write(output, results.head(sys.argv[4]) | {
        "machine": report["machine"],
        "population": report["population"],
        "population_hash": report["population_hash"],
        "most_copies_percent": MOST_COPIES,
        "least_highpass_ratio": SHARP,
        "chosen": chosen["name"] if chosen else None,
        "held_out_copies_percent": members["copies_percent"],
        "members_coverage_percent": members["coverage_percent"],
        "rows": rows,
    })
    draw(rows, members, sys.argv[3])


if __name__ == "__main__":
    main()
