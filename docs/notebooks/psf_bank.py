# %% [markdown]
# # Point spreads as arrays for deep learning
#
# Point spreads of a lens over fields, distances and wavelengths in one array, normalized, and compressed by a singular value decomposition: what a network that
# deblurs, or a differentiable image layer, is trained with.

# %%
import os
import tempfile
from pathlib import Path

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ
PIXEL_UM = 12.0
lens = dp.Lens.built_in("dgauss-50mm").with_stop(f_number=2.8)
fields_deg = np.linspace(0, 18, 4 if SMALL else 13)
distances_mm = 1 / np.linspace(1 / 800, 1 / 4000, 3 if SMALL else 9)       # even in dioptres, as blur is
wavelengths_nm = np.array([450, 550, 650]) if SMALL else np.arange(420, 681, 20)
bank = lens.psf(
    field_deg=fields_deg, distance_mm=distances_mm, wavelengths_nm=wavelengths_nm, focus_mm=1200, pixel_um=PIXEL_UM, shape=65,
)
print(bank.shape, bank.dtype, f"{bank.nbytes / 1e6:.1f} MB")

# %%
figure, axes = plt.subplots(len(fields_deg[:4]), len(distances_mm), figsize=(1.6 * len(distances_mm), 6.4))
green = np.argmin(np.abs(wavelengths_nm - 550))
steps = np.linspace(0, len(fields_deg) - 1, 4).astype(int)
for row, field in zip(axes, steps):
    for axis, distance in zip(row, range(len(distances_mm))):
        axis.imshow(np.sqrt(np.maximum(bank[field, distance, green], 0)), cmap="magma")
        axis.set_title(f"{fields_deg[field]:.0f}°, {distances_mm[distance] / 1000:.2f} m", fontsize=7)
        axis.axis("off")
plt.show()

# %% [markdown]
# Point spreads are normalized to the light that gets through the lens, so that a sum below one is what falls outside of the picture; the light
# itself, cut by the rims, is in `lens.analyze`. Divided out, each sums to one.

# %%
energy = bank.sum(axis=(-2, -1))
print(f"in the pictures: {100 * energy.min():.1f} % of the light at least")
normalized = bank / energy[..., None, None]
pictures = normalized.reshape(-1, 65 * 65)
mean = pictures.mean(axis=0)
_, strengths, basis = np.linalg.svd(pictures - mean, full_matrices=False)
kept = np.cumsum(strengths**2) / np.sum(strengths**2)
n = int(np.searchsorted(kept, 0.99)) + 1
print(f"{n} of {len(strengths)} components hold 99 % of the variance")
assert n < len(strengths)

# %%
scratch = tempfile.TemporaryDirectory()               # removed when Python ends
folder = Path(scratch.name)
np.savez_compressed(
    folder / "bank.npz", psf=normalized.astype(np.float32), energy=energy,
    fields_deg=fields_deg, distances_mm=distances_mm, wavelengths_nm=wavelengths_nm, pixel_um=PIXEL_UM,
)
print(f"{(folder / 'bank.npz').stat().st_size / 1e6:.1f} MB; torch.from_numpy(np.load('bank.npz')['psf']) has it in PyTorch")
