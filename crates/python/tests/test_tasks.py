"""What users of the package do all day: twenty tasks of twelve lines at most, from docs/python.md alone."""

import inspect
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import dioptric as dp
import numpy as np
import pytest


@pytest.fixture
def cam() -> dp.Camera:
    scene = dp.Scene.still_life(54, 36)
    return dp.Camera.demo().with_(scene=scene, pixels=(48, 32), pixel_um=660, wavelengths_nm=[450, 550, 650])


def test_picture_and_its_numbers(tmp_path: Path) -> None:
    shot = dp.Camera.demo().with_(scene=dp.Scene.still_life(108, 72)).render(quality="sketch")
    shot.save(tmp_path / "picture.png")
    assert shot.rgb.shape == (107, 160, 3) or shot.rgb.shape[1] == 160
    assert 20 < shot.rgb.mean() < 235 and (tmp_path / "picture.png").stat().st_size > 1000


def test_exposure_series_of_one_image(cam: dp.Camera) -> None:
    shot = cam.render()
    times = shot.exposure_s * np.array([0.25, 0.5, 1, 2])
    means = [shot.expose(exposure_s=t, noise="none").electrons.mean() for t in times]
    assert np.all(np.diff(means) > 0)


def test_own_lens_from_arrays_to_its_mtf() -> None:
    lens = dp.Lens.from_surfaces({
        "radius_mm": [61.0, -44.6, -129.9], "thickness_mm": [9.0, 2.5, 0.0], "semi_aperture_mm": [12.0] * 3,
        "medium": ["N-BK7", "N-SF5", None],
    }, stop=0).with_stop(f_number=8)
    frequencies = [10, 20, 40]
    row = lens.psf_table(mtf_per_mm=frequencies, wavelengths_nm=588, pixel_um=2, shape=201)[0]
    mtf = [at["tangential"] for at in row["mtf"]]
    assert 80 < lens.efl_mm < 120 and 1 > mtf[0] > mtf[1] > mtf[2] > 0


def test_radius_is_fitted_to_a_focal_length() -> None:
    lens = dp.Lens.from_surfaces([
        dict(radius_mm=50.0, thickness_mm=4.0, semi_aperture_mm=8.0, medium=1.5, stop=True),
        dict(radius_mm=-50.0, thickness_mm=0.0, semi_aperture_mm=8.0),
    ])
    low, high = 20.0, 200.0
    for _ in range(40):
        radius = (low + high) / 2
        low, high = (radius, high) if lens.with_surface(0, radius_mm=radius).efl_mm < 60 else (low, radius)
    assert lens.with_surface(0, radius_mm=radius).efl_mm == pytest.approx(60)


def test_spot_by_rays(cam: dp.Camera) -> None:
    lens = cam.lens
    y, x = np.mgrid[-6:6:25j, -6:6:25j]
    origins = np.stack([x, y, np.full_like(x, -10)], axis=-1)
    rays = lens.trace(origins, [0, 0, 1], film_mm=lens.film_mm_for(np.inf))
    assert rays.x_mm.shape == (25, 25)
    assert 1e-4 < np.hypot(rays.x_mm, rays.y_mm)[rays.passed].mean() < 0.1


def test_focal_shift_with_color() -> None:
    lens = dp.Lens.from_surfaces([
        dict(radius_mm=50, thickness_mm=4, semi_aperture_mm=8, medium="N-BK7", stop=True),
        dict(radius_mm=-50, thickness_mm=0, semi_aperture_mm=8),
    ])
    colors = np.linspace(450, 650, 5)
    rays = lens.trace([0, 0.1, -5], [0, 0, 1], colors)
    focus = rays.z_mm - rays.y_mm * rays.n / rays.m
    assert np.all(np.diff(focus) > 0) and len(rays) == 5


def test_psf_stack_with_energies_to_tensors() -> None:
    lens = dp.Lens.built_in("dgauss-50mm").with_stop(f_number=2)
    psf = lens.psf(field_deg=[0, 7, 14], distance_mm=2000, wavelengths_nm=[450, 550, 650], pixel_um=4, shape=65)
    bright = psf * psf.energy[..., None, None]
    stack = np.moveaxis(np.asarray(bright), 1, -1).copy()              # torch.from_numpy(stack) takes it
    assert stack.shape == (3, 65, 65, 3) and stack.dtype == np.float64 or stack.dtype == np.float32
    assert 0.95 < psf.energy[0, 1] < 0.98 and psf.energy[2, 1] < 0.8  # surfaces and rims take the rest


def test_psf_map_over_the_film() -> None:
    lens = dp.Lens.built_in("dgauss-50mm").with_stop(f_number=4)
    places = [(x, y) for x in (-10, 0, 10) for y in (-6, 6)]
    psf = lens.psf(film_xy_mm=places, distance_mm=3000, pixel_um=4, shape=33)
    assert psf.shape == (6, 33, 33)
    # Chief rays go to the places; coma moves the centroids by micrometres.
    np.testing.assert_allclose(np.stack([psf.x_mm, psf.y_mm], axis=1), places, atol=0.05)


def test_own_scene_from_arrays(cam: dp.Camera) -> None:
    radiance = np.zeros((3, 40, 60), np.float32)
    radiance[:, 10:30, 20:40] = 0.02
    scene = dp.Scene.from_array(radiance, [450, 550, 650], depth_m=1.0, fov_deg=30)
    shot = cam.with_(scene=scene, focus_mm=1000, wavelengths_nm="scene").render()
    middle = shot.irradiance[:, 14:18, 22:26].mean()
    assert middle > 20 * shot.irradiance[:, :4, :4].mean()


def test_own_noise_model_is_developed(cam: dp.Camera) -> None:
    shot, rng = cam.render(), np.random.default_rng(1)
    electrons = rng.poisson(shot.electron_rate * shot.exposure_s) + rng.normal(0, 3, shot.shape)
    levels = shot.levels
    dn = levels["black"] + electrons * levels["volts_per_electron"] / levels["step_v"]
    raw = np.clip(np.rint(dn), 0, levels["top"]).astype(np.uint16)
    mine = dp.develop(raw, sensor=cam.sensor, exposure_s=shot.exposure_s, illuminant="D65")
    assert mine.rgb.shape == shot.rgb.shape and dp.measure.compare(mine, shot.develop(white="D65"))["psnr_db"] > 15


def test_own_mosaic_is_developed() -> None:
    raw = np.full((40, 60), 100, np.uint16)
    raw[0::2, 0::2] = 300                                               # red
    raw[1::2, 1::2] = 200                                               # blue
    frame = dp.develop(raw, cfa="RGGB", black=50, saturation=1023, white="none", curve="linear", sharpen_px=0)
    r, g, b = frame.picture[10:30, 10:50].mean(axis=(0, 1))
    assert r / g == pytest.approx(250 / 50, rel=0.01) and b / g == pytest.approx(150 / 50, rel=0.01)
    assert any("color matrix" in note for note in frame.notes)


def test_emva_of_own_frames() -> None:
    rng = np.random.default_rng(2)
    def take(electrons: float) -> np.ndarray:
        return np.rint(50 + 0.5 * rng.poisson(electrons, (2, 128, 128)) + rng.normal(0, 2, (2, 128, 128)))
    series = [(0.01, photons, take(0.6 * photons)) for photons in (0, 500, 1000, 2000, 4000)]
    numbers = dp.measure.emva(series)
    assert numbers["gain_dn_per_e"] == pytest.approx(0.5, rel=0.03)
    assert numbers["quantum_efficiency"] == pytest.approx(0.6, rel=0.03)


def test_sensor_on_the_bench() -> None:
    sensor = dp.Sensor.built_in("nikon-d5100")
    quiet = sensor.with_(read_noise_v=sensor.to_dict()["read_noise_v"] / 4)
    dark = [dp.measure.bench(s, size=64, levels=6, stack=4)["data_sheet"]["dark_noise_e"] for s in (sensor, quiet)]
    assert dark[1] < dark[0]


def test_sharpness_falls_out_of_focus(cam: dp.Camera) -> None:
    bar = dp.Scene.target("slanted-bar", 240, 160, fov_deg=36, depth_m=1)
    bench = cam.with_(scene=bar, pixels=(120, 80), pixel_um=264, f_number=2)
    sharp, soft = (
        dp.measure.sfr(bench.with_(focus_mm=mm).render(), region=(30, 10, 60, 60))["channels"][1]
        for mm in (1000, 900)
    )
    assert soft["mtf50_cycles_per_pixel"] < sharp["mtf50_cycles_per_pixel"]


def test_colors_of_a_chart(cam: dp.Camera) -> None:
    chart = dp.Scene.target("color-chart", 180, 120, fov_deg=30, depth_m=2, illuminance_lux=2000)
    bands = np.arange(410, 691, 20)
    shot = cam.with_(scene=chart, pixels=(150, 100), pixel_um=170, focus_mm=2000, wavelengths_nm=bands).render()
    auto, none = (dp.measure.color(shot.develop(color=color), illuminant="D65") for color in ("auto", "none"))
    assert auto["mean_delta_e"] < none["mean_delta_e"] and len(auto["patches"]) == 24


def test_two_developments_compared(cam: dp.Camera) -> None:
    shot = cam.render()
    softer = shot.develop(denoise=1.0)
    result = dp.measure.compare(shot, softer)
    assert 0.3 < result["ssim"] < 1 and result["scielab"]["mean"] > 0


def draw(job: tuple[dp.Camera, int]) -> np.ndarray:
    camera, seed = job
    rng = np.random.default_rng(seed)
    return camera.with_(f_number=rng.uniform(2.4, 8), seed=seed).render().rgb.copy()


def test_augmentation_pool_with_own_scenes(cam: dp.Camera) -> None:
    rng = np.random.default_rng(0)
    scenes = [dp.Scene.from_array(0.02 * rng.random((3, 36, 54)), [450, 550, 650], depth_m=2, fov_deg=36) for _ in range(2)]
    jobs = [(cam.with_(scene=scene, wavelengths_nm="scene"), n) for n, scene in enumerate(scenes)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        pictures = np.stack(list(pool.map(draw, jobs)))
    assert pictures.shape == (2, 32, 48, 3)


def test_shot_is_kept_and_exposed_later(cam: dp.Camera, tmp_path: Path) -> None:
    shot = cam.render()
    (tmp_path / "shot.pickle").write_bytes(pickle.dumps(shot, protocol=5))
    later = pickle.loads((tmp_path / "shot.pickle").read_bytes())
    assert np.array_equal(later.raw, shot.raw)
    assert np.array_equal(later.expose(seed=4).raw, shot.expose(seed=4).raw)


def test_world_from_a_file(cam: dp.Camera, tmp_path: Path) -> None:
    (tmp_path / "wall.obj").write_text("v -0.3 -2 0\nv 0.3 -2 0\nv 0.3 2 0\nv -0.3 2 0\nf 1 2 3 4\n")
    world = dp.Scene.world(tmp_path / "wall.obj", eye=(0, 0, 2), look_at=(0, 0, 0), sky="even:0.01", samples=16, size=(48, 32))
    shot = cam.with_(scene=world, focus_mm=2000).render()
    wall, sky = shot.irradiance[1, :, 22:26].mean(), shot.irradiance[1, :, :6].mean()
    assert 0 < wall < sky                                               # a gray post before the sky
    aside = dp.Scene.world(tmp_path / "wall.obj", eye=(0.5, 0, 2), look_at=(0.5, 0, 0), sky="even:0.01", samples=16, size=(48, 32))
    darkest = cam.with_(scene=aside, focus_mm=2000).render().irradiance[1].mean(axis=0).argmin()
    assert darkest < 22                                                 # the post went to the left


def test_video_of_a_turning_camera(cam: dp.Camera) -> None:
    video = cam.with_(pixels=(90, 60), pixel_um=352, exposure_s=0.005).video(frames=3, frames_per_s=30, pan_deg_per_s=60)
    assert len(video) == 3 and video.shape == (60, 90)
    frames = np.stack([frame.rgb for frame in video])
    turned = [frame.facts["first_row_deg"][0] for frame in video]
    assert frames.shape == (3, 60, 90, 3) and turned[2] - turned[0] == pytest.approx(4, abs=0.1)


def test_tasks_are_twenty_and_short() -> None:
    tasks = [f for name, f in inspect.getmembers(sys.modules[__name__], inspect.isfunction)
             if name.startswith("test_") and name != "test_tasks_are_twenty_and_short"]
    assert len(tasks) == 20
    for task in tasks:
        assert len(inspect.getsource(task).strip().splitlines()) <= 13, task.__name__
