#!/usr/bin/env python3
"""Writes cubes with the programs of the field, reads them with dioptric and compares digit for digit.

    python3 scripts/scene_files.py target/release/dioptric

Needs numpy, h5py, scipy, tifffile, spectral and OpenEXR; files of OpenImageIO and Mitsuba are made where these are installed too. Each file
holds the same radiance, but Mitsuba's renderings, whose truth is what OpenEXR reads and the depth that it returns; dioptric makes spectral EXR of it, which OpenEXR
reads. Prints a line a kind with what was right, refused and wrong, and fails where anything was wrong.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from itertools import chain, product
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


def files_of_image_io(folder: Path):
    """Yields files that OpenImageIO writes."""
    try:
        import OpenImageIO as oiio
    except ImportError:
        return
    types = {"half": np.float16, "float": np.float32}
    packings = ["none", "rle", "zip", "zips", "piz"]
    for tile, packing, name in product([0, 16], packings, types):
        path = folder / "a.exr"
        spec = oiio.ImageSpec(COLUMNS, ROWS, 5, name)
        spec.channelnames = [f"S0.{nm:.0f},000000nm" for nm in WAVE_NM]
        spec["compression"] = packing
        spec["emissiveUnits"] = "W.m^-2.sr^-1.nm^-1"
        spec.tile_width = spec.tile_height = tile
        write(oiio, path, spec, CUBE.astype(types[name]))
        yield "OpenImageIO", f"EXR {name} {packing} tiles {tile}", path, [], CUBE
    for name, planar in product(["uint8", "uint16", "float", "half"], ["contig", "separate"]):
        path = folder / "a.tif"
        spec = oiio.ImageSpec(COLUMNS, ROWS, 5, name)
        spec["planarconfig"] = planar
        write(oiio, path, spec, CUBE.astype({"uint8": "u1", "uint16": "u2", "float": "f4", "half": "f2"}[name]))
        yield "OpenImageIO", f"TIFF {name} {planar}", path, [*WAVES, *LIGHT], CUBE


def write(oiio, path: Path, spec, pixels: np.ndarray) -> None:
    """Writes a picture with OpenImageIO."""
    output = oiio.ImageOutput.create(str(path))
    if not (output and output.open(str(path), spec) and output.write_image(np.ascontiguousarray(pixels)) and output.close()):
        raise RuntimeError(f"{path}: {oiio.geterror()}")


def files_of_mitsuba(folder: Path):
    """Yields renderings of Mitsuba: its film of bands, and the way along the ray as depth."""
    try:
        import mitsuba as mi
    except ImportError:
        return
    mi.set_variant("scalar_spectral")
    rise = {"type": "irregular", "wavelengths": "400,500,600,700", "values": "1,2,3,4"}
    look = mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0])

    def rendered(film: dict, integrator: dict, name: str) -> np.ndarray:
        wall = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(9), "emitter": {"type": "area", "radiance": rise}}
        size = {"width": COLUMNS, "height": ROWS, "rfilter": {"type": "box"}}
        camera = {"type": "perspective", "fov": 40, "to_world": look, "film": {**film, **size}}
        scene = mi.load_dict({"type": "scene", "integrator": integrator, "sensor": camera, "wall": wall})
        pixels = np.array(mi.render(scene, spp=16))
        scene.sensors()[0].film().bitmap().write(str(folder / name))
        return pixels

    for samples in ["float16", "float32"]:
        film = {"type": "specfilm", "component_format": samples}
        for nm in WAVE_NM:
            film[f"{nm:.0f}nm"] = {"type": "irregular", "wavelengths": f"{nm - 5},{nm},{nm + 5}", "values": "0,1,0"}
        rendered(film, {"type": "path"}, "a.exr")
        with OpenEXR.File(str(folder / "a.exr"), separate_channels=True) as file:
            pixels = np.stack([file.channels()[f"{nm:.0f}nm"].pixels for nm in WAVE_NM], axis=2)
        yield "Mitsuba", f"specfilm {samples}", folder / "a.exr", LIGHT, pixels
    film = {"type": "hdrfilm", "component_format": "float32", "pixel_format": "rgb"}
    pixels = rendered(film, {"type": "aov", "aovs": "dd.y:depth", "img": {"type": "path"}}, "a.exr")
    yield "Mitsuba", "aov depth", folder / "a.exr", ["--fov-deg", "40"], pixels[:, :, -1]


def depth_of(path: Path) -> np.ndarray:
    """Returns the distances from the camera of the samples of spectral EXR."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        depth = file.channels()["Z"].pixels.astype(float)
        focal, x, y = (float(np.ravel(file.header()[name])[0]) for name in ["viewFocalPx", "viewCenterXPx", "viewCenterYPx"])
    rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]]
    return depth * np.sqrt(1 + ((columns - x) / focal) ** 2 + ((rows - y) / focal) ** 2)


def is_right(found: np.ndarray, truth: np.ndarray, target: Path) -> bool:
    """Whether bands are the truth to the digit, or, where the truth is one of depth, distances to single precision."""
    if truth.ndim == 2:
        distances = depth_of(target)
        return distances.shape == truth.shape and np.allclose(distances, truth, rtol=1e-6)
    return found.shape == truth.shape and np.array_equal(found, truth.astype(np.float32))


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    table: dict = {}
    with tempfile.TemporaryDirectory() as folder:
        of_cube = ((*file, CUBE) for file in files(Path(folder)))
        for kind, what, path, words, truth in chain(of_cube, files_of_image_io(Path(folder)), files_of_mitsuba(Path(folder))):
            found = converted(sys.argv[1], path, words)
            if isinstance(found, str):
                verdict = "refused"
                print(f"{kind} {what}: {found}")
            else:
                verdict = "right" if is_right(found, truth, path.with_name("converted.exr")) else "wrong"
                if verdict == "wrong":
                    print(f"{kind} {what}: wrong, {found.shape}")
            table.setdefault(kind, Counter())[verdict] += 1
    for kind, counts in table.items():
        print(f"{kind:12}", ", ".join(f"{counts[verdict]} {verdict}" for verdict in ["right", "refused", "wrong"]))
    if any(counts["wrong"] for counts in table.values()):
        sys.exit(1)


if __name__ == "__main__":
    main()
