"""Draws docs/results/generation.json: where members are decided, what more people to learn from
change, how the trainings went.

    generation_plots.py RESULTS OUTPUT

RESULTS is docs/results; OUTPUT a PNG. Needs scripts/setup plots.
"""

import csv
import json
import pathlib
import re
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plot

COLOURS = {"layer": "#1f77b4", "flat": "#ff7f0e", "latent": "#2ca02c", "basis": "#d62728"}


def variant_of(run):
    return re.sub(r"_.*", "", run)


def draw_entropy(axes, generation):
    for name, style in (("nano", "-"), ("edge", "--")):
        for run in generation.get(name, {}).get("runs", []):
            entropy = run.get("posterior_entropy")
            if entropy is None or "_" in run["name"]:
                continue
            levels = [level for level in entropy["levels"] if level["dimension_snr"] < 1e4]
            members = round(2.718281828 ** entropy["undecided_nats"])
            axes.semilogx([level["dimension_snr"] for level in levels],
                          [level["nats"] / entropy["undecided_nats"] for level in levels], style,
                          color=COLOURS[run["name"]], label=f"{name}, {run['name']}, N {members}")
    axes.axvspan(0.1, 100, color="#eeeeee", zorder=0)
    axes.set(xlabel="D x SNR (grey: the band with half of the levels)",
             ylabel="posterior entropy / ln N", title="Where it is decided who it will be")
    axes.legend(fontsize=7)


def draw_people(axes, report):
    rows = {row["name"]: row for row in report["rows"]}
    for variant in ("layer", "basis"):
        points = sorted((row["learnt_from"], row) for name, row in rows.items()
                        if variant_of(name) == variant and "novelty" in row)
        size = [point[0] for point in points]
        axes.semilogx(size, [100 * row["novelty"]["pictures"]["copy_share"] for _, row in points],
                      "o-", color=COLOURS[variant], label=f"{variant}: near copies, %")
        axes.semilogx(size, [100 * row["novelty"]["pictures"]["median_ratio"] for _, row in points],
                      "s:", color=COLOURS[variant],
                      label=f"{variant}: nearest member, % of members' own")
    held_out = rows["held-out members"]["novelty"]["pictures"]
    axes.axhline(100 * held_out["copy_share"], color="grey", linewidth=0.8,
                 label="held-out people: near copies, %")
    axes.axhline(100 * held_out["median_ratio"], color="grey", linewidth=0.8, linestyle=":",
                 label="held-out people: nearest member, %")
    axes.set(xlabel="people to learn from", title="Copies and newness of samples, nano")
    axes.set_xticks([50, 100, 250, 500], ["50", "100", "250", "500"])
    axes.minorticks_off()
    axes.set_ylim(top=210)  # room for the legend
    axes.legend(fontsize=7, loc="upper right")


def draw_losses(axes, path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for run in dict.fromkeys(row["run"] for row in rows):
        if "_" in run:
            continue
        own = [row for row in rows if row["run"] == run]
        axes.plot([int(row["iteration"]) for row in own], [float(row["loss"]) for row in own],
                  color=COLOURS[run], label=run)
        checked = [row for row in own if row["validation_loss"]]
        axes.plot([int(row["iteration"]) for row in checked],
                  [float(row["validation_loss"]) for row in checked], ":", color=COLOURS[run])
    axes.set(xlabel="iteration", ylabel="mean square error of clean values",
             title="Loss at nano (dotted: validation members)")
    axes.legend(fontsize=7)


def main():
    results, output = pathlib.Path(sys.argv[1]), sys.argv[2]
    generation = json.loads((results / "generation.json").read_text())
    figure, axes = plot.subplots(1, 3, figsize=(15, 4.4), dpi=80)
    draw_entropy(axes[0], generation)
    draw_people(axes[1], generation["nano"])
    draw_losses(axes[2], results / "sampler_loss_nano.csv")
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(output, metadata={"Software": None})


if __name__ == "__main__":
    main()
