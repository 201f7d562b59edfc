#!/usr/bin/env python3
"""Writes the MATLAB files of fixtures/scenes, in the layouts of ISETCam: needs numpy, scipy and h5py.

    python3 scripts/mat_fixtures.py fixtures/scenes

Photons are 1e15 (1 + row + column / 10 + band / 100) s⁻¹ m⁻² sr⁻¹ nm⁻¹ of a sample, so that tests know them by formula.
"""

import sys
from pathlib import Path

import h5py
import numpy as np
from scipy.io import savemat

ROWS, COLUMNS = 4, 6
WAVE_NM = np.array([420.0, 480.0, 550.0, 630.0, 700.0])


def photons() -> np.ndarray:
    row, column, band = np.indices((ROWS, COLUMNS, WAVE_NM.size))
    return 1e15 * (1 + row + column / 10 + band / 100)


def illuminant() -> dict:
    """An illuminant of today: photons of a perfect white, as radiance."""
    white = {"photons": np.full((WAVE_NM.size, 1), 8e15, np.float32)}
    return {"name": "equal photons", "type": "illuminant", "spectrum": {"wave": WAVE_NM[:, None]}, "data": white}


def scene() -> dict:
    row, column = np.indices((ROWS, COLUMNS))
    return {
        "type": "scene",
        "metadata": np.array([]),
        "name": "ramps",
        "spectrum": {"wave": WAVE_NM[:, None]},
        "data": {"photons": photons().astype(np.float32), "luminance": np.array([])},
        "distance": 1.2,
        "magnification": 1.0,
        "wAngular": 30.0,
        "depthMap": 2.0 + row + 0.5 * column,
        "illuminant": illuminant(),
        # What a reader has no use for must not stop it.
        "comments": np.array(["a", "bc"], dtype=object),
    }


def multispectral() -> dict:
    """Coefficients of two basis functions and a mean, with an illuminant of old: energy of a perfect white."""
    basis = np.stack([np.ones(WAVE_NM.size), np.arange(WAVE_NM.size) / 100], axis=1)
    row, column = np.indices((ROWS, COLUMNS))
    coefficients = np.stack([1e15 * (row + column / 10), np.full((ROWS, COLUMNS), 1e15)], axis=2)
    return {
        "mcCOEF": coefficients,
        "basis": {"basis": basis, "wave": WAVE_NM[None, :]},
        "imgMean": np.full((1, WAVE_NM.size), 1e15),
        "comment": "made by scripts/mat_fixtures.py",
        "illuminant": {"wavelength": WAVE_NM[:, None], "data": np.full((WAVE_NM.size, 1), 0.01)},
    }


def coded() -> dict:
    """A scene of old: photons as 16-bit numbers between two ends."""
    exact = photons()
    low, high = exact.min(), exact.max()
    codes = np.round((exact - low) / (high - low) * 65535).astype(np.uint16)
    plain = scene()
    plain["data"] = {"photons": codes, "dmin": low, "dmax": high, "bitDepth": 16}
    del plain["depthMap"], plain["illuminant"]
    return plain


def write_73(path: Path, value: dict) -> None:
    """Writes variables as MATLAB 7.3 does: HDF5 behind 512 bytes of its own, axes turned round, text as numbers."""

    def put(group: h5py.Group, name: str, item: object) -> None:
        if isinstance(item, dict):
            folder = group.create_group(name)
            folder.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, part in item.items():
                put(folder, key, part)
        elif isinstance(item, str):
            codes = np.array([[ord(letter)] for letter in item], np.uint16)
            group.create_dataset(name, data=codes).attrs["MATLAB_class"] = np.bytes_("char")
        elif isinstance(item, np.ndarray) and item.dtype == object:
            references = [[hold(part)] for part in item.ravel()]
            data = group.create_dataset(name, data=np.array(references, h5py.ref_dtype), dtype=h5py.ref_dtype)
            data.attrs["MATLAB_class"] = np.bytes_("cell")
        else:
            array = np.atleast_2d(np.asarray(item))
            data = group.create_dataset(name, data=array.T, compression="gzip" if array.size > 16 else None)
            classes = {"f8": "double", "f4": "single", "u2": "uint16"}
            data.attrs["MATLAB_class"] = np.bytes_(classes[array.dtype.str[1:]])
            if array.size == 0:
                data.attrs["MATLAB_empty"] = np.uint8(1)

    with h5py.File(path, "w", userblock_size=512) as file:
        kept = file.create_group("#refs#")

        def hold(item: object) -> h5py.Reference:
            put(kept, f"r{len(kept)}", item)
            return kept[f"r{len(kept) - 1}"].ref

        for name, item in value.items():
            put(file, name, item)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created by: scripts/mat_fixtures.py HDF5 schema 1.00 ."
    with open(path, "r+b") as file:
        file.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")


def main() -> None:
    folder = Path(sys.argv[1])
    savemat(folder / "iset_scene.mat", {"scene": scene(), "other": np.zeros(3)}, do_compression=True)
    savemat(folder / "iset_plain.mat", {"scene": scene()}, do_compression=False)
    savemat(folder / "iset_multispectral.mat", multispectral(), do_compression=True)
    savemat(folder / "iset_coded.mat", {"scene": coded()}, do_compression=True)
    raw = {"data": photons(), "wavelength": WAVE_NM, "fov": 20.0, "dist": 3.0}
    savemat(folder / "iset_raw.mat", raw, do_compression=True)
    write_73(folder / "iset_scene_v73.mat", {"scene": scene()})


if __name__ == "__main__":
    main()
