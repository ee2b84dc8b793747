"""Puts the rows of scripts/experiments/line.sh together: FOLDER/runs/*/evaluation.json and
FOLDER/parity.json -> docs/results/line.json.

    line_report.py FOLDER OUTPUT COMMAND

Nothing is computed here but differences; every figure names the run it comes from. Rows that FOLDER
has no run for stay as OUTPUT has them: a row names its own command, commit and machine, so rows of
several days can stand side by side. Rows that were never trained are absent, figures that need them
null.
"""

import datetime
import json
import os
import pathlib
import sys

GROUPS = ("held_out_views", "held_out_poses", "held_out_poses_interleaved", "held_out_poses_block",
          "held_out_views_and_poses")


def read(path):
    return json.loads(path.read_text()) if path.exists() else None


def row(name, run):
    report = read(run / "evaluation.json")
    if report is None:
        return None
    result = {"name": name}
    for key in ("command", "commit"):
        result[key] = read(run / "run.json").get(key)
    result["person_seed"] = read(run / "run.json")["data"]["seed"]
    for key in ("settings", "iterations", "train_seconds", "iterations_per_second", "breakdown_ms",
                "difference_psnr_db"):
        result[key] = report.get(key)
    result["machine"] = report["machine"]
    for group in GROUPS:
        result[group] = report[group]
    return result


# Rows of an earlier report; those from before rows named their machine were made on the report's.
def earlier_rows(report):
    return {
        row["name"]: {"machine": report["machine"], **row} for row in (report or {}).get("rows", [])
    }


def figure(rows, name, *path):
    value = rows.get(name)
    for key in path:
        value = None if value is None else value.get(key)
    return value


def main(folder, output, command):
    folder = pathlib.Path(folder)
    new_rows = {
        run.name: row(run.name, run) for run in sorted((folder / "runs").iterdir())
        if (run / "evaluation.json").exists()
    }
    if not new_rows:
        sys.exit(f"line_report: {folder}: no evaluated run")
    earlier = read(pathlib.Path(output)) or {}
    rows = dict(sorted({**earlier_rows(earlier), **new_rows}.items()))
    main_row = "shipped"
    parity = read(folder / "parity.json") or earlier
    oracle = read(pathlib.Path("docs/results/splat_oracle.json")) or {}
    # Same trainer, same number of iterations, one pose in each.
    posed = figure(rows, "one_pose", "held_out_poses", "psnr_db")
    frozen = figure(rows, "one_pose_frozen", "held_out_poses", "psnr_db")
    speed_run = read(folder / "runs" / "speed" / "run.json")
    speed = earlier
    if speed_run:
        rate = speed_run.get("iterations_per_second")
        speed = {"train_iterations_per_second": rate, **speed_run}
    result = {
        "psnr_view_db": figure(rows, main_row, "held_out_views", "psnr_db"),
        "psnr_pose_db": figure(rows, main_row, "held_out_poses", "psnr_db"),
        "flat_psnr_db": figure(rows, main_row, "held_out_poses", "flat_psnr_db"),
        "flat_psnr_view_db": figure(rows, main_row, "held_out_views", "flat_psnr_db"),
        "head_psnr_db": figure(rows, main_row, "held_out_poses", "head_psnr_db"),
        "highpass_ratio": figure(rows, main_row, "held_out_poses", "highpass_ratio"),
        "difference_psnr_db": figure(rows, main_row, "difference_psnr_db"),
        "frozen_pose_loss_db": None if posed is None or frozen is None else posed - frozen,
        "parity_db": parity.get("parity_db"),
        "worst_parity_db": parity.get("worst_parity_db"),
        "splat_oracle_db": oracle.get("splat_oracle_db"),
        # One view an iteration on all cores of a quiet machine; the rows' own rates depend on what
        # ran beside them.
        "train_iterations_per_second": speed.get("train_iterations_per_second"),
        "breakdown_ms": speed.get("breakdown_ms"),
        "train_seconds": figure(rows, main_row, "train_seconds"),
        "rows": list(rows.values()),
        "command": command,
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "machine": figure(rows, main_row, "machine"),  # of the main figures
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    temporary = pathlib.Path(output + ".tmp")
    temporary.write_text(json.dumps(result, indent=2) + "\n")
    temporary.replace(output)
    for name, entry in rows.items():
        views, poses = entry["held_out_views"], entry["held_out_poses"]
        print(
            f"{name:28} views {views['psnr_db']:6.2f}  poses {poses['psnr_db']:6.2f}"
            f"  head {poses['head_psnr_db']:6.2f}  flat {poses['flat_psnr_db']:6.2f} dB"
            f"  {entry['iterations_per_second']:5.1f} it/s")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
