#!/usr/bin/env python3
"""Renders every world under some folders small, and makes one sheet of them: how files as people have them come out.

    scripts/worlds.py PROGRAM OUT FOLDER... [--truth truth.csv] [--without FOLDER...]

Each file is read by `PROGRAM world info --json` and rendered by `PROGRAM render --frame --sky day`. OUT gets `sheet.png`,
`list.csv` (file, verdict, what was said) and, with `--truth`, `differences.csv`: files whose extent differs from that of an
independent reader (columns file, read_by_trimesh, triangles, area, min_x … max_z). Files that are in a folder of `--without`
too, by their bytes, and second copies are passed over.

Nothing but Python's own library is needed. To get files, any packages that bring some do, for instance:

    apt-get download assimp-testmodels openscad-testing-data prusa-slicer    # 187: glTF, OBJ, PLY, STL (dpkg-deb -x)
    npm pack @webxr-input-profiles/assets                # 82: GLB
    pip download --no-deps compas dm_control pyvista     # 214: OBJ, PLY, STL (python -m zipfile -e)
    pip download --no-deps --no-binary :all: trimesh     # models/
"""

import argparse
import csv
import hashlib
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

KINDS = {".pbrt", ".gltf", ".glb", ".obj", ".ply", ".stl"}
SIZE = (160, 120)
COLUMNS = 12
SECONDS = 60


def read_png(path):
    """Returns the rows of an 8-bit RGB picture."""
    data = path.read_bytes()
    place, packed = 8, b""
    while place < len(data):
        length, kind = struct.unpack(">I4s", data[place : place + 8])
        body = data[place + 8 : place + 8 + length]
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", body[:10])
        if kind == b"IDAT":
            packed += body
        place += 12 + length
    if depth != 8 or color not in (2, 6):
        raise ValueError(f"{path}: expected 8 bits of RGB")
    step = 3 if color == 2 else 4
    raw, rows, above = zlib.decompress(packed), [], bytearray(width * step)
    for row in range(height):
        begin = row * (width * step + 1)
        kind, line = raw[begin], bytearray(raw[begin + 1 : begin + 1 + width * step])
        for i in range(len(line)):
            left = line[i - step] if i >= step else 0
            corner = above[i - step] if i >= step else 0
            if kind == 1:
                line[i] = (line[i] + left) & 255
            elif kind == 2:
                line[i] = (line[i] + above[i]) & 255
            elif kind == 3:
                line[i] = (line[i] + (left + above[i]) // 2) & 255
            elif kind == 4:
                p = left + above[i] - corner
                near = min((abs(p - left), 0, left), (abs(p - above[i]), 1, above[i]), (abs(p - corner), 2, corner))
                line[i] = (line[i] + near[2]) & 255
        rows.append(bytes(b for x in range(width) for b in line[x * step : x * step + 3]))
        above = line
    return rows


def write_png(path, rows):
    width = len(rows[0]) // 3
    packed = zlib.compress(b"".join(b"\0" + row for row in rows), 6)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, len(rows), 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b""))


def run(words):
    """Returns the status, the output and the last line of what was said."""
    try:
        done = subprocess.run(words, capture_output=True, text=True, errors="replace", timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return "slow", "", f"more than {SECONDS} s"
    said = [line for line in done.stderr.splitlines() if line.strip()]
    return done.returncode, done.stdout, " | ".join(said[-6:])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("folders", nargs="+", type=pathlib.Path)
    parser.add_argument("--truth", type=pathlib.Path)
    parser.add_argument("--without", nargs="+", type=pathlib.Path, default=[])
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)

    def worlds(folders):
        found = sorted(path for folder in folders for path in folder.rglob("*") if path.suffix.lower() in KINDS)
        return {hashlib.sha256(path.read_bytes()).digest(): path for path in reversed(found)}

    held = worlds(words.without)
    files = sorted(path for digest, path in worlds(words.folders).items() if digest not in held)
    truth = {}
    if words.truth:
        truth = {row["file"]: row for row in csv.DictReader(words.truth.open())}
    cells, table, differences = [], [], []
    for number, path in enumerate(files):
        status, text, said = run([words.program, "world", "info", str(path), "--json"])
        verdict, cell = "refused", None
        if status == 0:
            info = json.loads(text)
            said = " | ".join(info["notes"])
            known = truth.get(str(path.relative_to(words.truth.parent))) if words.truth else None
            if known and known["min_x"] and info["bounds_m"]:
                expected = [float(known[k]) for k in ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")]
                found = info["bounds_m"][0] + info["bounds_m"][1]
                size = max(expected[k + 3] - expected[k] for k in range(3)) or 1.0
                if max(abs(a - b) for a, b in zip(expected, found)) > 1e-3 * size:
                    differences.append([str(path), expected, found])
            with tempfile.TemporaryDirectory() as folder:
                size = f"{SIZE[0]}x{SIZE[1]}"
                asked = ["--frame", "--sky", "day", "--pixels", size, "--samples", "16", "--bounces", "4"]
                status, _, more = run([words.program, "render", str(path), "-o", folder, "--quiet", *asked])
                verdict = {0: "rendered", "slow": "slow"}.get(status, "failed")
                if status == 0:
                    cell = read_png(pathlib.Path(folder) / "picture.png")
                else:
                    said += " | " + more
        elif status not in (1, 2, "slow"):
            verdict = "crashed"
        table.append([str(path), verdict, said])
        cells.append(cell or [bytes((60, 0, 0)) * SIZE[0]] * SIZE[1])
        print(f"{number + 1}/{len(files)} {verdict:9} {path} {said[:160]}", file=sys.stderr, flush=True)
    rows = []
    for first in range(0, len(cells), COLUMNS):
        line = cells[first : first + COLUMNS]
        line += [[bytes(3 * SIZE[0])] * SIZE[1]] * (COLUMNS - len(line))
        rows += [b"".join(cell[row] for cell in line) for row in range(SIZE[1])]
    if rows:
        write_png(words.out / "sheet.png", rows)
    csv.writer((words.out / "list.csv").open("w", newline="")).writerows([["file", "verdict", "said"], *table])
    csv.writer((words.out / "differences.csv").open("w", newline="")).writerows([["file", "truth", "ours"], *differences])
    verdicts = [row[1] for row in table]
    for kind in sorted(set(verdicts)):
        print(f"{kind}: {verdicts.count(kind)}")
    print(f"extent differs: {len(differences)}")


if __name__ == "__main__":
    main()
