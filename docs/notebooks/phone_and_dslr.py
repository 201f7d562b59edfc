# %% [markdown]
# # A phone and a DSLR before the same things
#
# A 5.6 mm lens of four aspheres before 5.6 × 4.2 mm of sensor, and a 50 mm f/1.8 wide open: depth of field, noise and sharpness of one still life.

# %%
import os
from pathlib import Path

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ
ROOT = next(folder for folder in [Path.cwd(), *Path.cwd().parents] if (folder / "examples" / "phone.ron").exists())
quality = "sketch" if SMALL else "preview"
cameras = {name: dp.Camera.read(ROOT / "examples" / f"{name}.ron") for name in ("phone", "dslr-portrait")}
shots = {name: camera.render(quality=quality) for name, camera in cameras.items()}
figure, axes = plt.subplots(1, 2, figsize=(13, 5))
for axis, (name, shot) in zip(axes, shots.items()):
    axis.imshow(shot.rgb)
    axis.set_title(f"{name}: f = {cameras[name].lens.efl_mm:.1f} mm, f/{cameras[name].lens.f_number:.2f}")
    axis.axis("off")
plt.show()

# %% [markdown]
# Twice the rms radius of the blur of points at 960 mm, where both are in focus, and at 10 m, as a share of the width of the film.

# %%
blur = {}
for name, camera in cameras.items():
    shot, lens = shots[name], camera.lens
    width_mm = 1e-3 * shot.pitch_um * shot.shape[1]
    size = {}
    for distance_mm in (960, 10_000):
        table = lens.psf_table(distance_mm=distance_mm, film_mm=shot.film_mm, wavelengths_nm=550, pixel_um=shot.pitch_um / 4, shape=151)
        size[distance_mm] = 2e-3 * table[0]["rms_radius_um"] / width_mm
    print(name, {f"{mm / 1000:g} m": f"{100 * share:.2f} % of the width" for mm, share in size.items()})
    blur[name] = size[10_000]
assert blur["phone"] < 0.3 * blur["dslr-portrait"]

# %% [markdown]
# Noise: signal to noise of the green filter over exposures, by running the sensors alone.

# %%
for name, shot in shots.items():
    exposures_s = shot.exposure_s * 2.0 ** -np.arange(0, 8)
    snr_db = []
    for exposure_s in exposures_s:
        channels = shot.expose(exposure_s=float(exposure_s)).report()["sensor"]["channels"]
        snr_db.append(next(channel["snr_db"] for channel in channels if channel["filter"].startswith("G")))
    plt.plot(-np.arange(0, 8), snr_db, "o-", label=name)
    assert all(np.diff(snr_db) < 0)
plt.xlabel("stops below the metered exposure")
plt.ylabel("SNR of green, dB")
plt.legend()
plt.show()
