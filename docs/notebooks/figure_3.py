# %% [markdown]
# # Figure 3: longitudinal chromatic aberration
#
# The paper's two-element lens has one glass, so that colors have different foci. Focused for 8 m, it images targets at 8 m with a blue haze and those at 2 m
# with a red one.

# %%
import os

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ
FILM_MM = 51.8145
lens = dp.Lens.built_in("paper-2el").with_stop(diameter_mm=4)
wavelengths_nm = np.arange(400, 701, 50 if SMALL else 10)

# %% [markdown]
# How far behind the last vertex each color is sharp, of both distances; the film stands at the line.

# %%
for distance_mm in (8000, 2000):
    plt.plot(wavelengths_nm, [lens.film_mm_for(distance_mm, nm) for nm in wavelengths_nm], label=f"{distance_mm / 1000:.0f} m")
plt.axhline(FILM_MM, color="gray")
plt.xlabel("wavelength, nm")
plt.ylabel("image distance, mm")
plt.legend()
plt.show()
sharp_nm = [wavelengths_nm[np.argmin([abs(lens.film_mm_for(mm, nm) - FILM_MM) for nm in wavelengths_nm])] for mm in (8000, 2000)]
print(f"sharp on the film: {sharp_nm[0]} nm of 8 m, {sharp_nm[1]} nm of 2 m")
assert sharp_nm[0] > sharp_nm[1]

# %% [markdown]
# Targets of two degrees at both distances, without noise.

# %%
camera = dp.Camera.demo().with_(
    lens=lens, film_mm=FILM_MM, pixels=(90, 90) if SMALL else (300, 300), pixel_um=15 if SMALL else 4.5,
    wavelengths_nm=wavelengths_nm, noise="none", diffraction="none",
)
figure, axes = plt.subplots(2, 3, figsize=(9, 6))
for row, depth_m in zip(axes, (8, 2)):
    for axis, pattern in zip(row, ("checkerboard", "radial-lines", "slanted-bar")):
        n = 120 if SMALL else 400
        size = {"checkerboard": n // 8}.get(pattern)
        target = dp.Scene.target(pattern, n, n, fov_deg=2, depth_m=depth_m, size=size)
        axis.imshow(camera.with_(scene=target).render().rgb)
        axis.set_title(f"{pattern}, {depth_m} m")
        axis.axis("off")
plt.show()
