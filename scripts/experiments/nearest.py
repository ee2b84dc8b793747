"""Prints the members that look most like a row's first samples, one name a line.

    nearest.py GENERATION.json ROW
"""

import json
import pathlib
import sys


def main():
    report = json.loads(pathlib.Path(sys.argv[1]).read_text())
    row = next(row for row in report["rows"] if row["name"] == sys.argv[2])
    print("\n".join(row["novelty"]["pictures"]["nearest"]))


if __name__ == "__main__":
    main()
