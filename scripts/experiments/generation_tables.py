"""Prints the tables of docs/reports/sampler_*.md from docs/results/generation*.json, in
Markdown.

    generation_tables.py RESULTS NAME        NAME of the population: edge, nano
"""

import pathlib
import sys

from generation_files import read_generation

NETWORK = "figurine-features"


def value(of):
    """An interval's value, or a plain number; None where it is left out."""
    return of.get("value") if isinstance(of, dict) else of


def text(number, form):
    return "" if number is None else form.format(number)


def percents(*numbers):
    return ", ".join(text(number, "{:.0f} %") for number in numbers)


def percent(share):
    return f"{100 * share:.0f} %"


def draws_of(part):
    draws = part.get("draws")
    return percents(draws["coverage_percent"], draws["one_nna_percent"]) if draws else ""


def in_pictures(row):
    part, train, novelty = row.get("held_out", {}), row.get("train", {}), row.get("novelty")
    return [
        text(value(part.get("mmd_psnr_db")), "{:.1f} dB"),
        text(value(part.get("coverage_percent")), "{:.0f} %"),
        text(value(part.get("one_nna_percent")), "{:.0f} %"),
        draws_of(part),
        text(value(train.get("one_nna_percent")), "{:.0f} %"),
        percent(novelty["pictures"]["copy_share"]) if novelty else "",
        text(novelty["pictures"]["median_ratio"], "{:.2f}") if novelty else "",
        text(row.get("highpass_ratio"), "{:.2f}"),
    ]


def through_the_network(row):
    part = row.get("held_out", {})
    near = part.get("perceptual", {}).get(NETWORK, {})
    novelty = row.get("novelty", {}).get("perceptual", {}).get(NETWORK)
    return [
        text(value(near.get("mmd")), "{:.2f}"),
        text(value(near.get("coverage_percent")), "{:.0f} %"),
        text(value(near.get("one_nna_percent")), "{:.0f} %"),
        draws_of(near),
        percent(novelty["copy_share"]) if novelty else "",
        text(value(part.get("kid", {}).get(NETWORK)), "{:.2f}"),
        text(value(part.get("frechet", {}).get(NETWORK, {})), "{:.1f}"),
    ]


def against_captures(row):
    part = row.get("held_out_captures", {})
    return [
        text(value(part.get("mmd_psnr_db")), "{:.1f} dB"),
        text(value(part.get("coverage_percent")), "{:.0f} %"),
        text(value(part.get("one_nna_percent")), "{:.0f} %"),
        draws_of(part),
    ]


def table(titles, rows):
    """Without the rows and the columns that have nothing in them."""
    rows = [(name, cells) for name, cells in rows if any(cells)]
    used = [k for k in range(len(titles)) if any(cells[k] for _, cells in rows)]
    print("| | " + " | ".join(titles[k] for k in used) + " |")
    print("|---" * (len(used) + 1) + "|")
    for name, cells in rows:
        print(f"| {name} | " + " | ".join(cells[k] for k in used) + " |")
    print()


def main():
    rows = read_generation(pathlib.Path(sys.argv[1]))[sys.argv[2]]["rows"]
    distances = ["COV", "1-NNA", "COV, 1-NNA of draws"]
    for titles, cells_of in [
        (["MMD", *distances, "1-NNA, training", "copies", "nearest", "sharpness"], in_pictures),
        (["MMD", *distances, "copies", "KID", "Frechet"], through_the_network),
        (["MMD", *distances], against_captures),
    ]:
        table(titles, [(row["name"], cells_of(row)) for row in rows])


if __name__ == "__main__":
    main()
