"""Puts the runs of scripts/experiments/sharp.sh together: FOLDER/runs/*/evaluation.json, the
packages and what they cost -> docs/results/stage1.json.

    sharp_report.py FOLDER OUTPUT FIGURINE COMMAND

FIGURINE is a build of `figurine`: it draws both packages by turns, for their milliseconds. Every
figure names the run it comes from. Rows that FOLDER has no run for stay as OUTPUT has them; figures
that need a run that is not there are null.
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile

import results
from results import read

FIGURES = (
    "psnr_db",
    "head_psnr_db",
    "hand_psnr_db",
    "highpass_ratio",
    "highpass_correlation",
    "filled_share",
    "bust_psnr_db",
    "bust_head_psnr_db",
    "bust_highpass_ratio",
    "bust_highpass_correlation",
    "bust_filled_share",
)
FROM_REPORT = (
    "iterations",
    "train_seconds",
    "iterations_per_second",
    "parts",
    "rectified_channels",
    "idle_channels",
)
RUNS = 5  # of figurine bench a package, by turns


def row(name, run):
    report = read(run / "evaluation.json")
    description = read(run / "run.json") or {}
    if report is None or description.get("status") != "finished":
        return None
    result = {"name": name, "options": options_of(description["command"])}
    result |= {key: report.get(key) for key in FROM_REPORT}
    for group in ("held_out_views", "held_out_poses"):
        result[group] = {key: report[group].get(key) for key in FIGURES}
    return result | {"commit": description.get("commit"), "machine": report["machine"]["cpu"]}


# What the command said beside the paths.
def options_of(command):
    words, said = command.split(), []
    for word, value in zip(words, words[1:] + [""]):
        if word.startswith("--") and word not in ("--data", "--body", "--quiet", "--resume"):
            said.append(word if value.startswith("-") else f"{word} {value}")
    return " ".join(said)


def frame_ms(figurine, packages):
    """Medians of a frame and of its network in int8 on one thread: of RUNS runs of `figurine bench`
    for every (package, body), by turns."""
    times = {package: {"total": [], "network": []} for package, _ in packages}
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "bench.json"
        for _ in range(RUNS):
            for package, body in packages:
                command = [figurine, "bench", package, "--body", body, "--threads", "1"]
                command += ["--size", "512x512", "--json", report]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
                (run,) = [run for run in read(report)["runs"] if run["precision"] == "q8"]
                for stage, values in times[package].items():
                    values.append(run["stages_ms"][stage]["median"])
    return [
        {stage: statistics.median(values) for stage, values in times[package].items()}
        for package, _ in packages
    ]


def figures(rows, name):
    """The main figures of a run by its name; null where there is none."""
    entry = rows.get(name) or {}
    views, poses = entry.get("held_out_views") or {}, entry.get("held_out_poses") or {}
    return {
        "psnr_view_db": views.get("psnr_db"),
        "psnr_pose_db": poses.get("psnr_db"),
        **{key: poses.get(key) for key in FIGURES[1:]},
        "train_seconds": entry.get("train_seconds"),
        "train_iterations_per_second": entry.get("iterations_per_second"),
    }


def frozen_pose_loss_db(rows):
    posed, frozen = rows.get("chosen"), rows.get("frozen_pose")
    if not posed or not frozen:
        return None
    return posed["held_out_poses"]["psnr_db"] - frozen["held_out_poses"]["psnr_db"]


def print_rows(rows):
    for name, entry in rows.items():
        views, poses = entry["held_out_views"], entry["held_out_poses"]
        print(
            f"{name:26} views {views['psnr_db']:6.2f}  poses {poses['psnr_db']:6.2f}"
            f"  head {poses['head_psnr_db']:6.2f}  high-pass {poses['highpass_ratio']:.2f}"
            f" ({poses['highpass_correlation']:.2f})  bust head {poses['bust_head_psnr_db']:6.2f}"
            f"  {poses['bust_highpass_ratio']:.2f}  {entry['iterations_per_second']:5.2f} it/s"
        )


def main(folder, output, figurine, command):
    folder, output = pathlib.Path(folder), pathlib.Path(output)
    earlier = read(output) or {}
    runs = sorted(file.parent for file in (folder / "runs").glob("*/evaluation.json"))
    if not runs:
        sys.exit(f"sharp_report: {folder}: no evaluated run")
    rows = {entry["name"]: entry for entry in earlier.get("rows", [])}
    fresh = {run.name: row(run.name, run) for run in runs}
    rows = dict(sorted((rows | {name: entry for name, entry in fresh.items() if entry}).items()))
    result = figures(rows, "shipped")
    result["frozen_pose_loss_db"] = frozen_pose_loss_db(rows)
    keys = ("network_ms_before", "network_ms", "frame_ms_before", "frame_ms")
    measured = {key: earlier.get(key) for key in keys}
    packages = [
        (folder / "before.fgn", folder / "body_mesh_layout.fgn"),
        (folder / "shipped.fgn", folder / "body.fgn"),
    ]
    if all(package.exists() for package, _ in packages):
        old, new = frame_ms(figurine, packages)
        measured = dict(zip(keys, (old["network"], new["network"], old["total"], new["total"])))
    result |= measured
    q8 = folder / "shipped_q8.fgn"
    result["package_bytes"] = q8.stat().st_size if q8.exists() else earlier.get("package_bytes")
    parity = read(folder / "parity_q8.json") or earlier
    result["parity_q8_db"] = parity.get("parity_db", parity.get("parity_q8_db"))
    for name in ("before", "stripes", "stripes_before", "stripes_fine"):
        result[name] = figures(rows, name)
    result["rows"] = list(rows.values())
    results.write(output, results.head(command) | result)
    print_rows(rows)


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
