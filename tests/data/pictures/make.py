#!/usr/bin/env python3
"""Makes the PNG files of this folder, and those with EXIF from plain.jpg; nothing but Python.

plain.jpg, grey.jpg and cmyk.jpg, 32x16, were written by libjpeg at quality 95 without subsampling.
plain.jpg: red over dark in the left half, green over yellow in the right one.
"""
import pathlib
import struct
import zlib

HERE = pathlib.Path(__file__).resolve().parent
WIDTH, HEIGHT = 32, 16


def chunk(name, data):
    body = name + data
    return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))


def png(name, depth, kind, rows, extra=b""):
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, depth, kind, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + row for row in rows), 9)
    (HERE / name).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + extra
                              + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def rows_of(value):
    return [b"".join(value(x, y) for x in range(WIDTH)) for y in range(HEIGHT)]


def with_exif(name, orientation, big_endian):
    order = ">" if big_endian else "<"
    tiff = (b"MM" if big_endian else b"II") + struct.pack(order + "HIH", 42, 8, 2)
    tiff += struct.pack(order + "HHII", 0x0100, 4, 1, WIDTH)
    tiff += struct.pack(order + "HHIHH", 0x0112, 3, 1, orientation, 0) + bytes(4)
    segment = b"Exif\0\0" + tiff
    plain = (HERE / "plain.jpg").read_bytes()
    (HERE / name).write_bytes(plain[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2)
                              + segment + plain[2:])


def inside(x):
    return x < WIDTH // 2


png("colour.png", 8, 2, rows_of(lambda x, y: bytes([200, 100, 4 * y])))
png("colour16.png", 16, 2, rows_of(lambda x, y: struct.pack(">HHH", 0x8000, 0x4000, 0xffff)))
png("palette_colour.png", 8, 3, rows_of(lambda x, y: bytes([inside(x)])),
    chunk(b"PLTE", bytes([10, 20, 30, 200, 100, 50])))
png("mask.png", 8, 0, rows_of(lambda x, y: bytes([255 * inside(x)])))
png("mask1.png", 1, 0, rows_of(lambda x, y: b"")[:0] + [b"\xff\xff\0\0"] * HEIGHT)
png("mask16.png", 16, 0, rows_of(lambda x, y: struct.pack(">H", 0x8000 if inside(x) else 0)))
png("mask_palette.png", 8, 3, rows_of(lambda x, y: bytes([inside(x)])),
    chunk(b"PLTE", bytes([0, 0, 0, 128, 0, 0, 0, 128, 0])))
png("mask_two_people.png", 8, 3, rows_of(lambda x, y: bytes([1 + (y < 8) if inside(x) else 0])),
    chunk(b"PLTE", bytes([0, 0, 0, 128, 0, 0, 0, 128, 0])))
png("mask_labels.png", 8, 0, rows_of(lambda x, y: bytes([inside(x)])))
png("mask_dim.png", 8, 0, rows_of(lambda x, y: bytes([38 * inside(x)])))
png("mask_rgb.png", 8, 2, rows_of(lambda x, y: bytes([255 * inside(x)] * 3)))
png("cutout.png", 8, 6, rows_of(lambda x, y: bytes([90, 60, 30, 255 * inside(x)])))
for turn in range(1, 9):
    with_exif(f"exif{turn}.jpg", turn, turn % 2 == 0)
