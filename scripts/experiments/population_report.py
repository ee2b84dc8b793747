"""Puts a population's figures together: FOLDER/members/*.json and FOLDER/report.json -> one object
of docs/results/population.json, and the spectra of its weights as population_spectrum_NAME.csv.

    population_report.py FOLDER NAME OUTPUT COMMAND

FOLDER is a state folder of `figurine-train population`; its report.json is by `figurine-train
evaluate members`. Nothing is computed here but means and sums. Also writes FOLDER/worst.txt: the
ten members with the lowest PSNR on held-out poses, worst first. Objects of other names in OUTPUT
stay.
"""

import itertools
import json
import pathlib
import statistics
import sys

import results

CORES = 2  # people are made side by side, one a core


# None where it was not measured: in captures without cameras of busts, by tools of before.
def metric(row, group, name):
    return row["quality"][group].get(name)


def describe(values, best=max):
    values = [v for v in values if v is not None]
    if not values:
        return None
    return {
        "mean": statistics.fmean(values),
        "worst": (min if best is max else max)(values),
        "best": best(values),
        "deviation": statistics.pstdev(values),
        "count": len(values),
    }


def above_flat_db(row):
    poses = row["quality"]["held_out_poses"]
    return poses["psnr_db"] - poses["flat_psnr_db"]


# Of held-out poses, and with `view_` before the name of held-out views.
FIGURES = [
    "highpass_ratio",
    "highpass_correlation",
    "bust_psnr_db",
    "bust_head_psnr_db",
    "bust_highpass_ratio",
    "bust_highpass_correlation",
]


def spread(rows):
    poses = lambda name: describe([metric(r, "held_out_poses", name) for r in rows])
    views = lambda name: describe([metric(r, "held_out_views", name) for r in rows])
    return {
        "psnr_view_db": views("psnr_db"),
        "psnr_pose_db": poses("psnr_db"),
        "psnr_pose_interleaved_db": describe(
            [metric(r, "held_out_poses_interleaved", "psnr_db") for r in rows]
        ),
        "psnr_pose_block_db": describe(
            [metric(r, "held_out_poses_block", "psnr_db") for r in rows]
        ),
        "head_psnr_db": poses("head_psnr_db"),
        "flat_psnr_db": poses("flat_psnr_db"),
        "above_flat_db": describe([above_flat_db(r) for r in rows]),
        **{name: poses(name) for name in FIGURES},
        **{"view_" + name: views(name) for name in FIGURES},
        "difference_psnr_db": describe([r["quality"]["difference_psnr_db"] for r in rows]),
    }


# Figures whose means stand first in the file.
MEANS = [
    "psnr_view_db",
    "psnr_pose_db",
    "head_psnr_db",
    "flat_psnr_db",
    "above_flat_db",
    "highpass_ratio",
    "highpass_correlation",
    "bust_head_psnr_db",
]


# The mean of a figure of all members; None where nobody has it.
def mean_of(everybody, name):
    return everybody[name]["mean"] if everybody[name] else None


def frozen_gain(rows):
    posed = lambda quality: quality["held_out_poses"]["psnr_db"]
    return describe(
        [posed(r["quality"]) - posed(r["frozen_pose"]) for r in rows if "frozen_pose" in r]
    )


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

    def gain(group):
        scratch = [r["from_scratch"]["quality"][group]["psnr_db"] for r in pairs]
        return describe([metric(r, group, "psnr_db") - s for r, s in zip(pairs, scratch)])

    return {
        "gain_views_db": gain("held_out_views"),
        "gain_poses_db": gain("held_out_poses"),
        "curve": curve,
    }


def rounding(rows):
    losses = {
        f"{r['identity']} {group}": r["rounding"][group]["loss_db"]
        for r in rows
        if "rounding" in r
        for group in ("views", "poses")
    }
    return {"losses_db": losses, "worst_db": max(losses.values(), default=None)}


def shortened_spectrum(spectrum):
    """Takes the share of variance of every direction out of the spectrum and leaves what the first
    1, 2, 4, ... hold together; returns the shares, a row a direction. Of a map's patches, of which
    there are dozens, quantiles stay."""
    patches = [token for token in spectrum["tokens"] if token["name"].startswith("static.")]
    tokens = [token for token in spectrum["tokens"] if token not in patches]
    columns = {token["name"]: token for token in tokens}
    columns |= spectrum.get("by_kind", {}) | {"whole": spectrum["whole"]}
    shares = {name: part.pop("variance_share") for name, part in columns.items()}
    for name, part in columns.items():
        held = list(itertools.accumulate(shares[name]))
        ranks = [2**k for k in range(len(held).bit_length())]
        part["variance_of_first"] = {str(rank): held[rank - 1] for rank in ranks}
    if patches:
        spectrum["tokens"] = tokens
        spectrum["patches"] = {
            "count": len(patches),
            "entries": results.quantiles([patch["entries"] for patch in patches]),
            "directions_for_90": results.quantiles(
                [patch["directions_for"]["90"] for patch in patches]
            ),
            "participation_ratio": results.quantiles(
                [patch["participation_ratio"] for patch in patches]
            ),
        }
    directions = range(max(map(len, shares.values()), default=0))
    cell = lambda values, k: f"{values[k]:.3g}" if k < len(values) else None
    return [
        {"direction": k + 1} | {name: cell(values, k) for name, values in shares.items()}
        for k in directions
    ]


def main():
    folder, name, output = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
    rows = [json.loads(p.read_text()) for p in sorted((folder / "members").glob("*.json"))]
    if not rows:
        sys.exit(f"population_report.py: {folder}: has no members yet")
    report = results.read(folder / "report.json") or {}
    # Everybody's own neighbours stay in the folder: hundreds of rows.
    report.get("distances", {}).pop("members", None)
    if "spectrum" in report:
        directions = shortened_spectrum(report["spectrum"])
        results.write_rows(output.with_name(f"population_spectrum_{name}.csv"), directions)
    names = ("train", "validation", "test")
    parts = {part: [r for r in rows if r["split"] == part] for part in names}
    everybody = spread(rows)
    gain = frozen_gain(rows)
    worst = sorted(rows, key=lambda r: metric(r, "held_out_poses", "psnr_db"))[:10]
    (folder / "worst.txt").write_text("".join(r["identity"] + "\n" for r in worst))
    package = folder / "population.fgn"
    result = {
        "identities": len(parts["train"]),
        "held_out": len(parts["validation"]) + len(parts["test"]),
        **{f"{name}_mean": mean_of(everybody, name) for name in MEANS},
        "gain_over_frozen_pose_db": gain["mean"] if gain else None,
        "seconds_per_avatar": statistics.fmean(r["train_seconds"] for r in rows) / CORES,
        "bytes": package.stat().st_size if package.exists() else None,
        "span_db": report.get("span_db"),
        "seconds": {
            "training_one_core": describe([r["train_seconds"] for r in rows], best=min),
            "capture_cpu": describe([r["capture_cpu_seconds"] for r in rows], best=min),
            "note": "seconds_per_avatar: two people are trained side by side, each on one core, "
            "so one costs two cores half its time",
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
        "machine": report.get("machine"),
    } | results.head(sys.argv[4])
    content = results.read(output) or {}
    content[name] = result
    results.write(output, content)
    print(
        f"{name}: {len(rows)} members, held-out poses {result['psnr_pose_db_mean']:.2f} dB, "
        f"{everybody['above_flat_db']['mean']:.2f} above flat, "
        f"views {result['psnr_view_db_mean']:.2f} dB"
    )


if __name__ == "__main__":
    main()
