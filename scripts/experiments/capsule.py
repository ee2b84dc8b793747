"""A person of capsules as Gaussians, for timing splatters: nothing trained, the same everywhere.

    scripts/run python3 scripts/experiments/capsule.py OUTPUT.ply [COUNT]

COUNT (40,000) flat discs of 4 to 8 mm and an opacity of 0.85 to 0.95, at random over the surface of
eleven kinds of capsules that make a person of 1.8 m, y up, in the usual .ply of 3D Gaussians (SH of
degree 0, opacities as logits, scales as logarithms).
"""

import bisect
import math
import pathlib
import random
import struct
import sys

# Ends in metres, and radius; limbs once, for the right side.
TRUNK = (
    ((0, 0.98, 0), (0, 1.38, 0), 0.15),
    ((-0.07, 0.93, 0), (0.07, 0.93, 0), 0.14),
    ((-0.12, 1.38, 0), (0.12, 1.38, 0), 0.085),
    ((0, 1.42, 0), (0, 1.60, 0), 0.055),
    ((0, 1.66, 0.01), (0, 1.70, 0.01), 0.10),
)
LIMBS = (
    ((0.17, 1.40, 0), (0.36, 1.16, 0), 0.052),
    ((0.36, 1.16, 0), (0.49, 0.90, 0.03), 0.042),
    ((0.49, 0.90, 0.03), (0.53, 0.80, 0.04), 0.036),
    ((0.09, 0.90, 0), (0.11, 0.48, 0.01), 0.078),
    ((0.11, 0.48, 0.01), (0.12, 0.08, 0), 0.056),
    ((0.12, 0.045, 0), (0.13, 0.045, 0.15), 0.044),
)
FIELDS = ("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity")
FIELDS += tuple(f"scale_{i}" for i in range(3)) + tuple(f"rot_{i}" for i in range(4))
SH_0 = 0.28209479177387814


def add(a, b, factor=1.0):
    return tuple(x + factor * y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(a):
    length = math.sqrt(dot(a, a))
    return tuple(x / length for x in a)


def mirrored(capsule):
    begin, end, radius = capsule
    return (-begin[0], *begin[1:]), (-end[0], *end[1:]), radius


def area(capsule):
    begin, end, radius = capsule
    return 2 * math.pi * radius * math.dist(begin, end) + 4 * math.pi * radius**2


def is_inside(point, capsule):
    begin, end, radius = capsule
    axis = add(end, begin, -1)
    along = dot(add(point, begin, -1), axis) / max(dot(axis, axis), 1e-12)
    nearest = add(begin, axis, min(max(along, 0), 1))
    return math.dist(point, nearest) < radius - 0.003


def on_surface(capsule, draw):
    """A point of the capsule, evenly, and its normal."""
    begin, end, radius = capsule
    length = math.dist(begin, end)
    normal = unit([draw.gauss(0, 1) for _ in range(3)])
    axis = unit(add(end, begin, -1))
    if draw.random() * area(capsule) < 2 * math.pi * radius * length:
        normal = unit(add(normal, axis, -dot(normal, axis)))
        centre = add(begin, axis, draw.random() * length)
    else:
        centre = end if dot(normal, axis) > 0 else begin
    return add(centre, normal, radius), normal


def turn_from_z(normal):
    """The quaternion (wxyz) of a turn that takes z to the normal."""
    if normal[2] < -0.999999:
        return 0.0, 1.0, 0.0, 0.0
    return unit((1 + normal[2], -normal[1], normal[0], 0.0))


def gaussians(count, seed=7):
    draw = random.Random(seed)
    capsules = [*TRUNK, *LIMBS, *map(mirrored, LIMBS)]
    sums, total = [], 0.0
    for capsule in capsules:
        total += area(capsule)
        sums.append(total)
    made = 0
    while made < count:
        index = min(bisect.bisect(sums, draw.random() * total), len(capsules) - 1)
        point, normal = on_surface(capsules[index], draw)
        others = capsules[:index] + capsules[index + 1 :]
        if any(is_inside(point, other) for other in others):
            continue
        colour = (
            0.5 + 0.4 * math.sin(9 * point[1] + index),
            0.45 + 0.35 * math.sin(13 * point[0] + 2 * index),
            0.4 + 0.3 * math.cos(7 * point[2] + 3 * index),
        )
        colour = [(c + 0.08 * draw.gauss(0, 1) - 0.5) / SH_0 for c in colour]
        opacity, scale = 0.85 + 0.1 * draw.random(), 0.004 + 0.004 * draw.random()
        scales = (scale, scale * (0.95 + 0.1 * draw.random()), 0.3 * scale)
        made += 1
        yield (
            *point,
            *normal,
            *colour,
            math.log(opacity / (1 - opacity)),
            *map(math.log, scales),
            *turn_from_z(normal),
        )


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: capsule.py OUTPUT.ply [COUNT]")
    count = int(sys.argv[2]) if len(sys.argv) == 3 else 40000
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property float {field}" for field in FIELDS] + ["end_header", ""]
    body = b"".join(struct.pack(f"<{len(FIELDS)}f", *row) for row in gaussians(count))
    path = pathlib.Path(sys.argv[1])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes("\n".join(header).encode() + body)


if __name__ == "__main__":
    main()
