"""Shortens the report of `figurine-train evaluate quantization`: FOLDER/quantization.json ->
docs/results/quantization.json, quantization_layers.csv and quantization_saturation.csv.

    quantization_report.py FOLDER OUTPUT

FOLDER is that of scripts/experiments/quantization.sh. What every layer costs and how many values of
every tensor lie at the end of their range are tables of some twenty rows a person: they go to the
CSV files, their quantiles and the worst layer stay.
"""

import pathlib
import sys

import results


def costliest(layers):
    worst = min(layers, key=lambda layer: layer["psnr_to_f32_db"])
    return {
        "psnr_to_f32_db": results.quantiles([layer["psnr_to_f32_db"] for layer in layers]),
        "costliest": worst,
    }


def main(folder, output):
    report = results.read(pathlib.Path(folder) / "quantization.json")
    if report is None:
        sys.exit(f"quantization_report: {folder}/quantization.json: no such file")
    layers, saturation = [], []
    for member in report["members"]:
        who = {"run": pathlib.PurePath(member["run"]).name}
        layers += [who | {"layer": None, "op": None} | layer for layer in member["layers"]]
        saturation += [who | value for value in member["saturation"]]
        member["layers"] = costliest(member["layers"])
        member["saturation"] = {
            "share": results.quantiles([value["share"] for value in member["saturation"]])
        }
    output = pathlib.Path(output)
    results.write(output / "quantization.json", report)
    results.write_rows(output / "quantization_layers.csv", layers)
    results.write_rows(output / "quantization_saturation.csv", saturation)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
