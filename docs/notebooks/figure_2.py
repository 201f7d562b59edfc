# %% [markdown]
# # Figure 2: line spread by ray bending, by waves, and in theory
#
# An ideal 50 mm f/22 lens images a point 2 m away. The paper bends rays at random (HURB); its line spread is narrower than Airy's by the factor .617, which
# the diffraction integral is not. [docs/diffraction.md](../diffraction.md) measures the models on real lenses.

# %%
import os

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ
FOCAL_MM, F_NUMBER, DISTANCE_MM = 50, 22, 2000
lens = dp.Lens.thin(FOCAL_MM, FOCAL_MM / F_NUMBER)
wavelengths_nm = np.array([400, 550, 700]) if SMALL else np.arange(400, 701, 25)
# The image lies behind the focus, so that the cone is narrower.
working = F_NUMBER * (1 + FOCAL_MM / (DISTANCE_MM - FOCAL_MM))
PIXEL_UM, N = 0.5, 161


def line_spread(diffraction):
    """Energy a µm over places across the line, a row a wavelength."""
    psf = lens.psf(
        distance_mm=DISTANCE_MM, wavelengths_nm=wavelengths_nm, focus_mm=DISTANCE_MM,
        pixel_um=PIXEL_UM, shape=N, diffraction=diffraction,
    )
    return psf.sum(axis=1) / psf.sum(axis=(1, 2))[:, None] / PIXEL_UM


def airy(places_um):
    """The same in theory: the transform of the modulation of a circular aperture."""
    profiles = []
    for nm in wavelengths_nm:
        cutoff = 1 / (1e-3 * nm * working)
        f = (np.arange(4000) + 0.5) / 4000
        modulation = 2 / np.pi * (np.arccos(f) - f * np.sqrt(1 - f**2))
        waves = np.cos(2 * np.pi * cutoff * f[:, None] * places_um)
        profiles.append(2 * cutoff * (modulation[:, None] * waves).mean(axis=0))
    return np.array(profiles)


def width_um(profile, places_um):
    """Full width at half the height."""
    above = np.flatnonzero(profile >= profile.max() / 2)
    left, right = above[0], above[-1]
    half = profile.max() / 2

    def crossing(a, b):
        return places_um[a] + (half - profile[a]) / (profile[b] - profile[a]) * (places_um[b] - places_um[a])

    return crossing(right + 1, right) - crossing(left - 1, left)


places_um = PIXEL_UM * (np.arange(N) - N // 2)
spreads = {"ray bending (HURB)": line_spread("hurb"), "waves": line_spread("wave"), "theory": airy(places_um)}

# %%
figure, axes = plt.subplots(1, 3, figsize=(13, 3), sharey=True)
for axis, (name, profiles) in zip(axes, spreads.items()):
    for nm, profile in zip(wavelengths_nm, profiles):
        axis.plot(places_um, profile, color=plt.cm.turbo((nm - 380) / 340))
    axis.set(title=name, xlim=(-30, 30), xlabel="µm")
axes[0].set_ylabel("energy a µm")
plt.show()

# %% [markdown]
# The widths in units of the wavelength times the working f-number.

# %%
for name, profiles in spreads.items():
    units = [width_um(profile, places_um) / (1e-3 * nm * working) for nm, profile in zip(wavelengths_nm, profiles)]
    print(f"{name}: {np.mean(units):.3f} λN")
    # Pixels of .5 µm widen the narrowest line by a hundredth.
    assert abs(np.mean(units) - (0.617 if "HURB" in name else 1.002)) < 0.02
