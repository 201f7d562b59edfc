"""A camera is a value: it never changes, and what is kept is never computed twice."""

import math
import pickle

import dioptric as dp
import numpy as np
import pytest


def made(camera: dp.Camera, act) -> dict[str, int]:
    """Returns the stages that were run."""
    before = camera.stage_counts()
    act()
    return {stage: n - before[stage] for stage, n in camera.stage_counts().items() if n != before[stage]}


def test_change_leaves_the_camera_as_it_was(tiny: dp.Camera) -> None:
    before = tiny.to_ron()
    wide = tiny.with_(f_number=2.8)
    assert tiny.to_ron() == before and wide.to_ron() != before
    assert wide.with_(f_number=4) == tiny and wide != tiny


def test_new_exposure_never_images_again(tiny: dp.Camera) -> None:
    shot = tiny.render()
    # More cameras than results are kept of.
    for focus in (800, 1100, 1600, 2400):
        tiny.with_(focus_mm=focus).render()
    assert made(tiny, lambda: shot.expose(seed=4)) == {"frames": 1, "picture": 1}
    assert made(tiny, lambda: shot.expose(exposure_s=0.01, noise="none")) == {"frames": 1, "picture": 1}


def test_processing_changes_the_picture_alone(tiny: dp.Camera) -> None:
    shot = tiny.render()
    assert made(tiny, lambda: shot.develop(white="gray-world", demosaic="bilinear")) == {"picture": 1}
    assert np.array_equal(shot.develop(white="none").raw, shot.raw)


def test_longer_exposure_gathers_more(shot: dp.Shot) -> None:
    short, long = (shot.expose(exposure_s=t, noise="none") for t in (0.001, 0.002))
    # Without noise electrons are the rate times the time, in single precision.
    unsaturated = long.electrons < 0.5 * long.electrons.max()
    np.testing.assert_allclose(long.electrons[unsaturated], 2 * short.electrons[unsaturated], rtol=1e-6)
    assert long.exposure_s == 0.002


def test_seed_draws_other_noise_and_the_same_again(shot: dp.Shot) -> None:
    a, b, c = (shot.expose(seed=seed) for seed in (5, 6, 5))
    assert np.array_equal(a.raw, c.raw) and not np.array_equal(a.raw, b.raw)


def test_file_dictionary_and_pickle_give_the_camera_back(tiny: dp.Camera, tmp_path) -> None:
    assert dp.Camera.from_ron(tiny.to_ron()) == tiny
    data = tiny.to_dict()
    # Infinity stays what it is, which JSON could not say.
    assert math.isinf(data["exposure"]["Auto"]["limit"]["time_s"])
    assert dp.Camera.from_dict(data) == tiny
    assert pickle.loads(pickle.dumps(tiny)) == tiny
    tiny.write(tmp_path / "camera.ron")
    assert dp.Camera.read(tmp_path / "camera.ron") == tiny
    far = tiny.with_(focus_mm=math.inf)
    assert far.to_dict()["focus"] == {"DistanceMm": math.inf} and dp.Camera.from_dict(far.to_dict()) == far


def test_every_choice_survives_a_dictionary(tiny: dp.Camera) -> None:
    for change in (
        {"focus_mm": "near"},
        {"film_mm": 40.0},
        {"film": "scene"},
        {"diffraction": "wave"},
        {"diffraction": "hurb", "gamma": 1.5},
        {"burst": 4},
        {"bracket_stops": [-2, 0]},
        {"interleaved_ratio": 8},
        {"interleaved_gain_ratio": 4},
        {"dual_pixel": "left-right"},
        {"dual_pixel": "quad:0.1:2"},
        {"noise": "photon,read"},
        {"white": "patch:1,2,3,4"},
        {"white": "0.46,0.414"},
        {"exposure_s": 0.01, "analog_gain": 2},
        {"lens": dp.Lens.thin(50, 10)},
        {"illuminant": "A", "illuminance_lux": 50},
        {"wavelengths_nm": "scene"},
    ):
        changed = tiny.with_(**change)
        assert dp.Camera.from_dict(changed.to_dict()) == changed, change
        assert dp.Camera.from_ron(changed.to_ron()) == changed, change


def test_automatic_exposure_comes_back(shot: dp.Shot) -> None:
    by_hand = shot.expose(exposure_s=0.001)
    assert by_hand.expose(exposure_s="auto").exposure_s == shot.exposure_s


def test_camera_shows_its_parts(tiny: dp.Camera) -> None:
    assert tiny.lens.name == "dgauss-50mm" and tiny.lens.f_number == pytest.approx(4.0, rel=1e-9)
    assert tiny.sensor == dp.Sensor.built_in("nikon-d5100")
    assert tiny.scene.shape == (31, 36, 54)
    assert tiny.with_(lens=tiny.lens, scene=tiny.scene) == tiny


def test_new_lens_forgets_the_stop_of_the_old(tiny: dp.Camera) -> None:
    assert tiny.with_(lens="fisheye-12.5mm").to_dict()["stop"] == "AsGiven"
    stopped = dp.Lens.built_in("dgauss-50mm").with_stop(f_number=8)
    assert tiny.with_(lens=stopped) == tiny.with_(f_number=8)


def test_sensor_brings_its_pixels(tiny: dp.Camera) -> None:
    assert tiny.with_(sensor="imx363").to_dict()["film"] == "Sensor"
    small = tiny.with_(sensor="imx363", pixels=(40, 30), pixel_um=2)
    assert small.to_dict()["film"] == {"Pixels": {"columns": 40, "rows": 30, "pitch_um": 2.0}}


def test_preview_has_fewer_samples(tiny: dp.Camera) -> None:
    large = tiny.with_(pixels=(960, 64), pixel_um=33)
    preview = large.render(quality="preview")
    assert preview.shape == (32, 480) and preview.quality == "preview" and preview.pitch_um == 66


def test_report_has_the_numbers_of_the_run(shot: dp.Shot) -> None:
    report = shot.report()
    assert report["film"] == {"columns": 48, "rows": 32, "pitch_um": 660.0, "dark_fraction": 0.0}
    np.testing.assert_allclose(report["irradiance"]["mean_w_m2_nm"], shot.irradiance.mean(axis=(1, 2)), rtol=1e-5)


def test_notebook_shows_picture_and_table(shot: dp.Shot) -> None:
    html = shot._repr_html_()
    assert "data:image/png;base64," in html and "48 × 32" in html
    assert shot._repr_png_().startswith(b"\x89PNG")
    assert dp.Lens.built_in("dgauss-50mm")._repr_html_().startswith("<svg")


def test_xarray_has_coordinates_units_and_the_same_memory(shot: dp.Shot) -> None:
    pytest.importorskip("xarray")
    data = shot.to_xarray()
    irradiance = data["irradiance"]
    assert irradiance.dims == ("wavelength", "y", "x") and irradiance.attrs["units"] == "W m-2 nm-1"
    assert irradiance.sel(wavelength=550).shape == (32, 48)
    assert np.shares_memory(irradiance.values, shot.irradiance)
    assert data["x"].values[0] == pytest.approx(-0.66 * 23.5) and data["x"].attrs["units"] == "mm"
    assert data["y"].values[0] > data["y"].values[-1]
