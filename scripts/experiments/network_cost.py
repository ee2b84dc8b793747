"""The price list of pose networks: milliseconds by side and channels, in int8 on one thread.

    scripts/run python3 scripts/experiments/network_cost.py NETWORK_BENCH [OUTPUT]

NETWORK_BENCH is a build of tests/bench/network_bench. Its networks have random weights and are run
as an avatar runs them: a body covers 60 % of the map, 20 of 26 input channels are constant, the
head is evaluated where it is wanted. Writes medians of interleaved repetitions to OUTPUT
(docs/results/network_cost.json) and prints them; about a minute on an idle CPU.
"""

import json
import os
import pathlib
import subprocess
import sys

import results

REPETITIONS = 7


def cpu_name():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return os.uname().machine


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: network_cost.py NETWORK_BENCH [OUTPUT]")
    output = pathlib.Path(sys.argv[2] if len(sys.argv) == 3 else "docs/results/network_cost.json")
    command = [sys.argv[1], "--benchmark_filter=^price/", "--benchmark_format=json"]
    command += [f"--benchmark_repetitions={REPETITIONS}", "--benchmark_min_time=0.05s"]
    command += ["--benchmark_enable_random_interleaving=true"]
    command += ["--benchmark_report_aggregates_only=true"]
    load = os.getloadavg()[0]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    rows = []
    for entry in report["benchmarks"]:
        if entry.get("aggregate_name") != "median":
            continue
        _, size, channels, threads = entry["run_name"].split("/")[:4]
        row = {"size": int(size), "channels": int(channels), "threads": int(threads)}
        row |= {"ms": entry["real_time"], "macs": entry["macs"]}
        row["gmacs_per_second"] = entry["macs"] / entry["real_time"] / 1e6
        rows.append(row)
    rows.sort(key=lambda row: (row["size"], row["channels"]))
    for row in rows:
        print(", ".join(f"{key} {value}" for key, value in results.rounded(row).items()))
    machine = {"cpu": cpu_name(), "load_before": load}
    results.write(
        output,
        results.head("scripts/experiments/network_cost.py NETWORK_BENCH")
        | {"machine": machine, "repetitions": REPETITIONS, "rows": rows},
    )


if __name__ == "__main__":
    main()
