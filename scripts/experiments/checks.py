"""Writes docs/results/gradients.json, splat_oracle.json, stability.json, bench.json and
network_bench.json from programs of preset dev.

    scripts/run python3 scripts/experiments/checks.py

gradients: finite differences of every gradient in float64; splat_oracle: `figurine splat` against
the float64 oracle through files; stability: the table of extreme cases; bench: the shipped avatar
per stage, in the release build; network_bench: the networks of edge and paper alone, in float, in
fixed point and with ranges found at run time. The first three do not depend on the machine's mood;
keep it quiet for the others.
"""

import datetime
import json
import os
import pathlib
import platform
import re
import subprocess

RESULTS = pathlib.Path("docs/results")


def text_of(*command):
    return subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE).stdout


def cpu():
    match = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())
    return match.group(1) if match else platform.processor()


def write(name, content, command):
    content |= {
        "command": command,
        "commit": text_of("git", "-c", "safe.directory=*", "rev-parse", "HEAD").strip(),
        "machine": {"architecture": platform.machine(), "cores": os.cpu_count(), "cpu": cpu()},
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    temporary = RESULTS / (name + ".json.tmp")
    temporary.write_text(json.dumps(content, indent=2) + "\n")
    temporary.replace(RESULTS / (name + ".json"))


def main():
    RESULTS.mkdir(parents=True, exist_ok=True)
    gradcheck = "build/dev/tests/toolchain/model/figurine-gradcheck"
    gradients = json.loads(text_of(gradcheck))
    gradients["largest_relative_error"] = max(
        entry["largest_relative_error"] for entry in gradients.values() if isinstance(entry, dict))
    write("gradients", gradients, gradcheck)

    parity = "build/dev/tests/samples/splat_parity_test"
    found = re.findall(r"(splat_oracle_db|export_roundtrip_db)\D*([0-9.]+)", text_of(parity))
    write("splat_oracle", {name: float(value) for name, value in found}, parity)

    text_of("build/dev/tests/stability/figurine-stability", "-o", str(RESULTS / "stability.json"))

    bench = [
        "build/release/samples/figurine/figurine", "bench", "samples/packages/person.fgn",
        "--motion", "samples/packages/walk.fgn", "--size", "512x512", "--json", "-"
    ]
    write("bench", json.loads(text_of(*bench)), " ".join(bench))
    network_bench()


# Rows ARITHMETIC/T/C/THREADS: f32; qs8, every texel; qs8 drawn, only the texels that an avatar
# draws; qd8, dynamic ranges.
def network_bench():
    command = [
        "build/dev/tests/bench/network_bench", "--benchmark_enable_random_interleaving=true",
        "--benchmark_repetitions=9", "--benchmark_min_time=0.1s",
        "--benchmark_report_aggregates_only=true", "--benchmark_format=json"
    ]
    rows = json.loads(text_of(*command))["benchmarks"]
    medians = {
        row["run_name"].removesuffix("/real_time"): round(row["real_time"], 3) for row in rows
        if row["aggregate_name"] == "median"
    }
    write("network_bench", {"median_ms": medians}, " ".join(command))


if __name__ == "__main__":
    main()
