#!/usr/bin/env python3
"""Writes tests/surfaces/mirror_reference.csv: first order and rays of lens files with mirrors by ray-optics, an independent program.

Rays start 10 mm before the first surface (file's count, dummies included) with these x and y and travel at this tangent
in y; they end on the image surface of the file, where x and y and the direction cosines are those of its own frame.
Lengths behind mirrors are along z of the file, so that behind an odd number of them focal lengths in air are negative.
Indices of the glasses are written too, so that only the optics is compared. All lengths in mm, 17 digits.

    file,lens,wavelength in nm,efl,bfl less the distance to the image,index behind the object:behind surface 1:…
    ray,lens,x,y,tan,x_image,y_image,l,m,n

Usage: mirror_reference.py FOLDER > ../tests/surfaces/mirror_reference.csv, with the folder of mirror.seq, paraboloid.seq,
rc_f16.seq, mangin.seq, schmidt.seq and one_mirror_up_45deg.zmx. Needs rayoptics 0.9.8 and
opticalglass 1.1.1 from PyPI.
"""

import sys
import warnings
from pathlib import Path

import numpy as np

warnings.filterwarnings("ignore")

import rayoptics.optical.opticalmodel  # noqa: E402, F401
from rayoptics.codev import cmdproc  # noqa: E402
from rayoptics.raytr import raytrace  # noqa: E402
from rayoptics.zemax import zmxread  # noqa: E402

# File, wavelength in nm, heights of the rays, tangents of their fields.
FILES = [
    ("mirror.seq", 550.0, (3.0, 10.0), (0.0, 0.02)),
    ("paraboloid.seq", 550.0, (15.0, 50.0), (0.0, 0.001)),
    ("rc_f16.seq", 550.0, (1000.0, 3900.0), (0.0, 0.001)),
    ("mangin.seq", 555.0, (30.0, 95.0), (0.0, 0.005)),
    ("schmidt.seq", 587.6, (10.0, 37.0), (0.0, 0.05)),
    ("one_mirror_up_45deg.zmx", 550.0, (3.0, 9.0), (0.0, 0.01)),
]


def read(path: Path):
    if path.suffix == ".zmx":
        return zmxread.read_lens_file(path)[0]
    text = path.read_text()
    if "rdm" not in text.lower():
        # The file states radii, without a command that says so.
        path = Path("/tmp") / path.name
        path.write_text("RDM\n" + text)
    return cmdproc.read_lens(path)[0]


def main() -> None:
    folder = Path(sys.argv[1])
    print("# Written by scripts/mirror_reference.py with ray-optics 0.9.8.")
    for name, wavelength, heights, tangents in FILES:
        model = read(folder / name)
        model.update_model()
        seq = model["seq_model"]
        fod = model["analysis_results"]["parax_data"].fod
        indices = [repr(float(gap.medium.rindex(wavelength))) for gap in seq.gaps]
        defocus = float(fod.bfl) - float(seq.gaps[-1].thi)
        print(f"file,{name},{wavelength!r},{float(fod.efl)!r},{defocus!r},{':'.join(indices)}")
        seq.gaps[0].thi = 10.0
        seq.update_model()
        for height in heights:
            for tangent in tangents:
                for x, y in [(0.0, height), (0.6 * height, -0.8 * height)]:
                    direction = np.array([0.0, tangent, 1.0]) / np.hypot(1.0, tangent)
                    ray, _, _ = raytrace.trace(seq, np.array([x, y, 0.0]), direction, wavelength)
                    (px, py, _), (dx, dy, dz) = ray[-1][0], ray[-1][1]
                    numbers = [x, y, tangent, px, py, dx, dy, dz]
                    print("ray," + name + "," + ",".join(repr(float(v)) for v in numbers))


main()
