"""Puts a population's figures together: FOLDER/members/*.json and FOLDER/report.json -> one object of docs/results/population.json.

    population_report.py FOLDER NAME OUTPUT COMMAND

FOLDER is a state folder of `figurine-train population`; its report.json is by `figurine-train evaluate members`. Nothing is computed here but means. Also
writes FOLDER/worst.txt: the ten members with the lowest PSNR on held-out poses, worst first. Objects of other names in OUTPUT stay.
"""

import datetime
import json
import os
import pathlib
import statistics
import sys

CORES = 2  # people are made side by side, one a core


def read(path):
    return json.loads(path.read_text()) if path.exists() else None


def metric(row, group, name):
    return row["quality"][group][name]


def describe(values, worst=min, best=max):
    values = [v for v in values if v is not None]
    if not values:
        return None
    return {
        "mean": statistics.fmean(values),
        "worst": worst(values),
        "best": best(values),
        "deviation": statistics.pstdev(values),
        "count": len(values),
    }


def describe_seconds(values):
    return describe(values, worst=max, best=min)


def spread(rows):
    return {
        "psnr_view_db": describe([metric(r, "held_out_views", "psnr_db") for r in rows]),
        "psnr_pose_db": describe([metric(r, "held_out_poses", "psnr_db") for r in rows]),
        "psnr_pose_interleaved_db": describe([metric(r, "held_out_poses_interleaved", "psnr_db") for r in rows]),
        "psnr_pose_block_db": describe([metric(r, "held_out_poses_block", "psnr_db") for r in rows]),
        "head_psnr_db": describe([metric(r, "held_out_poses", "head_psnr_db") for r in rows]),
        "flat_psnr_db": describe([metric(r, "held_out_poses", "flat_psnr_db") for r in rows]),
        "above_flat_db": describe([metric(r, "held_out_poses", "psnr_db") - metric(r, "held_out_poses", "flat_psnr_db") for r in rows]),
        "highpass_ratio": describe([metric(r, "held_out_poses", "highpass_ratio") for r in rows]),
        "difference_psnr_db": describe([r["quality"]["difference_psnr_db"] for r in rows]),
    }


def frozen_gain(rows):
    gains = [
        metric(r, "held_out_poses", "psnr_db") - r["frozen_pose"]["held_out_poses"]["psnr_db"] for r in rows if "frozen_pose" in r
    ]
    return describe(gains)


# What the shared initial weights are worth: the same people, the same budget, from random weights.
def initial_weights(rows):
    pairs = [r for r in rows if "from_scratch" in r]
    if not pairs:
        return None
    curve = []
    for k, (iteration, seconds, _) in enumerate(pairs[0]["log"]):
        here = [(r["log"][k], r["from_scratch"]["log"][k]) for r in pairs]
        curve.append(
            {
                "iteration": iteration,
                "seconds": statistics.fmean(a[1] for a, _ in here),
                "training_psnr_db": statistics.fmean(a[2] for a, _ in here),
                "from_scratch_db": statistics.fmean(b[2] for _, b in here),
            }
        )
    gain = lambda group: describe([metric(r, group, "psnr_db") - r["from_scratch"]["quality"][group]["psnr_db"] for r in pairs])
    return {"gain_views_db": gain("held_out_views"), "gain_poses_db": gain("held_out_poses"), "curve": curve}


def rounding(rows):
    losses = {f"{r['identity']} {g}": r["rounding"][g]["loss_db"] for r in rows if "rounding" in r for g in ("views", "poses")}
    return {"losses_db": losses, "worst_db": max(losses.values(), default=None)}


def main():
    folder, name, output, command = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3]), sys.argv[4]
    rows = [json.loads(p.read_text()) for p in sorted((folder / "members").glob("*.json"))]
    if not rows:
        sys.exit(f"population_report.py: {folder}: has no members yet")
    report = read(folder / "report.json") or {}
    report.get("distances", {}).pop("members", None)  # everybody's own neighbours stay in the folder: hundreds of rows
    parts = {part: [r for r in rows if r["split"] == part] for part in ("train", "validation", "test")}
    everybody = spread(rows)
    gain = frozen_gain(rows)
    worst = sorted(rows, key=lambda r: metric(r, "held_out_poses", "psnr_db"))[:10]
    (folder / "worst.txt").write_text("".join(r["identity"] + "\n" for r in worst))
    package = folder / "population.fgn"
    result = {
        "identities": len(parts["train"]),
        "held_out": len(parts["validation"]) + len(parts["test"]),
        "psnr_view_db_mean": everybody["psnr_view_db"]["mean"],
        "psnr_pose_db_mean": everybody["psnr_pose_db"]["mean"],
        "head_psnr_db_mean": everybody["head_psnr_db"]["mean"],
        "flat_psnr_db_mean": everybody["flat_psnr_db"]["mean"],
        "gain_over_frozen_pose_db": gain["mean"] if gain else None,
        "seconds_per_avatar": statistics.fmean(r["train_seconds"] for r in rows) / CORES,
        "bytes": package.stat().st_size if package.exists() else None,
        "span_db": report.get("span_db"),
        "seconds": {
            "training_one_core": describe_seconds([r["train_seconds"] for r in rows]),
            "capture_cpu": describe_seconds([r["capture_cpu_seconds"] for r in rows]),
            "note": "seconds_per_avatar: two people are trained side by side, each on one core, so one costs two cores half its time",
        },
        "all": everybody,
        "by_split": {part: spread(of_part) for part, of_part in parts.items() if of_part},
        "gain_over_frozen_pose": gain,
        "initial_weights": initial_weights(rows),
        "rounding": rounding(rows),
        "worst_ten": [
            {
                "identity": r["identity"],
                "split": r["split"],
                "psnr_pose_db": metric(r, "held_out_poses", "psnr_db"),
                "flat_psnr_db": metric(r, "held_out_poses", "flat_psnr_db"),
                "garment": r["person"].get("garment"),
                "hair": r["person"].get("hair"),
            }
            for r in worst
        ],
        "members_report": report or None,
        "command": command,
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "machine": report.get("machine"),
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    content = read(output) or {}
    content[name] = result
    temporary = output.with_suffix(".json.tmp")
    temporary.write_text(json.dumps(content, indent=2) + "\n")
    temporary.replace(output)
    above = everybody["above_flat_db"]["mean"]
    print(f"{name}: {len(rows)} members, held-out poses {result['psnr_pose_db_mean']:.2f} dB, {above:.2f} above flat, views {result['psnr_view_db_mean']:.2f} dB")


if __name__ == "__main__":
    main()
