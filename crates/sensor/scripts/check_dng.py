"""Opens the DNG files that a test writes with two independent readers, LibRaw (rawpy) and tifffile.

    DIOPTRIC_DNG_FOLDER=/some/folder cargo test -p dioptric-sensor --test shots frames_for_other_readers
    pip install rawpy tifffile pillow numpy
    python check_dng.py /some/folder

Each frame's digital numbers must equal those of the 16-bit PNG written beside it, the mosaic and the levels must be
those of the data sheet, and LibRaw's own development with the file's neutral and matrices must give a neutral white
patch and the hues of the chart. The result of the last run is in check_dng.txt.
"""

import sys
from pathlib import Path

import numpy as np
import rawpy
import tifffile
from PIL import Image

SENSORS = {
    "imx363": (10, 64, [[0, 1], [1, 2]]),
    "mt9v024": (10, 0, [[1, 0], [2, 1]]),
    "nikon-d5100": (14, 0, [[0, 1], [1, 2]]),
    "machine-vision-mono": (12, 32, None),
}
PATCH = 24


def main(folder):
    for name, (bits, black, tile) in SENSORS.items():
        numbers = np.array(Image.open(folder / f"{name}.png")).astype(np.uint16)
        with tifffile.TiffFile(folder / f"{name}.dng") as file:
            page = file.pages[0]
            tags = {tag.code: tag.value for tag in page.tags.values()}
            assert np.array_equal(page.asarray(), numbers), f"{name}: tifffile reads other numbers"
        if tile is not None:
            assert list(tags[33422]) == [c for row in tile for c in row], f"{name}: {tags[33422]}"
        with rawpy.imread(str(folder / f"{name}.dng")) as raw:
            visible = raw.raw_image_visible.copy()
            assert np.array_equal(visible, numbers), f"{name}: LibRaw reads other numbers"
            white = raw.white_level
            assert 2 ** (bits - 1) < white < 2**bits and raw.black_level_per_channel[0] == black, f"{name}: {white}"
            if tile is None:
                print(f"{name}: {visible.shape}, levels {black}..{white}, monochrome: ok")
                continue
            # LibRaw numbers the second green 3.
            pattern = np.where(raw.raw_pattern == 3, 1, raw.raw_pattern)
            assert np.array_equal(pattern, tile), f"{name}: {pattern}"
            rgb = raw.postprocess(use_camera_wb=True, no_auto_bright=True, user_flip=0, output_bps=8).astype(float)

        def patch(i):
            r, c = PATCH * (i // 6) + 8, PATCH * (i % 6) + 8
            return rgb[r : r + 8, c : c + 8].mean(axis=(0, 1))

        grey = patch(20)
        assert np.ptp(grey) < 8, f"{name}: grey is {grey}"
        assert patch(14).argmax() == 0 and patch(13).argmax() == 1 and patch(12).argmax() == 2, name
        print(
            f"{name}: {visible.shape}, levels {black}..{white}, mosaic {pattern.tolist()}, "
            f"grey {grey.round(1).tolist()}, red {patch(14).round().tolist()}, "
            f"green {patch(13).round().tolist()}, blue {patch(12).round().tolist()}: ok"
        )


main(Path(sys.argv[1]))
