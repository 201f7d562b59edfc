#!/usr/bin/env python3
"""Writes cubes with the programs of the field, reads them with dioptric and compares digit for digit.

    python3 scripts/scene_files.py target/release/dioptric

Needs numpy, h5py, scipy, tifffile, spectral and OpenEXR. Each file holds the same radiance; dioptric makes spectral EXR of it, which
OpenEXR reads. Prints a line a kind with what was right, refused and wrong, and fails where anything was wrong.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from itertools import product
from pathlib import Path

import h5py
import numpy as np
import OpenEXR
import scipy.io
import spectral.io.envi as envi
import tifffile

ROWS, COLUMNS = 6, 9
WAVE_NM = np.array([450.0, 500.0, 560.0, 600.0, 650.0])
# Whole numbers, so that every type holds them.
CUBE = np.add.outer(np.add.outer(10 * np.arange(ROWS), np.arange(COLUMNS)), 40 * np.arange(5)).astype(float)
WAVES = ["--scene-wavelengths-nm", ",".join(str(nm) for nm in WAVE_NM)]
LIGHT = ["--quantity", "radiance"]


def converted(program: str, path: Path, words: list) -> "np.ndarray | str":
    """Returns the bands that dioptric reads, rows × columns × bands, or why it does not."""
    target = path.with_name("converted.exr")
    done = subprocess.run([program, "scene", "convert", str(path), str(target), *words], capture_output=True, text=True)
    if done.returncode != 0:
        return done.stderr.strip()
    with OpenEXR.File(str(target), separate_channels=True) as file:
        names = sorted(name for name in file.channels() if name.startswith("S0."))
        return np.stack([file.channels()[name].pixels for name in names], axis=2)


def files(folder: Path):
    """Yields the kind of each file, what it is, its path and what is said of it."""
    dtypes = ["u1", "<u2", ">u2", "<i4", "<f4", ">f4", "<f8", ">f8"]
    for dtype, axes in product(dtypes, ["yxb", "byx", "xby"]):
        turned = np.einsum(f"yxb->{axes}", CUBE).astype(dtype)
        path = folder / "a.npy"
        np.save(path, turned)
        yield "npy", f"{dtype} {axes}", path, [*WAVES, *LIGHT, "--axes", axes]
        path = folder / "a.npz"
        save = np.savez_compressed if axes == "yxb" else np.savez
        save(path, cube=turned, wavelengths=WAVE_NM)
        yield "npz", f"{dtype} {axes}", path, [*LIGHT, "--axes", axes]
        path = folder / "a.npy"
        np.save(path, np.asfortranarray(turned))
        yield "npy", f"Fortran {dtype} {axes}", path, [*WAVES, *LIGHT, "--axes", axes]
    options = [{}, {"compression": "gzip"}, {"compression": "gzip", "shuffle": True}, {"compression": "lzf"}, {"fletcher32": True}]
    for dtype, how, libver in product(["u1", "<u2", ">u2", "<i4", "<f4", ">f4", "<f8"], options, ["earliest", "latest"]):
        path = folder / "a.h5"
        with h5py.File(path, "w", libver=libver) as file:
            group = file.create_group("scene")
            group.create_dataset("cube", data=CUBE.astype(dtype), chunks=(4, 4, 2) if how else None, **how)
            group["wavelength"] = WAVE_NM
        yield "h5py", f"{dtype} {how} {libver}", path, LIGHT
    for dtype, packed, axes in product(["u1", "u2", "i4", "f4", "f8"], [False, True], ["yxb", "byx"]):
        path = folder / "a.mat"
        cube = np.einsum(f"yxb->{axes}", CUBE).astype(dtype)
        scipy.io.savemat(path, {"cube": cube, "bands": WAVE_NM}, do_compression=packed)
        yield "scipy", f"{dtype} {packed} {axes}", path, [*LIGHT, "--axes", axes]
    for dtype, how in product(["u1", "u2", "f4"], [{}, {"compression": "zlib"}, {"tile": (16, 16)}, {"bigtiff": True}, {"byteorder": ">"}]):
        path = folder / "a.tif"
        tifffile.imwrite(path, np.moveaxis(CUBE, 2, 0).astype(dtype), photometric="minisblack", **how)
        yield "tifffile", f"pages {dtype} {how}", path, [*WAVES, *LIGHT]
        for planar in ["contig", "separate"]:
            cube = CUBE if planar == "contig" else np.moveaxis(CUBE, 2, 0)
            tifffile.imwrite(path, cube.astype(dtype), photometric="minisblack", planarconfig=planar, **how)
            yield "tifffile", f"samples {planar} {dtype} {how}", path, [*WAVES, *LIGHT]
    for dtype, interleave, order in product(["u1", "i2", "u2", "i4", "u4", "f4", "f8"], ["bsq", "bil", "bip"], [0, 1]):
        path = folder / "a.hdr"
        metadata = {"wavelength": [str(nm) for nm in WAVE_NM], "wavelength units": "Nanometers"}
        envi.save_image(str(path), CUBE.astype(dtype), dtype=np.dtype(dtype), interleave=interleave, byteorder=order, force=True, metadata=metadata)
        yield "spectral", f"{dtype} {interleave} {order}", path, LIGHT
    kinds = [OpenEXR.NO_COMPRESSION, OpenEXR.RLE_COMPRESSION, OpenEXR.ZIPS_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION]
    for compression, dtype in product(kinds, [np.float16, np.float32]):
        path = folder / "a.exr"
        bands = {f"S0.{nm:.6f}nm".replace(".", ",", 2).replace("S0,", "S0."): CUBE[:, :, i].astype(dtype) for i, nm in enumerate(WAVE_NM)}
        header = {"compression": compression, "type": OpenEXR.scanlineimage, "emissiveUnits": "W.m^-2.sr^-1.nm^-1"}
        with OpenEXR.File(header, bands) as file:
            file.write(str(path))
        yield "OpenEXR", f"{compression} {dtype.__name__}", path, []
        parts = []
        for name, plane in bands.items():
            # A part a band, as renderers write them.
            parts.append(OpenEXR.Part({"compression": compression, "type": OpenEXR.scanlineimage, "emissiveUnits": "W.m^-2.sr^-1.nm^-1"}, {name: plane}, name))
        with OpenEXR.File(parts) as file:
            file.write(str(path))
        yield "OpenEXR", f"parts {compression} {dtype.__name__}", path, []


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    table: dict = {}
    with tempfile.TemporaryDirectory() as folder:
        for kind, what, path, words in files(Path(folder)):
            found = converted(sys.argv[1], path, words)
            if isinstance(found, str):
                verdict = "refused"
                print(f"{kind} {what}: {found}")
            else:
                verdict = "right" if found.shape == CUBE.shape and np.array_equal(found, CUBE.astype(np.float32)) else "wrong"
                if verdict == "wrong":
                    print(f"{kind} {what}: wrong, {found.shape}")
            table.setdefault(kind, Counter())[verdict] += 1
    for kind, counts in table.items():
        print(f"{kind:10}", ", ".join(f"{counts[verdict]} {verdict}" for verdict in ["right", "refused", "wrong"]))
    if any(counts["wrong"] for counts in table.values()):
        sys.exit(1)


if __name__ == "__main__":
    main()
