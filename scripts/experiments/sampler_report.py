"""Puts a sampler's figures together: FOLDER/{generation,sampling,timed}.json, golden.txt and the
runs' losses -> docs/results/generation.json, generation_entropy.csv, sampling.json and
sampler_loss_NAME.csv.

    sampler_report.py FOLDER NAME OUTPUT COMMAND

FOLDER is that of scripts/experiments/sampler.sh. "shipped" says of the package that ships how far
it is from what is wanted of it.
"""

import pathlib
import re
import sys

import results
from generation_files import read_generation, write_generation
from variants_report import merged_losses


def without_paths(report):
    """Folders mean nothing elsewhere."""
    return {key: value for key, value in report.items() if key not in ("command",)}


def same_on_all_cpus(golden, name):
    """What scripts/check_golden printed of the sampler, one line a CPU."""
    line = rf"^check_golden: (\S+): .*sampler {re.escape(name)}, (\d+) seeds, first (\w+)"
    found = re.findall(line, golden, re.MULTILINE)
    cpus = [cpu if cpu == "host" else f"{cpu} (QEMU)" for cpu, _, _ in found]
    hashes = {weights for _, _, weights in found}
    return {
        "cpus": cpus,
        "seeds": int(found[0][1]),
        "weights_of_seed_0": sorted(hashes),
        "same": len(hashes) == 1 and len(found) == golden.count("\n"),
    }


def keep_entropy(before, now):
    """A package that says nothing of its posterior entropy has the one found when it was trained:
    it depends on settings and population alone."""
    if before.get("population_hash") != now["population_hash"]:
        return
    known = {run["name"]: run for run in before["runs"]}
    for run in now["runs"]:
        old = known.get(run["name"], {})
        if "posterior_entropy" in run or "posterior_entropy" not in old:
            continue
        if old["settings"] == run["settings"]:
            run["posterior_entropy"] = old["posterior_entropy"]


def drawn(comparison, key):
    """Of all draws, where there are several."""
    value = comparison.get("draws", comparison)[key]
    return value["value"] if isinstance(value, dict) else value


def describe_shipped(report, package):
    """The package's row beside those of held-out and of training members."""
    rows = {row["name"]: row for row in report["rows"]}
    own, held_out, members = (rows[name] for name in ("shipped", "held-out members",
                                                      "training members"))
    copies = {"": [row["novelty"]["pictures"]["copy_share"] for row in (own, held_out)]}
    for network in own["novelty"].get("perceptual", {}):
        copies["network_"] = [row["novelty"]["perceptual"][network]["copy_share"]
                              for row in (own, held_out)]
    summary = {
        "bytes": package.stat().st_size,
        "samples": own["samples"],
        "coverage_percent": drawn(own["held_out"], "coverage_percent"),
        "coverage_below_members_points": drawn(members["held_out"], "coverage_percent")
        - drawn(own["held_out"], "coverage_percent"),
        "mmd_below_members_db": drawn(members["held_out"], "mmd_psnr_db")
        - drawn(own["held_out"], "mmd_psnr_db"),
        "one_nna_percent": drawn(own["held_out"], "one_nna_percent"),
        "one_nna_percent_of_members": drawn(members["held_out"], "one_nna_percent"),
        "highpass_ratio": own["highpass_ratio"],
        "mixed_percent": 100 * own["by_part"]["mixed_share"],
    }
    if "unseen_captures" in own:
        for key in ("coverage_percent", "mmd_psnr_db", "one_nna_percent"):
            for whose, row in (("", own), ("_of_members", members)):
                summary[f"unseen_{key}{whose}"] = row["unseen_captures"]["groups"][key]
    if "bust" in own:
        summary["bust_highpass_ratio"] = own["bust"]["highpass_ratio"]
    for kind, (of_own, of_held_out) in copies.items():
        summary[f"copy_share_{kind}percent"] = 100 * of_own
        summary[f"copy_share_{kind}over_held_out_points"] = 100 * (of_own - of_held_out)
    return summary


def main():
    folder, name, output = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
    head = results.head(sys.argv[4])
    before = read_generation(output).get(name, {})
    generation = {}
    generation[name] = head | without_paths(results.read(folder / "generation.json"))
    keep_entropy(before, generation[name])
    generation["shipped"] = describe_shipped(
        generation[name], pathlib.Path("samples/samplers") / f"{name}.fgn")
    write_generation(output, generation)
    losses = output / f"sampler_loss_{name}.csv"
    runs = [run for run in ("shipped", "alone", "layer") if (folder / run).exists()]
    results.write_text(losses, merged_losses(losses, folder, runs))

    golden = folder / "golden.txt"
    same = {}
    if golden.exists():
        same = {"same_on_all_cpus": same_on_all_cpus(golden.read_text(), name)}
    sampling = output / "sampling.json"
    measured = results.read(folder / "sampling.json")
    if measured is None:  # the package that ships: its figures stay those of when it was made
        results.write(sampling, results.read(sampling) | same)
        return
    timed = results.read(folder / "timed.json")
    orders = measured["order"]
    summary = {
        "seconds": timed["seconds"]["sample"],
        "peak_mb": timed["peak_memory_bytes"] / 1e6,
        "evaluations": timed["evaluations"],
        "macs_per_evaluation": timed["macs_per_evaluation"],
        "package_hash": measured["sampler_hash"],
        "order_ddim": orders["network, float32"]["ddim"],
        "order_dpmpp2m": orders["network, float32"]["dpmpp2m"],
    }
    report = head | without_paths(measured) | same | summary
    results.write(sampling, dict(sorted(report.items())))


if __name__ == "__main__":
    main()
