"""Prints the tables of docs/generation.md from docs/results/generation.json, in Markdown.

    generation_tables.py RESULTS NAME        NAME of the population: edge, nano
"""

import json
import pathlib
import sys

NETWORK = "figurine-features"


def value(of):
    """An interval's value, or a plain number; None where it is left out."""
    return of.get("value") if isinstance(of, dict) else of


def text(number, form):
    return "" if number is None else form.format(number)


def percents(*numbers):
    return ", ".join(text(number, "{:.0f} %") for number in numbers)


def copies(novelty):
    shares = [novelty["pictures"]["copy_share"]]
    if NETWORK in novelty.get("perceptual", {}):
        shares.append(novelty["perceptual"][NETWORK]["copy_share"])
    return " / ".join(f"{100 * share:.0f} %" for share in shares)


def draws_of(part):
    draws = part.get("draws")
    return percents(draws["coverage_percent"], draws["one_nna_percent"]) if draws else ""


def columns_of(row):
    part, train, novelty = row.get("held_out", {}), row.get("train", {}), row.get("novelty")
    draws, near = part.get("draws", {}), part.get("perceptual", {}).get(NETWORK, {})
    cells = [
        text(value(part.get("mmd_psnr_db")), "{:.1f} dB"),
        text(value(part.get("coverage_percent")), "{:.0f} %"),
        text(value(part.get("one_nna_percent")), "{:.0f} %"),
        percents(draws["coverage_percent"], draws["one_nna_percent"]) if draws else "",
        text(value(train.get("one_nna_percent")), "{:.0f} %"),
        copies(novelty) if novelty else "",
        text(novelty["pictures"]["median_ratio"], "{:.2f}") if novelty else "",
        text(row.get("highpass_ratio"), "{:.2f}"),
    ]
    if near:
        cells.append(f"{value(near['mmd']):.2f}, " +
                     percents(value(near["coverage_percent"]), value(near["one_nna_percent"])))
        cells.append(draws_of(near))
    else:
        cells += ["", ""]
    cells.append(text(value(part.get("kid", {}).get(NETWORK)), "{:.2f}"))
    cells.append(text(value(part.get("frechet", {}).get(NETWORK, {})), "{:.1f}"))
    return cells


def table(titles, rows):
    print("| | " + " | ".join(titles) + " |")
    print("|---" * (len(titles) + 1) + "|")
    for name, cells in rows:
        print(f"| {name} | " + " | ".join(cells) + " |")
    print()


def main():
    report = json.loads((pathlib.Path(sys.argv[1]) / "generation.json").read_text())[sys.argv[2]]
    titles = [
        "MMD to held out, PSNR", "COV", "1-NNA", "COV, 1-NNA of all draws", "1-NNA to training",
        "copies", "nearest member", "sharpness", "MMD, COV, 1-NNA by the network",
        "COV, 1-NNA of all draws by it", "KID", "Frechet"
    ]
    table(titles, [(row["name"], columns_of(row)) for row in report["rows"]])
    against = [(row["name"], row["held_out_captures"]) for row in report["rows"]
               if "held_out_captures" in row]
    rows = [(name, [
        f"{value(part['mmd_psnr_db']):.1f} dB", f"{value(part['coverage_percent']):.0f} %",
        f"{value(part['one_nna_percent']):.0f} %", draws_of(part)
    ]) for name, part in against]
    table(["MMD to captures", "COV", "1-NNA", "COV, 1-NNA of all draws"], rows)


if __name__ == "__main__":
    main()
