# %% [markdown]
# # A data set of pictures with random cameras
#
# A plan draws cameras at random; a sweep takes their pictures into a store, each with what it was taken by: labels for depth from defocus, denoising, or
# blind estimation of a lens. A thousand pictures take ten minutes of a processor; on many machines `python -m dioptric.ray` or `--shard` make the same store
# ([docs/sweep.md](../sweep.md)).

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from dioptric.sweep import Plan, Store, Sweep
from dioptric.torch import Dataset

SMALL = "DIOPTRIC_SMALL" in os.environ
N = 6 if SMALL else 1000
scratch = tempfile.TemporaryDirectory()               # removed when Python ends
folder = Path(scratch.name)
plan = Plan.from_ron(
    """(
    base: Camera((
        name: "random", lens: BuiltIn("dgauss-50mm"), focus: DistanceMm(960.0), sensor: BuiltIn("imx363"),
        film: Pixels(columns: 144, rows: 96, pitch_um: 220.0),
        scene: (source: StillLife(columns: 162, rows: 108)),
        wavelengths: Range(first_nm: 420.0, last_nm: 680.0, step_nm: 20.0),
    )),
    vary: [Random(count: %d, seed: 1, axes: {
        "lens.BuiltIn": Choice(["dgauss-50mm", "canon-50mm", "cooke-50mm", "tessar-50mm"]),
        "stop.FNumber": LogUniform(least: 2.5, most: 16),
        "focus.DistanceMm": LogUniform(least: 700, most: 3000),
        "scene.illuminance_lux": LogUniform(least: 10, most: 1000),
        "seed": Whole(least: 1, most: 1000000),
    })],
    outputs: (raw: true, depth: true),
)"""
    % N,
    folder / "plan.ron",
)
sweep = Sweep(plan)
counts = sweep.run()
print(counts)
# Lenses that do not open to what was drawn are refused, which is a result.
assert counts["done"] + counts["refused"] == N and counts["done"] >= N // 3

# %%
store = Store(plan.store)
figure, axes = plt.subplots(2, 3, figsize=(12, 5))
for axis in axes.flat:
    axis.axis("off")
for axis, item in zip(axes.flat, store.done):
    axis.imshow(item.array("picture"))
    values = item.values
    axis.set_title(f"{values['lens.BuiltIn']} f/{values['stop.FNumber']:.1f} {values['focus.DistanceMm']:.0f} mm", fontsize=8)
plt.show()

# %% [markdown]
# As a table, and as a data set for PyTorch (`DataLoader(data, batch_size=8, num_workers=4)`).

# %%
light = np.array([item.values["scene.illuminance_lux"] for item in store.done])
time_s = np.array([item.metrics["exposure_time_s"] for item in store.done])
plt.loglog(light, time_s, "o")
plt.xlabel("illuminance, lux")
plt.ylabel("metered exposure, s")
plt.show()
data = Dataset(store, ["picture", "raw", "depth", "stop.FNumber", "focus.DistanceMm"])
print(len(data), "samples")
assert np.corrcoef(np.log(light), np.log(time_s))[0, 1] < 0
