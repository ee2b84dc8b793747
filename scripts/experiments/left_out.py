"""What a frame leaves out: what each omission saves, and what it costs.

    scripts/run python3 scripts/experiments/left_out.py [OUTPUT]

Draws the shipped person (512x512, in the shipped walk, int8, one core) with and without every
omission, by turns, ROUNDS times, by the build of `figurine` in build/release; then frames of
256x256 as float pictures, and holds those with the omission against those without, over the pixels
that show the person. Exact omissions are on by default and have to leave every bit as it is; the
others are asked for by name. Writes OUTPUT (docs/results/left_out.json), and prints it; a few
minutes on an idle core.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import pfm
import results

ROUNDS = 5
BENCH_FRAMES = 60
PICTURE_FRAMES, PICTURE_SIZE = "8:24", "256x256"
FIGURINE = pathlib.Path("build/release/samples/figurine/figurine")
INSPECT = pathlib.Path("build/release/samples/inspect/figurine-inspect")
PERSON = ["samples/packages/person.fgn", "--motion", "samples/packages/walk.fgn"]
FRAME = ["--precision", "q8", "--threads", "1"]
SIZE = "512x512"

# name, framing, options with the omission, options without it
EXACT = [
    ("texels outside the picture", "body", [], ["--keep", "hidden-texels"]),
    ("texels outside the picture", "bust", [], ["--keep", "hidden-texels"]),
    ("Gaussians outside the picture", "bust", [], ["--keep", "hidden-texels", "--keep", "outside"]),
    ("transparent Gaussians", "body", [], ["--keep", "transparent"]),
    ("tiles that an ellipse misses", "body", [], ["--keep", "missed-tiles"]),
    ("what lies behind opaque tiles", "body", [], ["--keep", "stopped"]),
]
ASKED_FOR = [
    ("texels that face away, cosine above 0.5", "body", ["--averted-above", "0.5"], []),
    ("texels that face away, cosine above 0.25", "body", ["--averted-above", "0.25"], []),
    ("texels that face away, all", "body", ["--averted-above", "0"], []),
    ("network at one of 2 frames", "body", ["--network-hz", "{half}"], []),
    ("network at one of 4 frames", "body", ["--network-hz", "{quarter}"], []),
    ("network at one of 8 frames", "body", ["--network-hz", "{eighth}"], []),
    ("exact blend", "body", ["--fast-blend"], []),
]  # fmt: skip


def run(program, *arguments):
    command = [str(program.resolve()), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"left_out: {' '.join(command)}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def rates():
    """Of the network, for frames at the walk's own rate."""
    hz = run(INSPECT, PERSON[-1], "--json")["motion"]["frames_per_second"]
    return {"half": hz / 2, "quarter": hz / 4, "eighth": hz / 8}


def bench(framing, options):
    """Milliseconds a frame; of networks that do not run at every frame, the mean of an interval."""
    report = run(FIGURINE, "bench", *PERSON, *FRAME, "--size", SIZE, "--framing", framing,
                 "--frames", BENCH_FRAMES, "--json", "-", *options)  # fmt: skip
    (lane,) = report["runs"]
    ms = {stage: times["median"] for stage, times in lane["stages_ms"].items()}
    return ms, lane["work"]["networks"], report["machine"]["cpu"]


def total(with_it, without_it):
    """The least of rounds of a frame's median time with an omission and without: a virtual machine
    may run at one of two speeds, and a round at the slower says nothing. Where a network runs at
    one of N frames medians say little of a mixture: of the time without, the runs that were left
    out are taken off."""
    more = min(ms["total"] for ms, _ in without_it)
    less = min(ms["total"] for ms, _ in with_it)
    share = with_it[0][1]
    if share < 1:
        run_ms = min(ms["maps"] + ms["network"] for ms, _ in without_it)
        less = more - (1 - share) * run_ms
    return less, more


def error_db(framing, with_it, without_it):
    """Of the pictures with the omission against those without; None: equal to the bit."""
    squares, count = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        for name, options in (("less", with_it), ("all", without_it)):
            out = pathlib.Path(folder, f"{name}_%04d.pfm")
            run(FIGURINE, "render", *PERSON, *FRAME, "--size", PICTURE_SIZE, "--framing", framing,
                "--frames", PICTURE_FRAMES, "-o", out, "--json", *options)  # fmt: skip
        for truth in sorted(pathlib.Path(folder).glob("all_*.pfm")):
            picture = pathlib.Path(folder, truth.name.replace("all", "less"))
            if truth.read_bytes() == picture.read_bytes():
                continue
            more, values = pfm.foreground_error(truth, picture)
            squares, count = squares + more, count + values
    return pfm.decibels(squares, count) if count else None


def main():
    if len(sys.argv) > 2:
        sys.exit("usage: left_out.py [OUTPUT]")
    output = pathlib.Path(sys.argv[1] if len(sys.argv) == 2 else "docs/results/left_out.json")
    load, hz = os.getloadavg()[0], rates()
    table = [
        (kind, name, framing, [o.format(**hz) for o in less], more)
        for kind, rows in (("exact", EXACT), ("asked for", ASKED_FOR))
        for name, framing, less, more in rows
    ]
    times = [([], []) for _ in table]
    for turn in range(ROUNDS):
        for (_, _, framing, less, more), (with_it, without_it) in zip(table, times):
            for options, seen in ((less, with_it), (more, without_it))[:: 1 if turn % 2 else -1]:
                ms, networks, cpu = bench(framing, options)
                seen.append((ms, networks))
    rows = []
    for (kind, name, framing, less, more), (with_it, without_it) in zip(table, times):
        row = {"left_out": name, "kind": kind, "framing": framing}
        row["options"] = " ".join(less or more)
        row["ms"], row["ms_without"] = total(with_it, without_it)
        row["gain"] = row["ms_without"] / row["ms"]
        row["psnr_db"] = error_db(framing, less, more)
        if kind == "exact" and row["psnr_db"] is not None:
            sys.exit(f"left_out: {name}: {row['psnr_db']:.1f} dB, and no bit may differ")
        rows.append(row)
        print(", ".join(f"{key} {value}" for key, value in results.rounded(row).items()))
    report = results.head("scripts/experiments/left_out.py")
    report["machine"] = {"cpu": cpu, "load_before": load}
    report |= {"rounds": ROUNDS, "frames": BENCH_FRAMES, "rows": rows}
    results.write(output, report)


if __name__ == "__main__":
    main()
