"""All that a camera is made of goes to other processes and comes back the same."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import dioptric as dp
import numpy as np
import pytest


@pytest.fixture(scope="module")
def own(tiny: dp.Camera) -> dp.Camera:
    """A camera of which scene, lens and sensor are in no file."""
    radiance = 0.02 * np.random.default_rng(1).random((3, 20, 30), dtype=np.float32)
    scene = dp.Scene.from_array(radiance, [450, 550, 650], depth_m=2.0, fov_deg=30, light="D65", illuminance_lux=500, name="own")
    lens = dp.Lens.built_in("dgauss-50mm").with_surface(0, radius_mm=30.0)
    sensor = dp.Sensor.built_in("nikon-d5100").with_(read_noise_v=0.0)
    return tiny.with_(scene=scene, lens=lens, sensor=sensor, pixels=(30, 20), pixel_um=900, wavelengths_nm="scene")


def test_parts_come_back_equal(own: dp.Camera, tiny: dp.Camera) -> None:
    world = dp.Scene.world("still-life", samples=8, size=(30, 20))
    for part in (own, own.scene, own.lens, own.sensor, tiny, tiny.scene, tiny.lens, tiny.sensor, world):
        assert pickle.loads(pickle.dumps(part)) == part
        assert copy.deepcopy(part) is part and copy.copy(part) is part
    assert np.array_equal(pickle.loads(pickle.dumps(own.scene)).to_array(), own.scene.to_array())
    # A stopped lens can still be opened.
    assert pickle.loads(pickle.dumps(tiny.lens)).with_stop(f_number=2.2) == tiny.lens.with_stop(f_number=2.2)
    # What files can name still has its name.
    assert tiny.with_(lens=pickle.loads(pickle.dumps(tiny.lens))).to_ron() == tiny.to_ron()
    other = own.with_(scene=dp.Scene.from_array(np.ones((3, 20, 30)), [450, 550, 650], depth_m=2.0, fov_deg=30))
    assert other != own


def test_arrays_pass_beside_the_stream() -> None:
    scene = dp.Scene.from_array(np.ones((3, 200, 300)), [450, 550, 650], depth_m=2.0, fov_deg=30)
    beside: list[pickle.PickleBuffer] = []
    stream = pickle.dumps(scene, protocol=5, buffer_callback=beside.append)
    # Three bands and the depth, of 4 bytes a sample.
    assert len(stream) < 4000 and sum(buffer.raw().nbytes for buffer in beside) == 4 * 4 * 200 * 300
    assert pickle.loads(stream, buffers=beside) == scene


@pytest.mark.parametrize("quality", ["full", "preview"])
def test_shot_comes_back_to_the_bit(own: dp.Camera, quality: str) -> None:
    shot = own.render(quality=quality)
    back = pickle.loads(pickle.dumps(shot))
    for name in ("irradiance", "electron_rate", "electrons", "volts", "raw", "picture", "rgb", "wavelengths_nm"):
        assert np.array_equal(getattr(back, name), getattr(shot, name)), name
    assert back.quality == quality and back.film_mm == shot.film_mm and back.levels == shot.levels
    assert back.camera.stage_counts()["irradiance"] == 0
    assert np.array_equal(back.expose(seed=5).raw, shot.expose(seed=5).raw)


def test_shot_of_dual_pixels_and_of_mean_lux_comes_back(tiny: dp.Camera) -> None:
    for camera in (tiny.with_(dual_pixel="left-right"), tiny.with_(mean_lux=20)):
        shot = camera.render()
        back = pickle.loads(pickle.dumps(shot))
        assert np.array_equal(back.raw, shot.raw) and np.array_equal(back.irradiance, shot.irradiance)
        assert back.png() == shot.png()


def test_psf_keeps_what_is_known_of_it() -> None:
    psf = dp.Lens.thin(50, 10).psf(field_deg=[0, 5], film_mm=50, shape=9)
    back = pickle.loads(pickle.dumps(psf))
    assert np.array_equal(back, psf) and np.array_equal(back.energy, psf.energy) and back.pixel_um == psf.pixel_um
    assert np.array_equal(pickle.loads(pickle.dumps(psf[0])), psf[0])
    with pytest.raises(AttributeError, match="not of a part of it"):
        psf[0].energy


def noisy(job: tuple[dp.Camera, int]) -> np.ndarray:
    """In another process."""
    camera, seed = job
    return camera.with_(seed=seed).render().raw.copy()


def test_process_pool_takes_own_scenes(own: dp.Camera) -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        taken = list(pool.map(noisy, [(own, seed) for seed in (1, 2)]))
    assert np.array_equal(taken[0], own.with_(seed=1).render().raw) and not np.array_equal(*taken)


def test_joblib_takes_shots(own: dp.Camera) -> None:
    joblib = pytest.importorskip("joblib")
    shot = own.render()
    means = joblib.Parallel(n_jobs=2)(joblib.delayed(lambda s, seed: s.expose(seed=seed).raw.mean())(shot, n) for n in (1, 2))
    assert means == [shot.expose(seed=n).raw.mean() for n in (1, 2)]
