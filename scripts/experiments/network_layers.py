"""What each layer of the shipped person's network costs: milliseconds here, instructions on ARM.

    scripts/run python3 scripts/experiments/network_layers.py LAYER_TIMES [OUTPUT]

LAYER_TIMES is a build of tests/bench/layer_times. Times are medians over frames, then over runs, on
one core (a minute of an idle one); instructions are those of docs/results/arm_instructions.json, if
it is there and of the same layers. Writes OUTPUT (docs/results/network_layers.json) and prints it.
"""

import json
import os
import pathlib
import statistics
import subprocess
import sys

import results

RUNS, FRAMES = 5, 400
AVATAR = "samples/packages/person.fgn"
ARM = pathlib.Path("docs/results/arm_instructions.json")


def arm_instructions(layers):
    """{core: instructions by layer}, of the layers that were timed."""
    if not ARM.exists():
        return {}
    cores = json.loads(ARM.read_text())["cores"]
    names = [layer["name"] for layer in layers]
    return {
        core: [layer.get("instructions", 0) for layer in found["layers"]]
        for core, found in cores.items()
        if [layer["layer"] for layer in found.get("layers", [])] == names
    }


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: network_layers.py LAYER_TIMES [OUTPUT]")
    output = pathlib.Path(sys.argv[2] if len(sys.argv) == 3 else "docs/results/network_layers.json")
    load = os.getloadavg()[0]
    runs = []
    for _ in range(RUNS):
        done = subprocess.run(
            [sys.argv[1], AVATAR, str(FRAMES)], check=True, capture_output=True, text=True
        )
        runs.append(json.loads(done.stdout))
    first = runs[0]
    counted = arm_instructions(first["layers"])
    network_ms = statistics.median(run["network_ms"] for run in runs)
    rows = []
    for i, layer in enumerate(first["layers"]):
        ms = statistics.median(run["layers"][i]["ms"] for run in runs)
        row = {"layer": layer["name"], "macs": layer["macs"], "ms": ms, "share": ms / network_ms}
        row["gmacs_per_second"] = layer["macs"] / ms / 1e6 if layer["macs"] and ms else None
        row |= {f"{core}_instructions": counts[i] for core, counts in counted.items()}
        rows.append(row)
        print(", ".join(f"{key} {value}" for key, value in results.rounded(row).items()))
    report = results.head("scripts/experiments/network_layers.py LAYER_TIMES")
    report["machine"] = {"cpu": first["cpu"], "isa": first["isa"], "library": first["library"]}
    report["machine"]["load_before"] = load
    report |= {"avatar": AVATAR, "runs": RUNS, "frames": FRAMES, "network_ms": network_ms}
    report["frame_ms"] = statistics.median(run["frame_ms"] for run in runs)
    report["rows"] = rows
    results.write(output, report)


if __name__ == "__main__":
    main()
