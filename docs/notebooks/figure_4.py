# %% [markdown]
# # Figure 4: a world by rays from the film
#
# A metronome before a brick wall ([`fixtures/worlds/metronome.pbrt`](../../fixtures/worlds/metronome.pbrt)), through an ideal lens of 50 mm that is focused on the eye
# 79 mm away: a pinhole, f/5, and f/5 with .05 V of read noise. `SAMPLES` a pixel decide the noise of the rendering.

# %%
import os
from pathlib import Path

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ
ROOT = next(folder for folder in [Path.cwd(), *Path.cwd().parents] if (folder / "fixtures").is_dir())
COLUMNS, SAMPLES = (60, 8) if SMALL else (300, 64)
FILM_SIDE_MM = 70 / np.sqrt(2)
text = """(
    name: "Figure 4", lens: Thin(focal_length_mm: 50.0, diameter_mm: %s), focus: FilmMm(137.0),
    film: Pixels(columns: %d, rows: %d, pitch_um: %f), diffraction: None, sensor: BuiltIn("nikon-d100"),
    scene: (source: World((file: "metronome.pbrt", effort: Samples(%d))), field_of_view_deg: 23.46),
    processing: (denoise: 0.0),
    wavelengths: Range(first_nm: 400.0, last_nm: 700.0, step_nm: %d.0),
)"""


def camera(diameter_mm, read_noise_v):
    """The camera with a stop and a noise."""
    pitch_um = 1e3 * FILM_SIDE_MM / COLUMNS
    own = text % (diameter_mm, COLUMNS, COLUMNS, pitch_um, SAMPLES, 50 if SMALL else 10)
    ours = dp.Camera.from_ron(own, ROOT / "fixtures" / "worlds")
    return ours.with_(sensor=ours.sensor.with_(read_noise_v=read_noise_v), pixels=(COLUMNS, COLUMNS), pixel_um=pitch_um)


shots = {
    "pinhole": camera(0.1, 0.0).render(),
    "f/5": camera(10.0, 0.0).render(),
    "f/5, read noise .05 V": camera(10.0, 0.05).render(),
}

# %%
figure, axes = plt.subplots(1, 3, figsize=(12, 4))
for axis, (name, shot) in zip(axes, shots.items()):
    axis.imshow(shot.rgb)
    axis.set_title(f"{name}, {shot.exposure_s:.2g} s")
    axis.axis("off")
plt.show()

# %% [markdown]
# The larger stop gathers its area's worth of light, so that the metered exposures differ by the square of the diameters.

# %%
ratio = shots["pinhole"].exposure_s / shots["f/5"].exposure_s
print(f"exposures differ by {ratio:.0f}, areas by {(10 / 0.1) ** 2:.0f}")
assert abs(ratio / 1e4 - 1) < 0.2
grain = {name: np.abs(np.diff(shot.rgb[..., 1].astype(float), axis=1)).mean() for name, shot in shots.items()}
print("differences of neighbors, codes:", {name: round(mean, 1) for name, mean in grain.items()})
assert grain["f/5, read noise .05 V"] > grain["f/5"]
