"""Counts rays through pixels in numpy and compares the share that reaches the photodiode with that of dioptric, whose closed forms count
none: through bare openings, real spherical microlenses, and thin ones that keep the sine condition.

    pip install numpy
    python crates/sensor/scripts/check_pixel_optics.py target/debug/dioptric > crates/sensor/scripts/check_pixel_optics.txt

The pixels are those of examples/sensors/pixel-stack.ron with other stacks. Rays come from points spread evenly over a flat exit pupil, each
weighted by cos^4, and fall on points spread evenly over the opening, those of a sphere weighted by the light that it catches there.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
SHEET = ROOT / "examples/sensors/pixel-stack.ron"
PITCH_UM = 1.4
RAYS = 2_000_000
LAYERS = [(0.9, 1.6), (0.7, 1.6), (0.4, 1.46)]
DEEP = [(0.9, 1.6), (0.7, 1.6), (2.6, 1.46)]
# What it is, microlens, layers, side of the photodiode in µm, distance of the exit pupil for which lenses are shifted in mm.
PIXELS = [
    ("bare, 2 µm deep", None, LAYERS, 0.9, None),
    ("bare, 4.2 µm deep", None, DEEP, 0.9, None),
    ("sphere, R 1.2", ("RadiusUm", 1.2), LAYERS, 0.9, None),
    ("sphere, R 1.2, shifted", ("RadiusUm", 1.2), LAYERS, 0.9, 6.0),
    ("sphere, R 2, deep", ("RadiusUm", 2.0), DEEP, 0.9, None),
    ("sphere, R 2, shifted", ("RadiusUm", 2.0), DEEP, 0.9, 6.0),
    ("thin, f 2", ("FocalLengthUm", 2.0), LAYERS, 0.9, None),
    ("thin, f 2.5, shifted", ("FocalLengthUm", 2.5), DEEP, 0.9, 6.0),
]
PUPIL_MM = 6.0
F_NUMBERS = [1.4, 2.0, 4.0]
HEIGHTS_MM = [0.0, 1.5, 3.0]
TOWARD = np.array([4032, 3024]) / np.hypot(4032, 3024)


def dioptric(program, lens, layers, photodiode_um, shift_mm):
    """Returns the shares of dioptric by f-number and height."""
    shift = "None" if shift_mm is None else f"ExitPupilMm({shift_mm})"
    stack = "pixel_stack: (photodiode_um: {}, layers: [{}], {}),\n)\n".format(
        photodiode_um,
        ", ".join(f"(thickness_um: {t}, index: {n})" for t, n in layers),
        f"microlens: (power: {lens[0]}({lens[1]}), shift: {shift})" if lens else "microlens: None",
    )
    sheet = re.sub(r"pixel_stack: .*", lambda _: stack, SHEET.read_text(encoding="utf-8"), flags=re.S)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sensor.ron"
        path.write_text(sheet, encoding="utf-8")
        text = lambda numbers: ",".join(map(str, numbers))
        options = ["--exit-pupil-mm", str(PUPIL_MM), "--f-numbers", text(F_NUMBERS), "--heights-mm", text(HEIGHTS_MM)]
        out = subprocess.run([program, "sensor", "optics", path, "--json", *options], check=True, capture_output=True)
    return np.array([row["share"] for row in json.loads(out.stdout)]).reshape(len(F_NUMBERS), len(HEIGHTS_MM))


def fall(place, direction, layers):
    """Takes rays of unit directions in air down through layers (thickness, index) and returns where they land."""
    for thickness, index in layers:
        inside = direction[:, :2] / index
        down = np.sqrt(1 - np.sum(inside**2, axis=1))
        place = place + thickness * inside / down[:, None]
    return place


def counted(random, lens, layers, photodiode_um, shift_mm, f_number, height_mm):
    """Returns the share of counted rays."""
    angle, radius = 2 * np.pi * random.random(RAYS), np.sqrt(random.random(RAYS))
    pupil = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    slope = height_mm / PUPIL_MM * TOWARD - pupil / np.sqrt(4 * f_number**2 - 1)
    direction = np.column_stack([slope, np.ones(RAYS)])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    weight = direction[:, 2] ** 4
    point = PITCH_UM * (random.random((RAYS, 2)) - 0.5)
    shift = np.zeros(2)
    if shift_mm is not None:
        chief = np.append(height_mm / shift_mm * TOWARD, 1)
        shift = -fall(np.zeros((1, 2)), (chief / np.linalg.norm(chief))[None], layers)[0]

    def share(landing, weight):
        hit = np.all(np.abs(landing + shift) <= photodiode_um / 2, axis=1)
        return np.sum(weight * hit) / np.sum(weight)

    if lens is None:
        return share(fall(point, direction, layers), weight)
    if lens[0] == "FocalLengthUm":
        # A thin lens changes direction cosines in proportion to the place.
        return share(fall(point, direction - np.column_stack([point, np.zeros(RAYS)]) / lens[1], layers), weight)
    # A sphere whose vertex is at the top; what is cut from the first layer is its sag.
    radius_um, (thickness, index) = lens[1], layers[0]
    root = np.sqrt(radius_um**2 - np.sum(point**2, axis=1))
    normal = np.column_stack([-point, root]) / radius_um
    cosine = np.sum(normal * direction, axis=1)
    ratio = 1 / index
    inside = ratio * direction + (np.sqrt(1 - ratio**2 * (1 - cosine**2)) - ratio * cosine)[:, None] * normal
    start = point + (thickness - radius_um + root)[:, None] * inside[:, :2] / inside[:, 2:]
    caught = weight * np.maximum(cosine, 0) / (normal[:, 2] * direction[:, 2])
    return share(fall(start, index * inside, layers[1:]), caught)


def main():
    program = sys.argv[1]
    random = np.random.default_rng(1)
    print(f"{'pixel':<24}{'f-number':>9}{'height mm':>11}{'dioptric':>10}{'counted':>10}")
    differences = []
    for name, lens, layers, photodiode_um, shift_mm in PIXELS:
        found = dioptric(program, lens, layers, photodiode_um, shift_mm)
        for i, f_number in enumerate(F_NUMBERS):
            for j, height_mm in enumerate(HEIGHTS_MM):
                share = counted(random, lens, layers, photodiode_um, shift_mm, f_number, height_mm)
                differences.append(found[i, j] - share)
                print(f"{name:<24}{f_number:>9}{height_mm:>11}{found[i, j]:>10.4f}{share:>10.4f}")
    differences = np.abs(differences)
    print(f"differences: {differences.mean():.4f} in the mean, {differences.max():.4f} at most; {RAYS} rays each, .0004 of their own")


if __name__ == "__main__":
    main()
