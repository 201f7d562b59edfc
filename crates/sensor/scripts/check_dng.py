"""Opens the DNG files that a test writes with two independent readers, LibRaw (rawpy) and tifffile, and has ExifTool validate
them where it is installed.

    DIOPTRIC_DNG_FOLDER=/some/folder cargo test -p dioptric-sensor --test shots frames_for_other_readers
    pip install rawpy tifffile pillow numpy
    python check_dng.py /some/folder

Each frame's digital numbers must equal those of the 16-bit PNG written beside it, the mosaic and the levels must be
those of the data sheet, and LibRaw's own development with the file's neutral and matrices must give a neutral white
patch and the hues of the chart. LibRaw keeps mosaics of two columns only: of the quad-Bayer one it reads the numbers,
the levels and the matrices right, and the mosaic not at all, so that mosaic is held to tifffile's reading alone. The
result of the last run is in check_dng.txt.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import rawpy
import tifffile
from PIL import Image

LETTERS = "RGBCMYW"
# Bits, black level, the mosaic row by row, and whether LibRaw's development must have the chart's hues.
SENSORS = {
    "imx363": (10, 64, "RG GB", True),
    "mt9v024": (10, 0, "GR BG", True),
    "nikon-d5100": (14, 0, "RG GB", True),
    "machine-vision-mono": (12, 32, None, False),
    "bayer-rggb": (10, 64, "RG GB", True),
    "bayer-bggr": (10, 64, "BG GR", True),
    "bayer-grbg": (10, 64, "GR BG", True),
    "bayer-gbrg": (10, 64, "GB RG", True),
    "quad-bayer": (10, 64, "RRGG RRGG GGBB GGBB", False),
    "ryyb": (10, 64, "RY YB", True),
    "cyym": (10, 64, "CY YM", True),
    "rgbw": (10, 64, "RG BW", True),
    "stacked": (10, 64, None, True),
    "logarithmic": (10, 64, "RG GB", True),
}
PATCH = 24


def numbers_of(folder, name):
    """The digital numbers of the PNG, or of one PNG a filter."""
    single = folder / f"{name}.png"
    files = [single] if single.exists() else [folder / f"{name}.{c}.png" for c in "RGB"]
    planes = [np.array(Image.open(file)).astype(np.uint16) for file in files]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)


def check_tags(name, folder, numbers, tile):
    with tifffile.TiffFile(folder / f"{name}.dng") as file:
        page = file.pages[0]
        tags = {tag.code: tag.value for tag in page.tags.values()}
        assert np.array_equal(page.asarray(), numbers), f"{name}: tifffile reads other numbers"
    if tile is None:
        assert tags[262] == 34892 and 33422 not in tags, f"{name}: {tags[262]}"
        return tags
    rows = tile.split()
    assert tuple(tags[33421]) == (len(rows), len(rows[0])), f"{name}: {tags[33421]}"
    assert "".join(LETTERS[code] for code in tags[33422]) == "".join(rows), f"{name}: {tags[33422]}"
    return tags


def validate(folder):
    """ExifTool's word on each file, which must be that it is right."""
    if shutil.which("exiftool") is None:
        print("no exiftool: not validated")
        return
    files = sorted(folder.glob("*.dng"))
    words = subprocess.run(["exiftool", "-s3", "-validate", *map(str, files)], capture_output=True, text=True, check=True)
    found = [line for line in words.stdout.splitlines() if line and not line.startswith("=")]
    assert len([word for word in found if word == "OK"]) == len(files), words.stdout
    version = subprocess.run(["exiftool", "-ver"], capture_output=True, text=True, check=True).stdout.strip()
    print(f"exiftool {version} -validate: {len(files)} files without warnings")


def main(folder):
    for name, (bits, black, tile, has_hues) in SENSORS.items():
        numbers = numbers_of(folder, name)
        tags = check_tags(name, folder, numbers, tile)
        with rawpy.imread(str(folder / f"{name}.dng")) as raw:
            seen = (raw.raw_image_visible if raw.raw_type == rawpy.RawType.Flat else raw.raw_image_visible[..., :3]).copy()
            if 50712 in tags:
                # LibRaw straightens the numbers by the file's own table as it reads them.
                numbers, bits, black = np.array(tags[50712], np.uint16)[numbers], 16, 4096
            assert np.array_equal(seen, numbers), f"{name}: LibRaw reads other numbers"
            white = raw.white_level
            assert 2 ** (bits - 1) < white < 2**bits and raw.black_level_per_channel[0] == black, f"{name}: {white}"
            line = f"{name}: {seen.shape}, levels {black}..{white}"
            if tile is not None and len(tile.split()[0]) == 2:
                kinds = raw.color_desc.decode()
                found = " ".join("".join(kinds[k] for k in row) for row in raw.raw_pattern)
                # LibRaw has letters of its own for other filters: they stand in the order of the file's planes.
                planes = [LETTERS[code] for code in tags[50710]]
                index = [[3 if k == 3 and len(planes) > 3 else (1 if k == 3 else k) for k in row] for row in raw.raw_pattern]
                ours = " ".join("".join(planes[k] for k in row) for row in index)
                assert ours == tile, f"{name}: {ours} ({found})"
                line += f", mosaic {ours}"
            if not has_hues:
                print(f"{line}: ok")
                continue
            rgb = raw.postprocess(use_camera_wb=True, no_auto_bright=True, user_flip=0, output_bps=8).astype(float)

        def patch(i):
            r, c = PATCH * (i // 6) + 8, PATCH * (i % 6) + 8
            return rgb[r : r + 8, c : c + 8].mean(axis=(0, 1))

        gray = patch(20)
        assert np.ptp(gray) < 8, f"{name}: gray is {gray}"
        assert patch(14).argmax() == 0 and patch(13).argmax() == 1 and patch(12).argmax() == 2, name
        print(
            f"{line}, gray {gray.round(1).tolist()}, red {patch(14).round().tolist()}, "
            f"green {patch(13).round().tolist()}, blue {patch(12).round().tolist()}: ok"
        )


print(f"rawpy {rawpy.__version__} (LibRaw {'.'.join(map(str, rawpy.libraw_version))}), tifffile {tifffile.__version__}")
validate(Path(sys.argv[1]))
main(Path(sys.argv[1]))
