#!/usr/bin/env python3
"""Makes small seeds anew: every layout of Gaussians that is read, with two of them; tensors,
pickled numbers and poses.

    make.py [SPLAT_TRANSFORM]

v4.spz needs zstd, which Python has not: it is written by splat-transform (tests/data/gaussians)
from plain.ply, where that command line is given.
"""
import gzip
import json
import pathlib
import re
import shlex
import struct
import subprocess
import sys

FOLDER = pathlib.Path(__file__).resolve().parent
PLAIN = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
         "rot_0", "rot_1", "rot_2", "rot_3"]
ROWS = [[0.5, -0.25, 1, 0.1, 0.2, 0.3, 1, -3, -4, -5, 1, 0, 0, 0],
        [-0.5, 2, 0, 1, -1, 0, -1, -2, -2, -4, 0.5, 0.5, -0.5, 0.5]]


def header(encoding, elements, comments=()):
    lines = ["ply", f"format {encoding} 1.0", *(f"comment {c}" for c in comments)]
    for name, count, properties in elements:
        lines += [f"element {name} {count}", *(f"property {p}" for p in properties)]
    return ("\n".join([*lines, "end_header"]) + "\n").encode()


def vertex(names, kind="float"):
    return ("vertex", 2, [f"{kind} {name}" for name in names])


def body(rows, form="<f"):
    return b"".join(struct.pack(form, value) for row in rows for value in row)


def spz(version, degree):
    text = struct.pack("<4sIIBBBB", b"NGSP", version, 2, degree, 12, 1, 0)
    positions = 2 * 3 * (2 if version == 1 else 3)
    rotations = 2 * (3 if version < 3 else 4)
    sizes = [positions, 2, 6, 6, rotations, 2 * 3 * ((degree + 1)**2 - 1)]
    return text + b"".join(bytes((17 * i + 40) % 256 for i in range(size)) for size in sizes)


def write(name, data):
    """Into the folder of the fuzzer that the name's end says."""
    (FOLDER / name.rsplit(".")[-1] / name).write_bytes(data)


def tensors(data, **entries):
    """A .safetensors file of these entries: name: [dtype, shape, begin, end]."""
    header = {"__metadata__": {"kind": "seed"}}
    for name, (kind, shape, begin, end) in entries.items():
        header[name] = {"dtype": kind, "shape": shape, "data_offsets": [begin, end]}
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def write_others():
    values = struct.pack("<6f", *range(6))
    seeds = {
        "safetensors/two": tensors(values, a=["F32", [2, 2], 0, 16], b=["F32", [2], 16, 24]),
        "safetensors/half": tensors(values, a=["F16", [2], 0, 4]),
        "safetensors/overlap": tensors(values, a=["F32", [6], 0, 24], b=["F32", [6], 0, 24]),
        "safetensors/two_lines": tensors(values, **{"a\nb": ["F16", [2], 0, 4]}),
        "safetensors/negative": tensors(values, a=["F32", [-1], 0, 4], b=["F32", [1e30], 0, 4]),
        "safetensors/empty": tensors(b"", a=["F32", [0, 3], 0, 0]),
        "poses/two.json": b'{"root_translation_m": [0, 0.02, 0], '
                          b'"joints": {"left_elbow": [0.92, 0, 0.39, 0], "neck": [0.2, 0, 0]}}',
        "poses/root.json": b'{"root_translation_m": [1e3, -2, 0.5]}',
        "poses/none.json": b'{"joints": {"nekc": [1, 0, 0, 0]}}'}
    # What a few bytes could make of memory and stack, and texts that are no type's.
    dtype = b"\x80\x04\x8c\x05numpy\x8c\x05dtype\x93"
    seeds |= {
        "camera_scale/doubled": b"\x80\x04)\x94" + b"".join(
            bytes([0x68, place, 0x68, place, 0x86, 0x94]) for place in range(60)) + b".",
        "camera_scale/nested": b"\x80\x04)" + 2000 * b"\x85" + b".",
        "camera_scale/order_alone": dtype + b"\x8c\x01<\x85R(K\x03\x8c\x01<tb.",
        "camera_scale/two_lines": b"\x80\x04\x8c\x15numpy.core.multiarray\x8c\x06scalar\x93" +
                                  dtype[2:] + b"\x8c\x04f\n\n9\x85R\x8c\x0812345678\x86R."}
    # Numbers as Python and NumPy pickle them: those of the reader's test.
    written = (FOLDER.parents[1] / "toolchain/dataset/pickled_numbers.inc").read_text()
    for name, lines in re.findall(r'\{"([^"]+)",((?:\s*"[0-9a-f]*")+)', written):
        if "as NumPy 1" in name:  # one other word
            continue
        file = re.sub(r"[^a-z0-9]+", "_", name.lower())
        seeds[f"camera_scale/{file}"] = bytes.fromhex("".join(re.findall("[0-9a-f]+", lines)))
    for name, data in seeds.items():
        (FOLDER / name).write_bytes(data)


def main(tool=None):
    write_others()
    rest = [f"f_rest_{k}" for k in range(9)]
    write("plain.ply", header("binary_little_endian", [vertex(PLAIN)]) + body(ROWS))
    write("double_big_endian.ply",
          header("binary_big_endian", [vertex(PLAIN, "double")],
                 ["SplatRenderMode: mip", "Vertical axis: 0 0 1"]) + body(ROWS, ">d"))
    write("degree_1.ply", header("binary_little_endian", [vertex(PLAIN + rest + ["filter_3D"])]) +
          body([row + [0.1 * k for k in range(9)] + [0.01] for row in ROWS]))
    text = "".join(" ".join(map(str, row)) + "\n" for row in ROWS)
    write("ascii.ply", header("ascii", [vertex(PLAIN)], ["antialiased 1"]) + text.encode())
    listed = vertex(PLAIN)[2]
    listed.insert(3, "list uchar int seen")
    rows = [body([row[:3]]) + bytes([2]) + bytes(8) + body([row[3:]]) for row in ROWS]
    write("list.ply", header("binary_little_endian",
                             [("camera", 1, ["list uchar float f"]), ("vertex", 2, listed),
                              ("face", 1, ["int i"])]) + b"\1" + bytes(4) + b"".join(rows) +
          bytes(4))
    write("discs.ply", header("ascii", [vertex([n for n in PLAIN if n != "scale_2"])]) +
          "".join(" ".join(map(str, row[:9] + row[10:])) + "\n" for row in ROWS).encode())
    chunk = [f"float {end}_{axis}" for part in ("", "scale_") for end in ("min", "max")
             for axis in (part + "x", part + "y", part + "z")]
    chunk += [f"float {end}_{c}" for end in ("min", "max") for c in "rgb"]
    packed = [f"uint packed_{name}" for name in ("position", "rotation", "scale", "color")]
    write("compressed.ply", header("binary_little_endian", [
        ("chunk", 1, chunk), ("vertex", 2, packed), ("sh", 2, [f"uchar {name}" for name in rest])
    ]) + body([[-1, -2, -3, 1, 2, 3, -5, -6, -7, -1, -2, -3, 0, 0, 0, 1, 1, 1]]) +
          struct.pack("<8I", *(i * 0x1F3D5B79 % 2**32 for i in range(8))) + bytes(range(18)))
    write("two.splat", b"".join(
        struct.pack("<6f8B", *row[:3], 0.1, 0.2, 0.3, 255, 0, 128, 200, 255, 128, 100, 90)
        for row in ROWS))
    for version in (1, 2, 3):
        write(f"bare_v{version}.spz", spz(version, version))
        write(f"v{version}.spz", gzip.compress(spz(version, version), mtime=0))
    if tool:
        subprocess.run([*shlex.split(tool), "-w", FOLDER / "ply/degree_1.ply",
                        FOLDER / "spz/v4.spz"],
                       check=True, capture_output=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
