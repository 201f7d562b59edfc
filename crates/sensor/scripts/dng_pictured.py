"""Writes the DNG files of tests/dng: tiles as JPEG XL by libjxl and as JPEG by libjpeg-turbo, of codes that a formula gives.

    pip install numpy imagecodecs
    python crates/sensor/scripts/dng_pictured.py crates/sensor/tests/dng
"""

import struct
import sys

import imagecodecs
import numpy as np

ROWS, COLUMNS, TILE = 30, 44, (16, 24)
SHORT, LONG, BYTE, TEXT, FRACTION, SIGNED_FRACTION = 3, 4, 1, 2, 5, 10


def packed(kind, values):
    if kind == TEXT:
        return values.encode() + b"\0"
    if kind in (FRACTION, SIGNED_FRACTION):
        return b"".join(struct.pack("<ii", *pair) for pair in values)
    return struct.pack(f"<{len(values)}{ {SHORT: 'H', LONG: 'I', BYTE: 'B'}[kind]}", *values)


def write(path, fields, blocks):
    """A little-endian TIFF file of one directory behind its blocks."""
    data = bytearray(b"II*\0\0\0\0\0")
    places = []
    for block in blocks:
        data += b"\0" * (len(data) % 2)
        places.append(len(data))
        data += block
    fields = {**fields, 324: (LONG, places), 325: (LONG, [len(block) for block in blocks])}
    entries = b""
    for tag, (kind, values) in sorted(fields.items()):
        content = packed(kind, values)
        count = len(content) if kind in (TEXT, BYTE) else len(values)
        if len(content) > 4:
            data += b"\0" * (len(data) % 2)
            content, place = struct.pack("<I", len(data)), content
            data += place
        entries += struct.pack("<HHI", tag, kind, count) + content.ljust(4, b"\0")
    data += b"\0" * (len(data) % 2)
    data[4:8] = struct.pack("<I", len(data))
    data += struct.pack("<H", len(fields)) + entries + b"\0\0\0\0"
    with open(path, "wb") as file:
        file.write(data)


def dng(name, image, compression, encode, bits, is_float=False, extra=None):
    n = image.shape[2] if image.ndim == 3 else 1
    fields = {
        254: (LONG, [0]), 256: (LONG, [COLUMNS]), 257: (LONG, [ROWS]), 258: (SHORT, [bits] * n),
        259: (SHORT, [compression]), 262: (SHORT, [34892 if n == 3 else 32803]), 271: (TEXT, "Maker"),
        272: (TEXT, "Model"), 277: (SHORT, [n]), 284: (SHORT, [1]), 322: (LONG, [TILE[1]]), 323: (LONG, [TILE[0]]),
        339: (SHORT, [3 if is_float else 1] * n), 50706: (BYTE, [1, 7, 1, 0]), 50707: (BYTE, [1, 7, 0, 0]),
        50721: (SIGNED_FRACTION, [(int(i % 4 == 0), 1) for i in range(9)]), 50778: (SHORT, [21]),
        50728: (FRACTION, [(1, 1)] * 3),
    }
    if n == 1:
        fields |= {33421: (SHORT, [2, 2]), 33422: (BYTE, [0, 1, 1, 2])}
    blocks = []
    for row in range(0, ROWS, TILE[0]):
        for column in range(0, COLUMNS, TILE[1]):
            tile = image[row : row + TILE[0], column : column + TILE[1]]
            pad = [(0, TILE[0] - tile.shape[0]), (0, TILE[1] - tile.shape[1])] + [(0, 0)] * (image.ndim - 2)
            blocks.append(bytes(encode(np.ascontiguousarray(np.pad(tile, pad, mode="edge")))))
    write(f"{sys.argv[1]}/{name}.dng", fields | (extra or {}), blocks)


def fields_of(image):
    """The even rows above the odd ones, the even columns before the odd ones."""
    return np.concatenate([np.concatenate([image[i::2, j::2] for j in (0, 1)], 1) for i in (0, 1)], 0)


row, column = np.mgrid[0:ROWS, 0:COLUMNS]
uneven = ((row * 977 + column * 701 + (row * column * 37) % 251 * 50) % 65536).astype(np.uint16)
smooth = np.stack([10000 + 300 * row + 400 * column, 20000 + 500 * column, 40000 - 700 * row], 2).astype(np.uint16)
lossless = lambda tile: imagecodecs.jpegxl_encode(tile, lossless=True)
jpeg = lambda tile: imagecodecs.jpeg8_encode(tile, level=97)
jpeg_rgb = lambda tile: imagecodecs.jpeg8_encode(tile, level=97, colorspace="RGB", outcolorspace="RGB")
dng("mosaic", fields_of(uneven), 52546, lossless, 16, extra={50975: (SHORT, [2]), 52547: (SHORT, [2])})
dng("mosaic-10", uneven >> 6, 52546, lambda tile: imagecodecs.jpegxl_encode(tile, lossless=True, bitspersample=10), 10)
dng("planes", smooth, 52546, lambda tile: imagecodecs.jpegxl_encode(tile, distance=0.2), 16)
dng("planes-half", (smooth / 65535).astype(np.float16), 52546, lossless, 16, is_float=True)
dng("planes-jpeg", (smooth >> 8).astype(np.uint8), 34892, jpeg, 8)
dng("planes-jpeg-rgb", (smooth >> 8).astype(np.uint8), 34892, jpeg_rgb, 8)
dng("mosaic-jpeg", (smooth[:, :, 0] >> 8).astype(np.uint8), 34892, jpeg, 8)
