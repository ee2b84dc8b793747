"""Writes docs/results/atlas.json: where texels go in the mesh's layout and in weighted ones, and
what gaps between charts cost.

    scripts/run python3 scripts/experiments/atlas.py [FOLDER]

FOLDER (default out/atlas) gets bodies, reports and pictures; from preset dev. A few minutes. Rows:
figurine-train body --makehuman, its report (docs/json.md) without what says who and when.
"""

import pathlib
import subprocess
import sys

import results

TOOL = "build/dev/toolchain/cli/figurine-train"
SIZES = [128, 256]
# Name: weights; None: the mesh's own layout.
LAYOUTS = {
    "source": None,
    "even": {},
    "hands4": {"hands": 4},
    "hands4_head2": {"hands": 4, "head": 2},
    "hands4_head4": {"hands": 4, "head": 4},
    "hands4_head5.5": {"hands": 4, "head": 5.5},
    "hands5.5_head5.5": {"hands": 5.5, "head": 5.5},
}
WHO_AND_WHEN = ("command", "commit", "machine", "date", "package")


def lay_out(folder, name, uv_size, *options):
    report = folder / f"{name}_{uv_size}.json"
    command = [TOOL, "body", "--makehuman", "--uv", str(uv_size), *options]
    command += ["--report", report, "--sheet", report.with_suffix(".png")]
    command += ["-o", report.with_suffix(".fgn")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return results.read(report)


def weighted(weights):
    options = ["--atlas", "weighted"]
    for part, weight in weights.items():
        options += ["--weight", f"{part}={weight}"]
    return options


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/atlas")
    folder.mkdir(parents=True, exist_ok=True)
    rows = {}
    for uv_size in SIZES:
        for name, weights in LAYOUTS.items():
            options = [] if weights is None else weighted(weights)
            rows[f"{name}_{uv_size}"] = lay_out(folder, name, uv_size, *options)
        # Two cells of T/4 between charts.
        options = [*weighted(LAYOUTS["hands4_head2"]), "--coarsest-grid", str(uv_size // 4)]
        name = "hands4_head2_quarter"
        rows[f"{name}_{uv_size}"] = lay_out(folder, name, uv_size, *options)
    machine = next(iter(rows.values()))["machine"]
    for row in rows.values():
        for key in WHO_AND_WHEN:
            row.pop(key)
    result = {**results.head("scripts/run python3 scripts/experiments/atlas.py"),
              "machine": machine, "rows": rows}
    results.write(pathlib.Path("docs/results/atlas.json"), result)


if __name__ == "__main__":
    main()
