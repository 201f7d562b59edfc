"""Results are views of the memory that made them: the same address, read-only, alive as long as an array is."""

import gc
import time
from collections.abc import Callable

import dioptric as dp
import numpy as np
import pytest


def address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def test_results_have_their_shapes_and_types(shot: dp.Shot) -> None:
    found = {
        name: (getattr(shot, name).shape, getattr(shot, name).dtype)
        for name in ("irradiance", "electron_rate", "electrons", "volts", "raw", "picture", "rgb", "depth_m")
    }
    assert found == {
        "irradiance": ((3, 32, 48), np.float32),
        "electron_rate": ((32, 48), np.float32),
        "electrons": ((32, 48), np.float32),
        "volts": ((32, 48), np.float32),
        "raw": ((32, 48), np.uint16),
        "picture": ((32, 48, 3), np.float32),
        "rgb": ((32, 48, 3), np.uint8),
        "depth_m": ((36, 54), np.float32),
    }
    assert shot.wavelengths_nm.tolist() == [450, 550, 650]
    assert np.array_equal(shot.rgb, np.floor(255 * shot.picture.clip(0, 1) + np.float32(0.5)))


@pytest.mark.parametrize("name", ["irradiance", "electrons", "volts", "raw", "picture", "rgb", "wavelengths_nm"])
def test_view_has_the_results_address_and_is_read_only(shot: dp.Shot, name: str) -> None:
    first, second = getattr(shot, name), getattr(shot, name)
    # NumPy copied nothing of the memory that the result's owner names, at any access.
    assert address(first) == address(second) == first.base.address
    assert not first.flags.writeable and not first.flags.owndata
    with pytest.raises(ValueError):
        first[...] = 0
    with pytest.raises(ValueError):
        first.setflags(write=True)


def test_shots_share_what_neither_changed(shot: dp.Shot) -> None:
    other = shot.expose(seed=3)
    assert address(other.irradiance) == address(shot.irradiance)
    assert address(other.raw) != address(shot.raw)


def test_view_outlives_its_shot(tiny: dp.Camera) -> None:
    shot = tiny.with_(focus_mm=1234).render()
    view = shot.irradiance
    before = view.copy()
    del shot
    for focus in (1300, 1400, 1500):
        tiny.with_(focus_mm=focus).render()
    gc.collect()
    assert np.array_equal(view, before)


def best_of(n: int, act: Callable[[], object]) -> float:
    """Returns the shortest of several times, s: what other programs took of the machine is not the call's."""
    times = []
    for _ in range(n):
        start = time.perf_counter()
        act()
        times.append(time.perf_counter() - start)
    return min(times)


def test_large_view_takes_no_time() -> None:
    """76 MB in less than a millisecond."""
    cube = np.full((31, 640, 960), 0.01, np.float32)
    scene = dp.Scene.from_array(cube, np.arange(400, 701, 10), depth_m=2.0, fov_deg=30)
    lens = dp.Lens.thin(50, 10)
    camera = dp.Camera.demo().with_(lens=lens, scene=scene, wavelengths_nm="scene", diffraction="none", blur="pointwise")
    shot = camera.render(quality="draft")
    assert shot.irradiance.nbytes == 11 * 640 * 960 * 4
    assert best_of(20, lambda: shot.irradiance) < 1e-3


def test_spilled_irradiance_is_read_once(tiny: dp.Camera, shot: dp.Shot) -> None:
    fresh = dp.Camera.from_ron(tiny.to_ron())
    spilled = fresh.render(memory_bytes=1000)
    assert np.array_equal(spilled.irradiance, shot.irradiance)
    assert address(spilled.irradiance) == address(spilled.irradiance)
    assert spilled.png() == shot.png()
