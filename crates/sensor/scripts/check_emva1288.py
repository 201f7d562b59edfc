"""Analyses frames of the simulated bench with the EMVA 1288 group's own software and compares with `dioptric`.

    dioptric measure noise --sensor machine-vision-mono --keep-frames bench -o bench
    pip install emva1288 'numpy<2'
    python check_emva1288.py bench

`bench` holds the frames, their descriptor.txt and our noise.json. The package fits its own lines to its own choice of
points, so that the two agree within the error of such a fit, not to the digit; the result of the last run is in
check_emva1288.txt.
"""

import json
import math
import sys
from pathlib import Path

from emva1288.process.data import Data1288
from emva1288.process.loader import LoadImageData
from emva1288.process.parser import ParseEmvaDescriptorFile
from emva1288.process.results import Results1288

# What the two may differ by, percent. The standard error of K from 26 levels of 512 x 512 pixels is 0.1 %; a level more or
# less in the fit moves it by less than that, and everything in electrons with it.
BAR = 0.3


def analyzed(images):
    loaded = LoadImageData(images, loglevel=40)
    return Results1288(Data1288(loaded.data, loglevel=40).data, loglevel=40)


def main(folder):
    images = ParseEmvaDescriptorFile(str(folder / "descriptor.txt"), loglevel=40).images
    ours = json.loads((folder / "noise.json").read_text())
    flat_time = next(time for time, points in images["temporal"].items() if len(points) > 2)
    flats = images["temporal"][flat_time]
    theirs = analyzed({"temporal": {flat_time: flats}, "spatial": images["spatial"]})
    rows = [
        ("K", ours["gain_dn_per_e"], theirs.K, "DN/e"),
        ("QE", 100 * ours["quantum_efficiency"], theirs.QE, "%"),
        ("sigma_d", ours["dark_noise_e"], theirs.sigma_d, "e"),
        ("DSNU", ours["dsnu_e"], theirs.DSNU1288, "e"),
        ("PRNU", ours["prnu_percent"], theirs.PRNU1288, "%"),
        ("saturation", ours["saturation_e"], theirs.u_e_sat, "e"),
        ("DR", ours["dynamic_range_db"], 20 * math.log10(theirs.DR), "dB"),
    ]
    dark_times = {time: points for time, points in images["temporal"].items() if 0.0 in points}
    if len(dark_times) > 2:
        # The package wants light at every time, but the dark current is read off the dark frames alone.
        lit = max(flats)
        temporal = {time: {0.0: points[0.0], lit: flats[lit]} for time, points in dark_times.items()}
        dark = analyzed({"temporal": temporal, "spatial": images["spatial"]})
        per_s = dark.u_I_mean_DN / theirs.K
        rows.append(("dark current", ours["dark_current_by_mean_e_per_s"], per_s, "e/s"))
    worst = []
    print(f"{ours['source']}, {ours['n_frames']} frames of {ours['columns']} x {ours['rows']} pixels")
    print(f"{'':14} {'dioptric':>12} {'emva1288':>12} {'differ by':>10}")
    for name, mine, other, unit in rows:
        percent = 100 * (mine / other - 1)
        print(f"{name:14} {mine:12.5g} {other:12.5g} {percent:+9.3f} %  {unit}")
        if abs(percent) > BAR:
            worst.append(f"{name} differs by {percent:.2f} %, more than {BAR} %")
    assert not worst, "; ".join(worst)


main(Path(sys.argv[1]))
