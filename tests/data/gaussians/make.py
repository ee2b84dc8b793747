#!/usr/bin/env python3
"""Makes the files of this folder anew (README.md): a small scene, and the same scene in other
containers, written and read again by splat-transform, which shares no code with figurine.

    make.py SPLAT_TRANSFORM FOLDER [FIGURINE]

SPLAT_TRANSFORM is the command line of the npm package @playcanvas/splat-transform ("node
.../bin/cli.mjs"). With FIGURINE, that of the built program, the other way is tried as well: what
figurine exports is read by splat-transform, and the largest differences are printed.
"""
import math
import pathlib
import shlex
import struct
import subprocess
import sys

COUNT, DEGREE = 260, 3  # two chunks of the compressed .ply
SH_C0 = 0.28209479177387814
REST = 3 * ((DEGREE + 1)**2 - 1)
NAMES = (["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"] + [f"f_rest_{k}" for k in range(REST)] +
         ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"])


def numbers(seed):
    """Repeatable values in [-1, 1): a linear congruential generator (Numerical Recipes)."""
    state = seed
    while True:
        state = (state * 1664525 + 1013904223) % 2**32
        yield state / 2**31 - 1


def scene():
    """A ring of ellipsoids around a letter F, y down: no turn or mirror of it looks the same."""
    random = numbers(7)
    letter = [(0.0, y / 10) for y in range(-9, 10)] + [(x / 10, -0.9) for x in range(1, 8)] + [
        (x / 10, -0.1) for x in range(1, 6)
    ]
    rows = []
    for i in range(COUNT):
        if i < 3 * len(letter):
            x, y = letter[i % len(letter)]
            place = (x + 0.03 * next(random) - 0.2, y + 0.03 * next(random), 0.05 * next(random))
            colour = (0.9, 0.25 + 0.5 * (y + 1) / 2, 0.1)
        else:
            angle = 2 * math.pi * i / COUNT * 3
            place = (1.5 * math.cos(angle), 1.3 * math.sin(angle), 0.4 * next(random))
            colour = (0.2 + 0.3 * math.cos(angle), 0.5, 0.5 + 0.4 * math.sin(angle))
        rotation = [next(random) for _ in range(4)]
        row = [*place, *((c - 0.5) / SH_C0 for c in colour)]
        row += [0.15 * next(random) for _ in range(REST)]
        row += [3 + 2 * next(random)] + [-3 + 0.7 * next(random) for _ in range(3)] + rotation
        rows.append(row)
    return rows


def write_ply(path, rows):
    header = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(rows)
    header += "".join(f"property float {name}\n" for name in NAMES) + "end_header\n"
    path.write_bytes(header.encode() + b"".join(struct.pack(f"<{len(NAMES)}f", *r) for r in rows))


def write_splat(path, rows):
    """The layout of antimatter15's viewer: position and scale as floats, then eight bytes."""

    def byte(value):
        return max(0, min(255, int(value)))

    with path.open("wb") as file:
        for row in rows:
            value = dict(zip(NAMES, row))
            rotation = [value[f"rot_{k}"] for k in range(4)]
            length = math.sqrt(sum(r * r for r in rotation))
            file.write(struct.pack("<6f", *row[:3], *(math.exp(value[f"scale_{k}"])
                                                      for k in range(3))))
            file.write(bytes([byte((0.5 + SH_C0 * value[f"f_dc_{k}"]) * 255) for k in range(3)]))
            file.write(bytes([byte(255 / (1 + math.exp(-value["opacity"])))]))
            file.write(bytes([byte(r / length * 128 + 128) for r in rotation]))


def read_ply(path):
    data = path.read_bytes()
    start = data.index(b"end_header\n") + 11
    words = [line.split() for line in data[:start].decode().splitlines()]
    count = next(int(w[2]) for w in words if w[:2] == ["element", "vertex"])
    kinds = [(w[2], "d" if w[1] == "double" else "f") for w in words if w[0] == "property"]
    layout = struct.Struct("<" + "".join(kind for _, kind in kinds))
    names = [name for name, _ in kinds]
    return [
        dict(zip(names, layout.unpack_from(data, start + i * layout.size))) for i in range(count)
    ]


def covariance(value):
    """Of a row: the six entries, free of the sign and order that scales and rotations have."""
    w, x, y, z = (value[f"rot_{k}"] for k in range(4))
    n = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / n, x / n, y / n, z / n
    r = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    s = [math.exp(2 * value[f"scale_{k}"]) for k in range(3)]
    return [sum(r[i][k] * s[k] * r[j][k] for k in range(3)) for i in range(3) for j in range(i, 3)]


def compare(ours, theirs):
    """Largest differences of two .ply files of the same Gaussians in the same order."""
    worst = {"position": 0.0, "colour": 0.0, "opacity": 0.0, "covariance, relative": 0.0}
    for a, b in zip(ours, theirs, strict=True):
        worst["position"] = max(worst["position"], *(abs(a[k] - b[k]) for k in "xyz"))
        for name in (name for name in a if name.startswith("f_")):
            worst["colour"] = max(worst["colour"], abs(a[name] - b[name]))
        sigmoid = [1 / (1 + math.exp(-value["opacity"])) for value in (a, b)]
        worst["opacity"] = max(worst["opacity"], abs(sigmoid[0] - sigmoid[1]))
        size = max(covariance(a))
        for p, q in zip(covariance(a), covariance(b)):
            worst["covariance, relative"] = max(worst["covariance, relative"], abs(p - q) / size)
    return ", ".join(f"{name} {value:.2g}" for name, value in worst.items())


def main(tool, folder, program=None):
    def transform(*arguments):
        subprocess.run([*shlex.split(tool), "-w", *map(str, arguments)], check=True,
                       capture_output=True)

    rows = scene()
    source = folder / "scene.ply"
    write_ply(source, rows)
    write_splat(folder / "scene.splat", rows)
    transform(source, folder / "scene.compressed.ply")
    transform("--spz-version", "3", source, folder / "scene.v3.spz")
    transform("--spz-version", "4", source, folder / "scene.v4.spz")
    as_read = {}
    for name in ["scene.compressed.ply", "scene.v3.spz", "scene.v4.spz", "scene.splat"]:
        as_read[name] = folder / f"{name}.as_read.ply"
        transform(folder / name, as_read[name])
    if as_read["scene.v4.spz"].read_bytes() == as_read["scene.v3.spz"].read_bytes():
        as_read["scene.v4.spz"].unlink()  # as it should be: one of them is enough
        as_read["scene.v4.spz"] = as_read["scene.v3.spz"]
    if program:
        for name in ["scene.ply", "scene.compressed.ply", "scene.v3.spz", "scene.v4.spz",
                     "scene.splat"]:
            ours, theirs = folder / "exported.ply", folder / "exported_as_read.ply"
            subprocess.run([*shlex.split(program), "export", folder / name, "-o", ours], check=True,
                           capture_output=True)
            transform(ours, theirs)
            print(f"{name}: exported and read by splat-transform, against what it reads itself: " +
                  compare(read_ply(as_read.get(name, source)), read_ply(theirs)))
            ours.unlink()
            theirs.unlink()


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(sys.argv[1], pathlib.Path(sys.argv[2]), *sys.argv[3:])
