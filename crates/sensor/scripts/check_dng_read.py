"""Holds reading of DNG files to independent codecs.

Raw frames of the program are rewritten with the lossless JPEG encoder of imagecodecs (liblj92), in tiles, and as
10, 12 and 14 packed bits; LibRaw (rawpy) reads each file, and `dioptric develop` must make the same picture of it as of the
plain one.

    pip install numpy rawpy imagecodecs
    python crates/sensor/scripts/check_dng_read.py target/debug/dioptric
"""

import json
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import imagecodecs
import numpy as np
import rawpy

SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 10: 8, 12: 8}
TILE = 128


def fields_of(data, place):
    """Returns tag → (type, bytes) of a little-endian directory."""
    (n,) = struct.unpack_from("<H", data, place)
    fields = {}
    for i in range(n):
        tag, kind, count = struct.unpack_from("<HHI", data, place + 2 + 12 * i)
        size = SIZES[kind] * count
        at = place + 2 + 12 * i + 8
        if size > 4:
            (at,) = struct.unpack_from("<I", data, at)
        fields[tag] = (kind, data[at : at + size])
    return fields


def write(fields, blocks, tags):
    """Returns a TIFF file of one directory whose samples are these blocks."""
    out = bytearray(b"II*\0\0\0\0\0")
    places = []
    for block in blocks:
        places.append(len(out))
        out += block + b"\0" * (len(block) % 2)
    fields = dict(fields)
    fields[tags[0]] = (4, struct.pack(f"<{len(places)}I", *places))
    fields[tags[1]] = (4, struct.pack(f"<{len(places)}I", *map(len, blocks)))
    table = bytearray(struct.pack("<H", len(fields)))
    for tag in sorted(fields):
        kind, value = fields[tag]
        table += struct.pack("<HHI", tag, kind, len(value) // SIZES[kind])
        if len(value) <= 4:
            table += value.ljust(4, b"\0")
        else:
            table += struct.pack("<I", len(out))
            out += value + b"\0" * (len(value) % 2)
    struct.pack_into("<I", out, 4, len(out))
    return bytes(out + table + b"\0\0\0\0")


def packed(row, bits):
    """Returns codes as bits one after the other, the highest first."""
    shifts = np.arange(bits - 1, -1, -1, dtype=np.uint16)
    return np.packbits((row[:, None] >> shifts & 1).astype(np.uint8).ravel()).tobytes()


def variants(data):
    """Yields a name and a file for each way to store the frame of a file of the program."""
    (first,) = struct.unpack_from("<I", data, 4)
    top = fields_of(data, first)
    (frame,) = struct.unpack("<I", top[330][1]) if 330 in top else (first,)
    raw = fields_of(data, frame)
    number = lambda tag: int.from_bytes(raw[tag][1][:4], "little")
    columns, rows, place = number(256), number(257), number(273)
    codes = np.frombuffer(data, "<u2", rows * columns, place).reshape(rows, columns)
    camera = {tag: value for tag, value in top.items() if tag >= 50706 or tag in (271, 272, 274)}
    plain = {**camera, **{tag: value for tag, value in raw.items() if tag not in (273, 278, 279)}}
    bits = int(codes.max()).bit_length()
    yield "plain", codes, write({**plain, 278: (4, struct.pack("<I", rows))}, [codes.tobytes()], (273, 279))
    for depth in (n for n in (10, 12, 14) if n >= bits):
        fields = {**plain, 258: (3, struct.pack("<H", depth)), 278: (4, struct.pack("<I", 64))}
        strips = [b"".join(packed(row, depth) for row in codes[i : i + 64]) for i in range(0, rows, 64)]
        yield f"{depth} packed bits", codes, write(fields, strips, (273, 279))
    tiles = []
    for y in range(0, rows, TILE):
        for x in range(0, columns, TILE):
            tile = codes[y : y + TILE, x : x + TILE]
            tile = np.pad(tile, ((0, TILE - tile.shape[0]), (0, TILE - tile.shape[1])), "edge")
            tiles.append(imagecodecs.ljpeg_encode(tile, bitspersample=16))
    size = {322: (4, struct.pack("<I", TILE)), 323: (4, struct.pack("<I", TILE))}
    yield "tiles of lossless JPEG", codes, write({**plain, **size, 259: (3, struct.pack("<H", 7))}, tiles, (324, 325))


def main(program):
    folder = Path(tempfile.mkdtemp())
    run = lambda *line: subprocess.run([program, *map(str, line)], check=True, capture_output=True, text=True).stdout
    run("run", "--quality", "preview", "--sensor", "imx363", "--also", "raw-dng", "--out", folder / "run", "--quiet")
    data = (folder / "run/raw.dng").read_bytes()
    first = None
    for name, codes, file in variants(data):
        path = folder / "x.dng"
        path.write_bytes(file)
        with rawpy.imread(str(path)) as raw:
            libraw = np.array_equal(raw.raw_image, codes)
        report = json.loads(run("develop", path, "--out", folder / "out", "--json"))
        picture = (folder / "out/picture.png").read_bytes()
        first = first or picture
        print(f"{name}: {len(file)} bytes, {report['bits']} bits, LibRaw's codes {'equal' if libraw else 'differ'}, picture "
              f"{'equal' if picture == first else 'differs'}")


main(sys.argv[1])
