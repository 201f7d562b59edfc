#!/usr/bin/env python3
"""Writes the inputs of the examples, each by its formula, with nothing but Python's standard library.

    python3 examples/inputs.py

scenes/edge.png                 a slanted edge of known blur
scenes/room.png, room.depth.png, room.camera.json
                                a picture with 16-bit depth in millimetres: balls on a checkered floor before a wall
scenes/slide.hdr, slide.bil     a stained slide as an ENVI cube of transmittances, 400 to 700 nm
sensors/mosaic16.ron            a mosaic of sixteen narrow filters
"""

import json
import math
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).parent


def png(path, columns, rows, bits, channels, samples):
    """Writes whole numbers, row by row, as a PNG."""
    code = ">" + {8: "B", 16: "H"}[bits] * (columns * channels)
    color = {1: 0, 3: 2}[channels]
    width = columns * channels
    lines = []
    for row in range(rows):
        line = struct.pack(code, *samples[row * width : (row + 1) * width])
        if bits == 16 or channels == 3:
            # Differences from the sample to the left pack better.
            step = channels * bits // 8
            line = b"\x01" + bytes((line[i] - (line[i - step] if i >= step else 0)) & 255 for i in range(len(line)))
        else:
            line = b"\x00" + line
        lines.append(line)
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", columns, rows, bits, color, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"".join(lines), 9)),
        (b"IEND", b""),
    ]
    data = b"\x89PNG\r\n\x1a\n"
    for name, body in chunks:
        data += struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    (HERE / path).write_bytes(data)


def srgb(light):
    """The code of sRGB, 0 to 1, of linear light."""
    light = min(max(light, 0.0), 1.0)
    return 12.92 * light if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055


def noise(x, y, seed):
    """Smooth noise, 0 to 1: random numbers at whole places, blended."""

    def at(i, j):
        n = (i * 374761393 + j * 668265263 + seed * 2147483647) & 0xFFFFFFFF
        n = ((n ^ (n >> 13)) * 1274126177) & 0xFFFFFFFF
        return ((n ^ (n >> 16)) & 0xFFFF) / 65535

    i, j = math.floor(x), math.floor(y)
    u, v = (t * t * (3 - 2 * t) for t in (x - i, y - j))
    above = at(i, j) * (1 - u) + at(i + 1, j) * u
    below = at(i, j + 1) * (1 - u) + at(i + 1, j + 1) * u
    return above * (1 - v) + below * v


def edge():
    """An edge 5 degrees from upright, blurred by a Gaussian of 0.8 pixels: its SFR is exp(-2 (pi f 0.8)^2)."""
    n, sigma_px, angle = 160, 0.8, math.radians(5)
    codes = []
    for row in range(n):
        for column in range(n):
            across_px = (column - n / 2 + 0.5) * math.cos(angle) + (row - n / 2 + 0.5) * math.sin(angle)
            light = 0.05 + 0.8 * 0.5 * (1 + math.erf(across_px / (math.sqrt(2) * sigma_px)))
            codes.append(round(65535 * light))
    png("scenes/edge.png", n, n, 16, 1, codes)


def room():
    """Balls on a checkered floor before a wall, lit from the left above, by a pinhole 1 m above the floor that looks 9 degrees down."""
    columns, rows, focal_px = 360, 240, 560.0
    down = math.radians(9)
    # center x, y, z (m; y up, z ahead), radius, reflectance in red, green and blue
    balls = [
        (-0.42, -0.72, 2.50, 0.28, (0.62, 0.10, 0.08)),
        (0.36, -0.78, 2.85, 0.22, (0.10, 0.28, 0.60)),
        (0.05, -0.87, 2.60, 0.13, (0.70, 0.55, 0.08)),
        (0.98, -0.60, 4.10, 0.40, (0.12, 0.42, 0.16)),
        (-0.85, -0.65, 4.30, 0.35, (0.60, 0.60, 0.58)),
    ]
    light = (-0.48, 0.75, -0.46)
    dot = lambda a, b: sum(p * q for p, q in zip(a, b))

    def hit(origin, ray):
        """The nearest thing along a ray: how far, its normal, its reflectance."""
        best = (float("inf"), None, None)
        for x, y, z, radius, color in balls:
            away = (origin[0] - x, origin[1] - y, origin[2] - z)
            a, b, c = dot(ray, ray), dot(away, ray), dot(away, away) - radius * radius
            root = b * b - a * c
            t = (-b - math.sqrt(root)) / a if root > 0 else -1
            if 1e-6 < t < best[0]:
                place = [o + t * r for o, r in zip(origin, ray)]
                best = (t, tuple((p - q) / radius for p, q in zip(place, (x, y, z))), color)
        if ray[1] < 0:
            t = (-1.0 - origin[1]) / ray[1]
            if 1e-6 < t < best[0]:
                x, z = origin[0] + t * ray[0], origin[2] + t * ray[2]
                dark = (math.floor(x / 0.25) + math.floor(z / 0.25)) % 2
                best = (t, (0.0, 1.0, 0.0), (0.12, 0.09, 0.07) if dark else (0.60, 0.52, 0.42))
        if ray[2] > 0:
            t = (5.5 - origin[2]) / ray[2]
            if 1e-6 < t < best[0]:
                x, y = origin[0] + t * ray[0], origin[1] + t * ray[1]
                stripe = 0.5 + 0.5 * math.tanh(8 * math.sin(2 * math.pi * x / 0.8))
                best = (t, (0.0, 0.0, -1.0), (0.40 + 0.12 * stripe, 0.42 + 0.05 * stripe, 0.36 - 0.04 * stripe))
        return best

    codes, depths = [], []
    for row in range(rows):
        for column in range(columns):
            total, depth = [0.0, 0.0, 0.0], None
            for dy, dx in ((-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25), (0, 0)):
                right, up = (column + dx - (columns - 1) / 2) / focal_px, ((rows - 1) / 2 - row - dy) / focal_px
                ray = (right, up * math.cos(down) - math.sin(down), math.cos(down) + up * math.sin(down))
                t, normal, color = hit((0.0, 0.0, 0.0), ray)
                if (dy, dx) == (0, 0):
                    # The part of the ray along the axis is 1, so t is the depth.
                    depth = t
                    continue
                place = tuple(t * r + 1e-4 * n for r, n in zip(ray, normal))
                sun = max(dot(normal, light), 0.0) if hit(place, light)[1] in (None, (0.0, 0.0, -1.0)) else 0.0
                sky = 0.22 + 0.13 * normal[1]
                for i in range(3):
                    total[i] += 0.25 * color[i] * (1.25 * sun + sky)
            codes += [round(255 * srgb(v)) for v in total]
            depths.append(round(1000 * depth))
    png("scenes/room.png", columns, rows, 8, 3, codes)
    png("scenes/room.depth.png", columns, rows, 16, 1, depths)
    camera = {
        "width": columns,
        "height": rows,
        "fx_px": focal_px,
        "fy_px": focal_px,
        "cx_px": (columns - 1) / 2,
        "cy_px": (rows - 1) / 2,
        "depth_unit_m": 0.001,
        "source": "examples/inputs.py",
    }
    (HERE / "scenes/room.camera.json").write_text(json.dumps(camera, indent=2) + "\n")


def slide():
    """Tissue between cover glasses, stained with two dyes: transmittance 10^-(a(nm) A + b(nm) B), by Beer and Lambert.

    The absorbance of each dye is a sum of Gaussians near those of hematoxylin (broad, about 590 nm) and eosin (narrow, 525 nm).
    """
    n = 192
    bands_nm = list(range(400, 701, 20))
    gauss = lambda nm, center, width: math.exp(-0.5 * ((nm - center) / width) ** 2)
    blue = [0.85 * gauss(nm, 585, 62) + 0.30 * gauss(nm, 430, 40) for nm in bands_nm]
    pink = [0.95 * gauss(nm, 525, 20) + 0.25 * gauss(nm, 492, 22) for nm in bands_nm]
    spacing = 16.0
    cells = {}
    for i in range(-2, 15):
        for j in range(-2, 15):
            x = (i + 0.5 + 0.7 * (noise(1.7 * i, 1.7 * j, 1) - 0.5) + 0.35 * (j % 2)) * spacing
            y = (j + 0.5 + 0.7 * (noise(1.7 * i, 1.7 * j, 2) - 0.5)) * spacing
            turn, long = math.pi * noise(2.3 * i, 2.3 * j, 3), 3.2 + 1.8 * noise(2.3 * i, 2.3 * j, 4)
            cells[i, j] = (x, y, math.cos(turn), math.sin(turn), long, 2.2 + noise(1.9 * i, 1.9 * j, 5))
    amounts = []
    for row in range(n):
        for column in range(n):
            near = []
            for (x, y, c, s, long, short) in (
                cells[i, j]
                for i in range(int(column / spacing) - 1, int(column / spacing) + 2)
                for j in range(int(row / spacing) - 1, int(row / spacing) + 2)
            ):
                u, v = (column - x) * c + (row - y) * s, (row - y) * c - (column - x) * s
                near.append((math.hypot(u, v), math.hypot(u / long, v / short)))
            near.sort()
            wall = 1 / (1 + math.exp((near[1][0] - near[0][0] - 1.2) / 0.35))
            nucleus = max(1 / (1 + math.exp((inside - 1) / 0.09)) for _, inside in near)
            grain = noise(column / 1.7, row / 1.7, 7)
            cloud = noise(column / 23, row / 23, 8)
            # A vessel without tissue.
            vessel = math.hypot((column - 138) / 34, (row - 66) / 20) + 0.25 * (noise(column / 9, row / 9, 9) - 0.5)
            tissue = 1 / (1 + math.exp((1 - vessel) / 0.03))
            a = tissue * (1.15 * nucleus * (0.75 + 0.5 * grain) + 0.06 * cloud)
            b = tissue * (0.22 + 0.30 * cloud + 0.55 * wall + 0.10 * grain) * (1 - 0.5 * nucleus)
            amounts.append((a, b))
    white = 250
    lines = bytearray()
    for row in range(n):
        line = amounts[row * n : (row + 1) * n]
        for dyes in zip(blue, pink):
            lines += bytes(round(0.92 * white * 10 ** -(dyes[0] * a + dyes[1] * b)) for a, b in line)
    (HERE / "scenes/slide.bil").write_bytes(lines)
    header = [
        "ENVI",
        "description = { Stained tissue by formula (examples/inputs.py): transmittance }",
        f"samples = {n}",
        f"lines = {n}",
        f"bands = {len(bands_nm)}",
        "header offset = 0",
        "file type = ENVI Standard",
        "data type = 1",
        "interleave = bil",
        "byte order = 0",
        f"reflectance scale factor = {white}",
        "wavelength units = nm",
        "wavelength = { " + ", ".join(map(str, bands_nm)) + " }",
    ]
    (HERE / "scenes/slide.hdr").write_text("\n".join(header) + "\n")


def mosaic16():
    """Sixteen Gaussian filters of 18 nm (full width at half maximum) on a silicon pixel, 430 to 685 nm."""
    silicon = [(400, 0.48), (450, 0.60), (500, 0.66), (550, 0.66), (600, 0.62), (650, 0.55), (700, 0.46), (740, 0.39)]

    def quantum_efficiency(nm):
        for (a, p), (b, q) in zip(silicon, silicon[1:]):
            if a <= nm <= b:
                return p + (q - p) * (nm - a) / (b - a)

    # Neighbors in the mosaic are far apart in the spectrum.
    order = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5]
    centers_nm = [430 + 17 * i for i in range(16)]
    names = [f"{nm} nm" for nm in centers_nm]
    tile = ",\n        ".join("[" + ", ".join(f'"{names[i]}"' for i in order[4 * r : 4 * r + 4]) + "]" for r in range(4))
    filters = []
    for name, center_nm in zip(names, centers_nm):
        table = [nm for nm in range(400, 741, 5) if abs(nm - center_nm) <= 30]
        values = [0.85 * quantum_efficiency(nm) * math.exp(-4 * math.log(2) * ((nm - center_nm) / 18) ** 2) for nm in table]
        numbers = lambda list, form: "[" + ", ".join(format(v, form) for v in list) + "]"
        filters.append(
            f'        (name: "{name}", quantum_efficiency: (\n'
            f"            wavelengths_nm: {numbers(table, '.1f')},\n"
            f"            values: {numbers(values, '.4f')},\n        )),"
        )
    text = f"""// A multispectral mosaic: sixteen narrow filters in tiles of 4 by 4. Written by examples/inputs.py.
(
    name: "16-band mosaic",
    source: "Gaussian filters of 18 nm (full width at half maximum) over a silicon pixel; round numbers, no particular camera",
    rows: 1024,
    columns: 1280,
    pixel_pitch_um: 5.5,
    fill_factor: 1.0,
    cfa: Mosaic([
        {tile},
    ]),
    filters: [
{chr(10).join(filters)}
    ],
    conversion_gain_v_per_e: 8.0e-5,
    full_well_e: 13000.0,
    swing_v: 1.04,
    read_noise_v: 1.0e-3,
    prnu_fraction: 0.005,
    adc: Bits(bits: 10, black_level_dn: 32),
)
"""
    (HERE / "sensors/mosaic16.ron").write_text(text)


if __name__ == "__main__":
    for write in (edge, room, slide, mosaic16):
        write()
