"""Scenes and sensors made of arrays and dictionaries are those they equal."""

import pickle
import subprocess
from pathlib import Path

import dioptric as dp
import numpy as np
import pytest


def test_scene_of_arrays_images_as_its_source(tiny: dp.Camera) -> None:
    target = dp.Scene.target("checkerboard", 54, 36, size=6, fov_deg=36, depth_m=1.2)
    arrays = dp.Scene.from_array(
        target.to_array(), target.wavelengths_nm, depth_m=target.depth_m, fov_deg=36, light="D65", name="copy"
    )
    a, b = (tiny.with_(scene=scene, wavelengths_nm="scene").render() for scene in (target, arrays))
    assert a.irradiance.any() and np.array_equal(a.irradiance, b.irradiance)
    assert np.array_equal(a.raw, b.raw)


def test_uniform_scene_has_the_camera_equation() -> None:
    radiance = 0.02
    scene = dp.Scene.from_array(np.full((3, 40, 60), radiance), [450, 550, 650], depth_m=1000, fov_deg=20)
    lens = dp.Lens.thin(50, 12.5)
    camera = dp.Camera.demo().with_(
        lens=lens, scene=scene, focus_mm=1e6, pixels=(24, 16), pixel_um=300, wavelengths_nm="scene", diffraction="none"
    )
    middle = camera.render().irradiance[:, 7:9, 11:13]
    # The film's projected solid angle of a disc seen under the tangent 1 / (2 N), at f/4 but for the focus at 1 km, for which the
    # film lies 5e-5 of f farther: E = π L / (4 N² + 1).
    f_number = 4.0 * (1 + 50 / 1e6)
    np.testing.assert_allclose(middle, np.pi * radiance / (4 * f_number**2 + 1), rtol=5e-5)


def test_radiance_comes_back_as_it_was() -> None:
    rng = np.random.default_rng(3)
    radiance = rng.random((4, 5, 6), dtype=np.float32)
    depth = 1 + rng.random((5, 6), dtype=np.float32)
    scene = dp.Scene.from_array(radiance, [400, 500, 600, 700], depth_m=depth, fov_deg=30, name="noise")
    assert np.array_equal(scene.to_array(), radiance) and np.array_equal(scene.depth_m, depth)
    assert np.array_equal(scene.band(2), radiance[2]) and not scene.band(2).flags.writeable
    assert scene.shape == (4, 5, 6) and scene.name == "noise"
    with pytest.raises(ValueError, match="band is 4, expected 0 to 3"):
        scene.band(4)


def test_written_scene_is_read_back(tmp_path: Path) -> None:
    scene = dp.Scene.target("checkerboard", 40, 30, size=5, fov_deg=10, depth_m=3)
    scene.write(tmp_path / "a.exr")
    back = dp.Scene.read(tmp_path / "a.exr")
    assert np.array_equal(back.to_array(), scene.to_array()) and np.array_equal(back.depth_m, scene.depth_m)


def test_target_under_its_light() -> None:
    scene = dp.Scene.target("uniform", 8, 6, fov_deg=10, depth_m=3, illuminance_lux=314.159265)
    # A white under E lux has E / π cd/m²; beyond the bands, 400-700 nm, the eye sees less than a thousandth.
    assert scene.mean_luminance_cd_m2 == pytest.approx(100, rel=1e-3)
    with pytest.raises(ValueError, match="depth_m is missing"):
        dp.Scene.target("uniform", 8, 6, fov_deg=10)
    with pytest.raises(ValueError, match="pattern is 'stripes'"):
        dp.Scene.target("stripes", 8, 6, fov_deg=10, depth_m=3)


def test_sensor_is_a_dictionary_and_back() -> None:
    for name in dp.Sensor.names():
        sensor = dp.Sensor.built_in(name)
        assert dp.Sensor.from_dict(sensor.to_dict()) == sensor == pickle.loads(pickle.dumps(sensor)), name


def test_sensor_with_another_pitch_is_another() -> None:
    sensor = dp.Sensor.built_in("imx363")
    coarse = sensor.with_(pixel_pitch_um=2.8, rows=100, columns=200)
    assert coarse.pixel_pitch_um == 2.8 and coarse.shape == (100, 200) and sensor.pixel_pitch_um != 2.8
    with pytest.raises(ValueError, match="pixel_pitch_um"):
        sensor.with_(pixel_pitch_um=-1.0)
    with pytest.raises(ValueError, match="unknown field `pitch`"):
        sensor.with_(pitch=1.0)


def test_quantum_efficiency_is_a_table() -> None:
    sensor = dp.Sensor.built_in("nikon-d5100")
    table = sensor.quantum_efficiency(np.arange(400, 701, 50))
    assert table.shape == (len(sensor.filters), 7) and (table >= 0).all() and (table < 1).all()


def test_given_sensor_takes_the_picture(tiny: dp.Camera, shot: dp.Shot) -> None:
    by_hand = dp.Sensor.from_ron(dp.Sensor.built_in("nikon-d5100").to_ron())
    camera = tiny.with_(sensor=by_hand, pixels=(48, 32), pixel_um=660)
    assert np.array_equal(camera.render().raw, shot.raw)
    silent = camera.with_(sensor=by_hand.with_(read_noise_v=0.0), pixels=(48, 32), pixel_um=660)
    assert not np.array_equal(silent.render().raw, shot.raw)


def test_options_of_scenes_are_those_of_the_program(tiny: dp.Camera, program: Path, tmp_path: Path) -> None:
    """Each in the words of the command line: the same camera file, and the same picture of a flat scene by its size."""
    scene = dp.Scene.target("siemens-star", 48, 32, width_mm=36, distance_mm=90)
    camera = tiny.with_(scene=scene, film="scene", focus_mm=90)
    spec = camera.to_dict()["scene"]
    assert spec["flat"] == {"width_mm": 36, "distance_mm": 90} and spec["field_of_view_deg"] is None
    assert camera.with_(fov_deg=20, depth_m=0.1).to_dict()["scene"].get("flat") is None
    assert tiny.with_(scene=scene, width_mm=18).to_dict()["scene"]["flat"] == {"width_mm": 18, "distance_mm": 90}
    shot = camera.with_(crop=(3, 2, 9, 7)).render()
    assert shot.shape == (7, 9)
    shot.camera.write(tmp_path / "camera.ron")
    subprocess.run([program, "run", tmp_path / "camera.ron", "--out", tmp_path / "out", "--quiet"], check=True)
    assert (tmp_path / "out" / "picture.png").read_bytes() == shot.png()

    file = tmp_path / "a.exr"
    dp.Scene.still_life(54, 36).write(file)
    for fill, as_written in (("beside", "Beside"), ("far", "Far"), (2.5, {"Metres": 2.5})):
        other = tiny.with_(scene=dp.Scene.read(file, fill_depth=fill, hidden=file, white_level=100))
        spec = other.to_dict()["scene"]
        assert (spec["fill_depth"], spec["hidden"], spec["white_level"]) == (as_written, str(file), 100)
        assert tiny.with_(scene=file, fill_depth=fill, hidden=file, white_level=100) == other


def test_wrong_options_of_scenes_are_named(tiny: dp.Camera) -> None:
    star = ("siemens-star", 48, 32)
    for change, words in [
        (lambda: dp.Scene.target(*star, width_mm=36), "width_mm is 36, expected 'distance_mm' with it"),
        (lambda: dp.Scene.target(*star, distance_mm=36), "distance_mm is 36, expected 'width_mm' with it"),
        (lambda: dp.Scene.target(*star, fov_deg=20), "depth_m is missing"),
        (lambda: tiny.with_(fill_depth="near"), "near"),
        (lambda: tiny.with_(fill_depth=-1), "a number above 0"),
        (lambda: tiny.with_(width_mm=36, distance_mm=90), "flat"),
        (lambda: tiny.render(memory="much"), "an amount of memory is 'much'"),
    ]:
        with pytest.raises(ValueError, match=words):
            change()


def test_denoise_and_memory_are_those_of_the_program(tiny: dp.Camera) -> None:
    shot = tiny.with_(exposure_s=1e-7, denoise=0).render()
    assert shot.camera.to_dict()["processing"]["denoise"] == 0
    assert not np.array_equal(shot.rgb, shot.develop(denoise=1.0).rgb)
    assert np.array_equal(tiny.render(memory="1GiB").rgb, tiny.render().rgb)
    assert tiny.render(quality="sketch").quality == "sketch"
