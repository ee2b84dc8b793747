"""Float pictures (.pfm), as `figurine render` and `figurine splat` write them, held against each
other."""

import array
import math
import sys

GREY = 0.5


def read(path):
    """Straight colours and alpha, four values a pixel in the file's order of rows, and the size."""
    magic, size, _, pixels = path.read_bytes().split(b"\n", 3)
    if magic not in (b"PF", b"PF4"):
        sys.exit(f"{path}: not a colour PFM")
    values = array.array("f")
    values.frombytes(pixels)
    return values, size, 4 if magic == b"PF4" else 3


def read_pair(a, b):
    values, size, channels = read(a)
    others, other_size, other_channels = read(b)
    if size != other_size or channels != other_channels or len(values) != len(others):
        sys.exit(f"{a} and {b} have different sizes")
    return values, others, channels


def decibels(squares, count):
    """None: equal to the bit."""
    return None if squares == 0 else -10 * math.log10(squares / count)


def psnr_db(a, b):
    """Over all values."""
    values, others, _ = read_pair(a, b)
    return decibels(sum((x - y) ** 2 for x, y in zip(values, others)), len(values))


def foreground_error(truth, picture):
    """Sum of squared differences over mid-grey, where the truth's alpha exceeds one half, and how
    many values that are."""
    a, b, channels = read_pair(truth, picture)
    if channels != 4:
        sys.exit(f"{truth}: has no alpha")
    squares, count = 0.0, 0
    for i in range(0, len(a), 4):
        alpha = a[i + 3]
        if alpha <= 0.5:
            continue
        other = b[i + 3]
        for c in range(i, i + 3):
            squares += ((a[c] - GREY) * alpha - (b[c] - GREY) * other) ** 2
        count += 3
    return squares, count
