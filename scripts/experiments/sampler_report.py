"""Puts a sampler's figures together: FOLDER/{generation,sampling,timed}.json, golden.txt and the
runs' losses -> docs/results/generation.json, sampling.json and sampler_loss_NAME.csv.

    sampler_report.py FOLDER NAME OUTPUT COMMAND

FOLDER is that of scripts/experiments/sampler.sh. Nothing is computed here. Objects of other names
in generation.json stay.
"""

import datetime
import json
import os
import pathlib
import re
import sys

from variants_report import merged_losses


def read(path):
    return json.loads(path.read_text()) if path.exists() else None


def write(path, value):
    fresh = path.with_suffix(".json.tmp")
    fresh.write_text(json.dumps(value, indent=2, sort_keys=True) + "\n")
    os.replace(fresh, path)


def without_paths(report):
    """Folders mean nothing elsewhere."""
    return {key: value for key, value in report.items() if key not in ("command",)}


def same_on_all_cpus(golden, name):
    """What scripts/check_golden printed of the sampler, one line a CPU."""
    pattern = rf"^check_golden: (\S+): .*sampler {re.escape(name)}, (\d+) seeds, first (\w+)"
    found = re.findall(pattern, golden, re.MULTILINE)
    cpus = [cpu if cpu == "host" else f"{cpu} (QEMU)" for cpu, _, _ in found]
    hashes = {weights for _, _, weights in found}
    return {
        "cpus": cpus, "seeds": int(found[0][1]), "weights_of_seed_0": sorted(hashes),
        "same": len(hashes) == 1 and len(found) == golden.count("\n")
    }


def keep_entropy(before, now):
    """A package that says nothing of its posterior entropy has the one found when it was trained:
    it depends on settings and population alone."""
    if before.get("population_hash") != now["population_hash"]:
        return
    known = {run["name"]: run for run in before["runs"]}
    for run in now["runs"]:
        old = known.get(run["name"], {})
        missing = "posterior_entropy" not in run and "posterior_entropy" in old
        if missing and old["settings"] == run["settings"]:
            run["posterior_entropy"] = old["posterior_entropy"]


def main():
    folder, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
    name, command = sys.argv[2], sys.argv[4]
    head = {
        "command": command,
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    generation = read(output / "generation.json") or {}
    before = generation.get(name, {})
    generation[name] = head | without_paths(read(folder / "generation.json"))
    keep_entropy(before, generation[name])
    write(output / "generation.json", generation)
    losses_path = output / f"sampler_loss_{name}.csv"
    runs = [run for run in ("basis", "layer") if (folder / run).exists()]
    losses_path.write_text(merged_losses(losses_path, folder, runs))

    golden = folder / "golden.txt"
    same = {}
    if golden.exists():
        same = {"same_on_all_cpus": same_on_all_cpus(golden.read_text(), name)}
    measured, timed = read(folder / "sampling.json"), read(folder / "timed.json")
    if measured is None:  # the package that ships: its figures stay those of when it was made
        write(output / "sampling.json", read(output / "sampling.json") | same)
        return
    orders = measured["order"]
    write(
        output / "sampling.json",
        head
        | without_paths(measured)
        | same
        | {
            "seconds": timed["seconds"]["sample"],
            "peak_mb": timed["peak_memory_bytes"] / 1e6,
            "evaluations": timed["evaluations"],
            "macs_per_evaluation": timed["macs_per_evaluation"],
            "package_hash": measured["sampler_hash"],
            "order_ddim": orders["network, float32"]["ddim"],
            "order_dpmpp2m": orders["network, float32"]["dpmpp2m"],
        },
    )


if __name__ == "__main__":
    main()
