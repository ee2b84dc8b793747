"""What a small figure loses when its network does not run for every pose.

    scripts/run python3 scripts/experiments/stale_networks.py FIGURINE [OUTPUT]

FIGURINE is a build of `figurine`. It draws the shipped avatar in the shipped walk at some sizes: a
pose, and then another one, STEP frames of the motion later, with the first pose's outputs of the
network (`--network-below-px`) and with its own. Writes the PSNR of the one picture against the
other, over the pixels that show the person, pooled over the starts, to OUTPUT
(docs/results/stale_networks.json), and prints it.
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile
import zlib

import results

AVATAR, MOTION = "samples/packages/person.fgn", "samples/packages/walk.fgn"
SIZES = (32, 64, 128, 256)  # of the picture, which the figure nearly fills
STEPS = (1, 2, 4, 8, 16, 32)  # frames of the motion
STARTS = (5, 40, 75)
GREY = 127.5


def unfilter(kind, row, above, channels):
    """A row of PNG's scanlines in place (PNG specification, 9.2)."""
    for i in range(len(row)):
        left = row[i - channels] if i >= channels else 0
        up, corner = above[i], above[i - channels] if i >= channels else 0
        if kind == 4:
            target = left + up - corner
            order = sorted((abs(target - x), n, x) for n, x in enumerate((left, up, corner)))
            row[i] = (row[i] + order[0][2]) & 255
        else:
            row[i] = (row[i] + (0, left, up, (left + up) // 2)[kind]) & 255
    return row


def read_rgba(path):
    """The bytes of an 8-bit RGBA image, no interlacing: what figurine writes."""
    data, at, body, width, height = path.read_bytes(), 8, b"", 0, 0
    while at < len(data):
        size, name = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        chunk = data[at + 8 : at + 8 + size]
        if name == b"IHDR":
            width, height = int.from_bytes(chunk[:4], "big"), int.from_bytes(chunk[4:8], "big")
            if chunk[8:] != b"\x08\x06\x00\x00\x00":
                sys.exit(f"{path}: not 8-bit RGBA")
        elif name == b"IDAT":
            body += chunk
        at += 12 + size
    lines, pixels, above = zlib.decompress(body), bytearray(), bytes(4 * width)
    for y in range(height):
        begin = y * (4 * width + 1)
        row = bytearray(lines[begin + 1 : begin + 1 + 4 * width])
        above = unfilter(lines[begin], row, above, 4)
        pixels += above
    return pixels, width, height


def over_grey(pixel):
    return [(value - GREY) * pixel[3] / 255 for value in pixel[:3]]


def compare(truth, picture):
    """Sum of squared errors, values, and the figure's longer side in pixels."""
    squares, values, xs, ys = 0.0, 0, [], []
    pixels, width, height = truth
    for i in range(width * height):
        a, b = pixels[4 * i : 4 * i + 4], picture[0][4 * i : 4 * i + 4]
        if a[3] <= 127:
            continue
        squares += sum((p - q) ** 2 for p, q in zip(over_grey(a), over_grey(b)))
        values += 3
        xs.append(i % width)
        ys.append(i // width)
    return squares, values, max(max(xs) - min(xs), max(ys) - min(ys)) + 1


def draw(program, folder, size, start, step, below_px):
    kind = "stale" if below_px else "own"
    name = pathlib.Path(folder, f"{kind}_%04d.png")
    command = [program, "render", AVATAR, "--motion", MOTION, "--size", f"{size}x{size}"]
    command += ["--frames", f"{start}:{start + step + 1}:{step}", "-o", str(name), "--json"]
    command += ["--network-below-px", str(below_px)]
    run = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    work = json.loads(run.stdout)["work"]
    if work["networks"] != (0.5 if below_px else 1.0):
        sys.exit(f"{' '.join(command)}: {work}")
    return read_rgba(pathlib.Path(folder, f"{kind}_{start + step:04d}.png"))


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: stale_networks.py FIGURINE [OUTPUT]")
    program = sys.argv[1]
    output = pathlib.Path(sys.argv[2] if len(sys.argv) == 3 else "docs/results/stale_networks.json")
    rows = []
    for size in SIZES:
        for step in STEPS:
            squares, values, sides = 0.0, 0, []
            for start in STARTS:
                with tempfile.TemporaryDirectory() as folder:
                    truth = draw(program, folder, size, start, step, 0)
                    stale = draw(program, folder, size, start, step, 4096)
                more, count, side = compare(truth, stale)
                squares, values = squares + more, values + count
                sides.append(side)
            mean = squares / values
            row = {"figure_px": max(sides), "step_frames": step}
            row["psnr_db"] = 10 * math.log10(255**2 / mean) if mean > 0 else None
            rows.append(row)
            print("{figure_px:4} px, {step_frames:2} frames: {psnr_db:.1f} dB".format(**row))
    report = results.head("scripts/experiments/stale_networks.py")
    report |= {"avatar": AVATAR, "motion": MOTION, "starts": list(STARTS), "rows": rows}
    results.write(output, report)


if __name__ == "__main__":
    main()
