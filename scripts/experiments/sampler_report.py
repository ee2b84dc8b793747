"""Puts a sampler's figures together: FOLDER/{generation,sampling,timed}.json and the runs' losses -> docs/results/generation.json,
sampling.json and sampler_loss_NAME.csv.

    sampler_report.py FOLDER NAME OUTPUT COMMAND

FOLDER is that of scripts/experiments/sampler.sh. Nothing is computed here. Objects of other names in generation.json stay.
"""

import datetime
import json
import os
import pathlib
import sys

from variants_report import losses


def read(path):
    return json.loads(path.read_text()) if path.exists() else None


def write(path, value):
    fresh = path.with_suffix(".json.tmp")
    fresh.write_text(json.dumps(value, indent=2, sort_keys=True) + "\n")
    os.replace(fresh, path)


def without_paths(report):
    """Folders mean nothing elsewhere."""
    return {key: value for key, value in report.items() if key not in ("command",)}


def main():
    folder, name, output, command = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3]), sys.argv[4]
    head = {
        "command": command,
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    generation = read(output / "generation.json") or {}
    generation[name] = head | without_paths(read(folder / "generation.json"))
    write(output / "generation.json", generation)
    (output / f"sampler_loss_{name}.csv").write_text(losses(folder, ["basis", "layer"]))

    sampling, timed = read(folder / "sampling.json"), read(folder / "timed.json")
    orders = sampling["order"]
    write(
        output / "sampling.json",
        head
        | without_paths(sampling)
        | {
            "seconds": timed["seconds"]["sample"],
            "peak_mb": timed["peak_memory_bytes"] / 1e6,
            "evaluations": timed["evaluations"],
            "macs_per_evaluation": timed["macs_per_evaluation"],
            "package_hash": sampling["sampler_hash"],
            "order_ddim": orders["network, float32"]["ddim"],
            "order_dpmpp2m": orders["network, float32"]["dpmpp2m"],
            "same_on_all_cpus": read(folder / "same_on_all_cpus.json"),
        },
    )


if __name__ == "__main__":
    main()
