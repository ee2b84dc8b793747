"""Puts the runs of scripts/experiments/structures.sh together: FOLDER/runs/WAY/PERSON ->
docs/results/structures.json, and prints a table.

    structures_report.py FOLDER OUTPUT COMMAND

Figures are means over the people whom every way has finished; "below_free_db" is how far a way is
below `free`, person by person, with the standard error of that difference.
"""

import math
import pathlib
import statistics
import sys

import results
from results import read

FIGURES = ("psnr_db", "head_psnr_db", "highpass_ratio", "highpass_correlation",
           "bust_head_psnr_db", "bust_highpass_ratio")
GROUPS = ("held_out_views", "held_out_poses")


def runs_of(folder):
    """{way: {person: (evaluation, run.json)}} of what is finished, in the order it was begun."""
    ways = {}
    for run in sorted(folder.glob("runs/*/*/run.json"), key=lambda path: path.stat().st_ctime):
        description, report = read(run), read(run.parent / "evaluation.json")
        if description.get("status") == "finished" and report is not None:
            ways.setdefault(run.parent.parent.name, {})[run.parent.name] = (report, description)
    return ways


def own_values(description):
    """How many values are this person's own: of the network, of its map."""
    settings, parts = description["settings"], description["parts"]
    network = parts["network"]
    adapter = network.get("adapter")
    if adapter:
        own = adapter["values"]
    else:
        own = 0 if settings.get("freeze_network") else network["parameters"]
    return {"network": own, "map": parts["static"]["values"]}


def row(name, runs, free, people):
    result = {"name": name, "own_values": own_values(next(iter(runs.values()))[1])}
    for group in GROUPS:
        result[group] = {
            key: statistics.fmean(runs[person][0][group][key] for person in people)
            for key in FIGURES
        }
        if free:
            below = [free[person][0][group]["psnr_db"] - runs[person][0][group]["psnr_db"]
                     for person in people]
            spread = statistics.stdev(below) / math.sqrt(len(below)) if len(below) > 1 else None
            result[group] |= {"below_free_db": statistics.fmean(below), "standard_error_db": spread}
    result["train_seconds"] = statistics.median(
        runs[person][1]["train_seconds"] for person in people)
    return result


def main():
    folder, output, command = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]
    ways = runs_of(folder)
    if not ways:
        sys.exit(f"structures_report.py: {folder}: no finished run")
    people = sorted(set.intersection(*(set(runs) for runs in ways.values())))
    if not people:
        sys.exit(f"structures_report.py: {folder}: nobody is trained in every way")
    rows = [row(name, runs, ways.get("free"), people) for name, runs in ways.items()]
    for entry in rows:
        poses = entry["held_out_poses"]
        print(f"{entry['name']:12} {entry['own_values']['network']:7} of the network; poses "
              f"{poses['psnr_db']:.2f} dB, head {poses['head_psnr_db']:.2f}, high-pass "
              f"{poses['highpass_ratio']:.2f}; {poses.get('below_free_db', 0):+.2f} dB below free; "
              f"{entry['train_seconds']:.0f} s")
    first = next(iter(ways.values()))[people[0]][0]
    results.write(output, results.head(command) | {
        "machine": first["machine"],
        "iterations": next(iter(ways.values()))[people[0]][1]["iterations"],
        "people": people,
        "learners": len((read(folder / "shared" / "run.json") or {}).get("people", [])),
        "rows": rows,
    })


if __name__ == "__main__":
    main()
