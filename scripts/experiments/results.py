"""What the reports of this folder share: how a file of docs/results is read, shortened and written.

A results file is read by people, in reviews above all. So a number has six significant digits, what
fits into a line stands on one, a long list becomes its quantiles, and where the whole list is of
use it is a CSV file beside the JSON, one row an entry.
"""

import csv
import datetime
import io
import json
import math
import os
import statistics

COLUMNS = 100
DIGITS = 6


def read(path):
    return json.loads(path.read_text()) if path.exists() else None


def head(command):
    """Where a figure comes from: the first fields of every results file."""
    return {
        "command": command,
        "commit": os.environ.get("FIGURINE_COMMIT", "unknown"),
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{DIGITS}g}")
    return value


def quantiles(values):
    """Of a list that is too long to read: its quantiles (linear between entries) and its mean."""
    ordered = sorted(value for value in values if value is not None)
    if not ordered:
        return None
    if len(ordered) > 1:
        cuts = statistics.quantiles(ordered, n=20, method="inclusive")
    else:
        cuts = ordered * 19
    return {
        "min": ordered[0],
        "p5": cuts[0],
        "p25": cuts[4],
        "median": cuts[9],
        "p75": cuts[14],
        "p95": cuts[18],
        "max": ordered[-1],
        "mean": statistics.fmean(ordered),
        "count": len(ordered),
    }


def filled(parts, indent):
    """Entries side by side, as many as a line takes."""
    lines = [""]
    for part in parts:
        if lines[-1] and len(indent) + len(lines[-1]) + 1 + len(part) > COLUMNS:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + part
    return lines


def text(value, indent="", used=0):
    """JSON in lines of at most COLUMNS where that can be done; `used` of the first are taken."""
    line = json.dumps(value, ensure_ascii=False)
    fits = len(indent) + used + len(line) < COLUMNS
    if fits or not isinstance(value, (dict, list)) or not value:
        return line
    inner = indent + " "
    if isinstance(value, dict):
        keys = [json.dumps(key, ensure_ascii=False) + ": " for key in value]
        entries = list(value.values())
    else:
        keys, entries = [""] * len(value), value
    lines = [key + text(entry, inner, len(key)) for key, entry in zip(keys, entries)]
    lines = [line + "," for line in lines[:-1]] + lines[-1:]
    if not any(isinstance(entry, (dict, list)) for entry in entries):
        lines = filled(lines, inner)
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return "\n".join([opening, *(inner + line for line in lines), indent + closing])


def write_text(path, content):
    fresh = path.with_suffix(path.suffix + ".tmp")
    fresh.write_text(content)
    os.replace(fresh, path)


def write(path, value):
    write_text(path, text(rounded(value)) + "\n")


def read_rows(path):
    """A CSV file's rows, as texts; none where there is no file."""
    if not path.exists():
        return []
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_rows(path, rows):
    """The rows, dicts with the keys of the first, as CSV; the file goes where there are none."""
    if not rows:
        path.unlink(missing_ok=True)
        return
    content = io.StringIO()
    writer = csv.DictWriter(content, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: rounded(value) for key, value in row.items()})
    write_text(path, content.getvalue())
