# %% [markdown]
# # A first picture
#
# The camera of the demo: a still life through a 50 mm double Gauss at f/4. `render` computes it whole, from spectral radiance to codes; every stage
# on the way is an array.

# %%
import os

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ                 # coarse, for the test of this page
camera = dp.Camera.demo()
shot = camera.render(quality="sketch" if SMALL else "preview")
shot

# %% [markdown]
# The light on the film, band by band, and the raw frame behind it.

# %%
figure, axes = plt.subplots(1, 3, figsize=(13, 3), layout="constrained")
for axis, nm in zip(axes, (450, 620)):
    band = np.argmin(np.abs(shot.wavelengths_nm - nm))
    # The small lamps are a hundred times brighter than all else.
    image = axis.imshow(shot.irradiance[band], cmap="gray", vmax=np.percentile(shot.irradiance[band], 99))
    axis.set_title(f"{shot.wavelengths_nm[band]:.0f} nm, W m⁻² nm⁻¹")
    figure.colorbar(image, ax=axis)
image = axes[2].imshow(shot.raw, cmap="gray")
axes[2].set_title(f"digital numbers after {1e3 * shot.exposure_s:.1f} ms")
figure.colorbar(image, ax=axes[2])
plt.show()

# %% [markdown]
# Another exposure runs the sensor alone: the irradiance is the same array, not an equal one.

# %%
darker = shot.expose(exposure_s=shot.exposure_s / 8, seed=2)
assert np.shares_memory(darker.irradiance, shot.irradiance)
for channel in darker.report()["sensor"]["channels"]:
    print(channel["filter"], f"{channel['mean_e']:.0f} electrons on average, {channel['snr_db']:.1f} dB")
darker

# %% [markdown]
# Another aperture traces and images anew. Near and far things are less sharp at f/2.1 than at f/11.

# %%
figure, axes = plt.subplots(1, 2, figsize=(12, 4))
for axis, f_number in zip(axes, (2.1, 11)):
    axis.imshow(camera.with_(f_number=f_number).render(quality=shot.quality).rgb)
    axis.set_title(f"f/{f_number}")
    axis.axis("off")
plt.show()
