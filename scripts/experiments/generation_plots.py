"""Draws docs/results/generation*.json and the CSV files beside them: where members are decided,
what more people to learn from change, how the trainings went.

    generation_plots.py RESULTS NAME OUTPUT

RESULTS is docs/results; NAME the population whose people and trainings are drawn (where members
are decided, `edge` beside); OUTPUT a PNG. Needs scripts/setup plots.
"""

import csv
import pathlib
import re
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plot

import results
from generation_files import read_generation

COLOURS = {"layer": "#1f77b4", "flat": "#ff7f0e", "latent": "#2ca02c", "basis": "#d62728",
           "shipped": "#d62728", "alone": "#9467bd", "mixed": "#8c564b", "velocity": "#e377c2",
           "dropout": "#7f7f7f", "decay": "#bcbd22"}
TOKENS = ("layer", "flat", "latent", "basis", "shipped")  # the others differ in something else


def variant_of(run):
    return re.sub(r"_.*", "", run)


def draw_entropy(axes, generation, rows, population):
    for name, style in ((population, "-"), ("edge", "--")):
        for run in generation.get(name, {}).get("runs", []):
            entropy = run.get("posterior_entropy")
            if entropy is None or run["name"] not in TOKENS:
                continue
            own = [row for row in rows if (row["population"], row["run"]) == (name, run["name"])]
            levels = [(float(row["dimension_snr"]), float(row["nats"])) for row in own]
            levels = [(snr, nats / entropy["undecided_nats"]) for snr, nats in levels if snr < 1e4]
            members = round(2.718281828 ** entropy["undecided_nats"])
            axes.semilogx(*zip(*levels), style, color=COLOURS[run["name"]],
                          label=f"{name}, {run['name']}, N {members}")
    axes.axvspan(0.1, 100, color="#eeeeee", zorder=0)
    axes.set(xlabel="D x SNR (grey: the band with half of the levels)",
             ylabel="posterior entropy / ln N", title="Where it is decided who it will be")
    axes.legend(fontsize=7)


def numbers_of_people(report):
    """Of the variants that were trained on several numbers of people: the number and the novelty of
    every training."""
    series = {}
    for variant in ("layer", "basis"):
        points = [(row["learnt_from"], row["novelty"]["pictures"]) for row in report["rows"]
                  if variant_of(row["name"]) == variant and "novelty" in row]
        if len(points) > 1:
            series[variant] = sorted(points, key=lambda point: point[0])
    return series


def draw_people(axes, report, population):
    rows = {row["name"]: row for row in report["rows"]}
    for variant, points in numbers_of_people(report).items():
        size, colour = [size for size, _ in points], COLOURS[variant]
        axes.semilogx(size, [100 * novelty["copy_share"] for _, novelty in points], "o-",
                      color=colour, label=f"{variant}: near copies, %")
        axes.semilogx(size, [100 * novelty["median_ratio"] for _, novelty in points], "s:",
                      color=colour, label=f"{variant}: nearest member, % of members' own")
    held_out = rows["held-out members"]["novelty"]["pictures"]
    axes.axhline(100 * held_out["copy_share"], color="grey", linewidth=0.8,
                 label="held-out people: near copies, %")
    axes.axhline(100 * held_out["median_ratio"], color="grey", linewidth=0.8, linestyle=":",
                 label="held-out people: nearest member, %")
    axes.set(xlabel="people to learn from", title=f"Copies and newness of samples, {population}")
    axes.set_xticks([50, 100, 250, 500], ["50", "100", "250", "500"])
    axes.minorticks_off()
    axes.set_ylim(top=210)  # room for the legend
    axes.legend(fontsize=7, loc="upper right")


def draw_losses(axes, path, population):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for run in dict.fromkeys(row["run"] for row in rows):
        if "_" in run or run == "velocity":  # whose loss is of something else
            continue
        own = [row for row in rows if row["run"] == run]
        iterations = [int(row["iteration"]) for row in own]
        axes.plot(iterations, [float(row["loss"]) for row in own], color=COLOURS[run], label=run)
        checked = [row for row in own if row["validation_loss"]]
        iterations = [int(row["iteration"]) for row in checked]
        losses = [float(row["validation_loss"]) for row in checked]
        axes.plot(iterations, losses, ":", color=COLOURS[run])
    axes.set(xlabel="iteration", ylabel="mean square error of clean values",
             title=f"Loss at {population} (dotted: validation members)")
    axes.legend(fontsize=7)


def main():
    folder, population, output = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    generation = read_generation(folder)
    several = bool(numbers_of_people(generation[population]))
    figure, axes = plot.subplots(1, 2 + several, figsize=(5 * (2 + several), 4.4), dpi=80)
    draw_entropy(axes[0], generation, results.read_rows(folder / "generation_entropy.csv"),
                 population)
    if several:
        draw_people(axes[1], generation[population], population)
    draw_losses(axes[-1], folder / f"sampler_loss_{population}.csv", population)
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(output, metadata={"Software": None})


if __name__ == "__main__":
    main()
