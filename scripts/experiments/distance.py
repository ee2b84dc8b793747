"""Writes docs/results/distance.json: what trained avatars look like from nearer and farther than
their training cameras, against their people photographed again at every size.

    scripts/run python3 scripts/experiments/distance.py [--plot PNG] [--folder DIR] NAME=RUN...

RUN is a folder of figurine-train avatar, NAME what its rows are called; from preset dev. DIR
(default out/distance) gets the whole reports and pictures, truth left. --plot draws error against
size; it needs scripts/setup plots. A minute or two a run; figurine-train evaluate distance does the
measuring (docs/json.md), and FIGURINE_MAKEHUMAN must say where MakeHuman's data is.
"""

import argparse
import pathlib
import subprocess

import results

TOOL = "build/dev/toolchain/cli/figurine-train"
FRAMINGS = ("body", "bust")
FIGURES = ("psnr_db", "highpass_ratio", "highpass_correlation")
TITLES = {
    "psnr_db": "PSNR, dB (dotted: the 1x picture resized)",
    "highpass_ratio": "high-pass energy over the truth's",
    "highpass_correlation": "its correlation with the truth's",
}


def measure(folder, name, run):
    report = folder / f"{name}.json"
    command = [TOOL, "evaluate", "distance", "--run", run, "-o", report]
    command += ["--pictures", folder / name]
    subprocess.run(command, check=True)
    return results.read(report)


def row_of(report):
    settings = report["settings"]
    return {
        "smallest_extent": settings.get("smallest_extent", False),
        "antialiased": settings.get("antialiased", False),
        "iterations": report.get("iterations"),
        "train_seconds": report.get("train_seconds"),
        "scales": report["scales"],
        "lattice": report["lattice"],
        "holes": report["holes"],
        "parts": report["parts"],
    }


def draw(rows, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plot

    figure, table = plot.subplots(len(FRAMINGS), len(FIGURES), figsize=(15, 8), squeeze=False)
    for axes_row, framing in zip(table, FRAMINGS):
        for axes, figure_name in zip(axes_row, FIGURES):
            for number, (name, row) in enumerate(rows.items()):
                seen = [scale for scale in row["scales"] if scale[framing] is not None]
                sizes = [scale["scale"] for scale in seen]
                colour = f"C{number}"
                axes.semilogx(sizes, [scale[framing][figure_name] for scale in seen], "o-",
                              base=2, color=colour, label=name)
                if figure_name == "psnr_db":
                    resized = [scale[framing]["resampled_psnr_db"] for scale in seen]
                    axes.semilogx(sizes, resized, ":", base=2, color=colour)
            axes.set(xlabel="side of the picture over the training pictures'",
                     title=f"{framing}: {TITLES[figure_name]}")
            axes.axvline(1, color="grey", linewidth=0.5)
    table[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", metavar="NAME=RUN")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/distance"))
    parser.add_argument("--plot", type=pathlib.Path)
    parser.add_argument("--output", type=pathlib.Path,
                        default=pathlib.Path("docs/results/distance.json"))
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    reports = {}
    for named in arguments.runs:
        name, equals, run = named.partition("=")
        if not equals:
            parser.error(f"{named}: is not NAME=RUN")
        reports[name] = measure(arguments.folder, name, run)
    rows = {name: row_of(report) for name, report in reports.items()}
    one = next(iter(reports.values()))
    result = {**results.head("scripts/run python3 scripts/experiments/distance.py NAME=RUN..."),
              "machine": one["machine"], "definition": one["definition"], "rows": rows}
    results.write(arguments.output, result)
    if arguments.plot:
        draw(rows, arguments.plot)


if __name__ == "__main__":
    main()
