"""Puts the runs of scripts/experiments/structures.sh together: FOLDER/runs/WAY/people_PERSON ->
the part of docs/results/structures.json that FOLDER's name says, and prints a table.

    structures_report.py FOLDER OUTPUT COMMAND

Figures are means over the people whom every way has finished; "below_free_db" is how far a way is
below `free`, person by person, with the standard error of that difference. Where a way was made a
population too (FOLDER/WAY.fgn, WAY.json, generation_WAY.json) its bytes, what its learners span of
the new people and what a sampler makes of it stand beside.
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
    for run in sorted(folder.glob("runs/*/people_*/run.json"),
                      key=lambda path: path.stat().st_ctime):
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


def population(folder, name):
    """What the way is as a population; nothing where it was not made one."""
    package, members = folder / f"{name}.fgn", read(folder / f"{name}.json")
    if not package.exists() or members is None:
        return {}
    result = {
        "bytes": package.stat().st_size,
        "span_db": {"largest_rank": members["span"]["per_layer"][-1]["span_db"],
                    "by_rank": members["span_db"]},
        "variance_kept": members["span"]["per_layer"][-1]["variance_kept"],
        "baselines_db": {key: row["span_db"]
                         for key, row in members["span"]["baselines"].items()},
        "middle_highpass_ratio": statistics.fmean(
            pair["middle_highpass_ratio"] for pair in members["interpolation"]["pairs"]),
    }
    generation = read(folder / f"generation_{name}.json")
    if generation is not None:
        sampled = generation["rows"][0]
        result["sampler"] = {
            "copy_share": sampled["novelty"]["pictures"]["copy_share"],
            "coverage_percent": sampled["held_out"]["coverage_percent"]["value"],
            "one_nna_percent": sampled["held_out"]["one_nna_percent"]["value"],
            "mmd_psnr_db": sampled["held_out"]["mmd_psnr_db"]["value"],
            "highpass_ratio": sampled["highpass_ratio"],
            "iterations": generation["runs"][0]["iterations"],
        }
    return {"population": result}


def row(name, runs, free, people):
    result = {"name": name, "own_values": own_values(next(iter(runs.values()))[1])}
    for group in GROUPS:
        result[group] = {
            key: statistics.fmean(runs[person][0][group][key] for person in people)
            for key in FIGURES
            if all(runs[person][0][group].get(key) is not None for person in people)
        }
        if free:
            below = [free[person][0][group]["psnr_db"] - runs[person][0][group]["psnr_db"]
                     for person in people]
            spread = statistics.stdev(below) / math.sqrt(len(below)) if len(below) > 1 else None
            result[group] |= {"below_free_db": statistics.fmean(below), "standard_error_db": spread}
    result["train_seconds"] = statistics.median(
        runs[person][1]["train_seconds"] for person in people)
    return result


def say(entry):
    poses = entry["held_out_poses"]
    print(f"{entry['name']:12} {entry['own_values']['network']:7} of the network; poses "
          f"{poses['psnr_db']:.2f} dB, head {poses['head_psnr_db']:.2f}, high-pass "
          f"{poses['highpass_ratio']:.2f}; {poses.get('below_free_db', 0):+.2f} dB below free; "
          f"{entry['train_seconds']:.0f} s")
    if made := entry.get("population"):
        print(f"{'':12} {made['bytes']} bytes, span {made['span_db']['largest_rank']:.1f} dB; "
              f"{made.get('sampler')}")


def main():
    folder, output, command = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]
    ways = runs_of(folder)
    if not ways:
        sys.exit(f"structures_report.py: {folder}: no finished run")
    people = sorted(set.intersection(*(set(runs) for runs in ways.values())))
    if not people:
        sys.exit(f"structures_report.py: {folder}: nobody is trained in every way")
    rows = [row(name, runs, ways.get("free"), people) | population(folder, name)
            for name, runs in ways.items()]
    for entry in rows:
        say(entry)
    first = next(iter(ways.values()))[people[0]][0]
    results.write(output, (read(output) or {}) | {folder.name: results.head(command) | {
        "machine": first["machine"],
        "iterations": next(iter(ways.values()))[people[0]][1]["iterations"],
        "people": len(people),
        "learners": len((read(folder / "shared" / "run.json") or {}).get("people", [])),
        "rows": rows,
    }})


if __name__ == "__main__":
    main()
