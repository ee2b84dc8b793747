"""Writes docs/results/unusual_poses.json: how unusual poses are to a trained avatar, what they
cost, and what keeping its network to the poses that it knows is worth.

    scripts/run python3 scripts/experiments/unusual_poses.py [--plot PNG] [--folder DIR] NAME=RUN...

RUN is a folder of figurine-train avatar whose capture is figurine's own, NAME what its rows are
called; from preset dev. DIR (default out/unusual_poses) gets the whole reports and a picture of
every set's most unusual pose. --motion CLIP (several) adds sets of poses. --plot draws error
against distance; it needs scripts/setup plots. FIGURINE_MAKEHUMAN must say where MakeHuman's data
is. figurine-train evaluate poses does the measuring (docs/json.md), a minute or two a run;
scripts/experiments/unusual_poses.sh makes the runs of the file in docs/results.
"""

import argparse
import pathlib
import subprocess

import results

TOOL = "build/dev/toolchain/cli/figurine-train"


def measure(folder, name, run, arguments):
    report = folder / f"{name}.json"
    command = [TOOL, "evaluate", "poses", "--run", run, "-o", report]
    command += ["--sheet", folder / f"{name}.png", "--poses", str(arguments.poses)]
    for motion in arguments.motion:
        command += ["--motion", motion]
    subprocess.run(command, check=True)
    return results.read(report)


def gain_of(row):
    return row["kept"]["psnr_db"] - row["as_it_is"]["psnr_db"]


def row_of(report):
    sets = []
    for entry in report["sets"]:
        poses = [pose for pose in report["poses"] if pose["set"] == entry["name"]]
        gains = [pose["kept_psnr_db"] - pose["as_it_is_psnr_db"] for pose in poses]
        sets.append({
            "name": entry["name"],
            "poses": entry["poses"],
            "distance": entry["distance"],
            "pulled": entry["pulled"],
            "beyond_all": entry["beyond_all"],
            "as_it_is": entry["as_it_is"],
            "kept": entry["kept"],
            "gain_db": gain_of(entry),
            "poses_that_gain": sum(gain > 0 for gain in gains),
            "gain_db_by_pose": results.quantiles(gains),
            "psnr_db_by_share": {str(share["share"]): share["psnr_db"]
                                 for share in entry["by_share"]},
        })
    return {
        "preset": report["settings"].get("preset"),
        "iterations": report.get("iterations"),
        "train_seconds": report.get("train_seconds"),
        "training_distances": report["training_distances"],
        "sets": sets,
    }


def draw(reports, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plot

    figure, table = plot.subplots(len(reports), 2, figsize=(13, 4.6 * len(reports)),
                                  squeeze=False)
    for (left, right), (name, report) in zip(table, reports.items()):
        known = report["training_distances"]
        for number, entry in enumerate(report["sets"]):
            poses = [pose for pose in report["poses"] if pose["set"] == entry["name"]]
            colour = f"C{number}"
            left.plot([pose["distance"] for pose in poses],
                      [pose["as_it_is_psnr_db"] for pose in poses], "o", markersize=3,
                      color=colour, label=entry["name"])
            right.plot([pose["distance"] for pose in poses],
                       [pose["kept_psnr_db"] - pose["as_it_is_psnr_db"] for pose in poses], "o",
                       markersize=3, color=colour)
        for axes in (left, right):
            axes.axvline(known["knee"], color="grey", linewidth=0.7)
            axes.axvline(known["max"], color="grey", linewidth=0.7, linestyle=":")
            axes.set(xscale="log", xlabel="distance (lines: 95 % of the training poses, all)")
        right.axhline(0, color="grey", linewidth=0.7)
        left.set(title=f"{name}: PSNR of a pose, dB, as it is")
        right.set(title="gained by keeping the network to known poses, dB")
    table[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", metavar="NAME=RUN")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/unusual_poses"))
    parser.add_argument("--motion", action="append", default=[])
    parser.add_argument("--poses", type=int, default=12)
    parser.add_argument("--plot", type=pathlib.Path)
    parser.add_argument("--command", default="scripts/experiments/unusual_poses.py")
    parser.add_argument("--output", type=pathlib.Path,
                        default=pathlib.Path("docs/results/unusual_poses.json"))
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    reports = {}
    for named in arguments.runs:
        name, equals, run = named.partition("=")
        if not equals:
            parser.error(f"{named}: is not NAME=RUN")
        reports[name] = measure(arguments.folder, name, run, arguments)
    document = results.head(arguments.command)
    first = next(iter(reports.values()))
    document["machine"] = first["machine"]
    document["definition"] = first["definition"]
    document["runs"] = {name: row_of(report) for name, report in reports.items()}
    results.write(arguments.output, document)
    if arguments.plot:
        draw(reports, arguments.plot)


if __name__ == "__main__":
    main()
