# %% [markdown]
# # Fit a lens's focus to a measured point spread
#
# A point spread was measured; where did the film stand? Point spreads of the lens are compared with it until the best place is found. Here the measurement is
# one of a known place, with noise, so that the answer can be judged.

# %%
import os

import dioptric as dp
import matplotlib.pyplot as plt
import numpy as np

SMALL = "DIOPTRIC_SMALL" in os.environ
lens = dp.Lens.built_in("dgauss-50mm").with_stop(f_number=2.8)
NOMINAL_MM = lens.film_mm_for(2000)
TRUE_MM = NOMINAL_MM + 0.137
view = dict(distance_mm=2000, field_deg=7.0, wavelengths_nm=[500, 550, 600], pixel_um=3.0, shape=65)


def modelled(film_mm):
    """The point spread of all wavelengths, of energy 1."""
    psf = lens.psf(film_mm=film_mm, **view).sum(axis=0)
    return psf / psf.sum()


rng = np.random.default_rng(1)
N_ELECTRONS = 50_000
measured = rng.poisson(N_ELECTRONS * modelled(TRUE_MM)) / N_ELECTRONS


def misfit(film_mm):
    """How unlikely the measurement is: Poisson's, up to a constant."""
    expected = modelled(film_mm) + 1e-7
    return float((expected - measured * np.log(expected)).sum())


# %% [markdown]
# A point spread on either side of the focus is not the same, since the lens has spherical aberration and is off its axis: one minimum is the lower.

# %%
coarse_mm = NOMINAL_MM + np.linspace(-0.4, 0.4, 9 if SMALL else 33)
curve = [misfit(film_mm) for film_mm in coarse_mm]
plt.plot(1e3 * (coarse_mm - NOMINAL_MM), curve, "o-")
plt.xlabel("film behind the nominal place, µm")
plt.ylabel("misfit")
plt.show()

# %%
best, step = coarse_mm[int(np.argmin(curve))], coarse_mm[1] - coarse_mm[0]
low, high = best - step, best + step
golden = (np.sqrt(5) - 1) / 2
while high - low > 1e-3:
    a, b = high - golden * (high - low), low + golden * (high - low)
    if misfit(a) < misfit(b):
        high = b
    else:
        low = a
fitted_mm = (low + high) / 2
print(f"true {1e3 * (TRUE_MM - NOMINAL_MM):.1f} µm, fitted {1e3 * (fitted_mm - NOMINAL_MM):.1f} µm behind the nominal place")
assert abs(fitted_mm - TRUE_MM) < 0.005

# %%
figure, axes = plt.subplots(1, 3, figsize=(10, 3))
for axis, (name, psf) in zip(axes, {"measured": measured, "fitted": modelled(fitted_mm), "nominal": modelled(NOMINAL_MM)}.items()):
    axis.imshow(psf**0.5, cmap="magma")
    axis.set_title(name)
    axis.axis("off")
plt.show()
