"""Everything wrong is a ValueError, an OSError or a TypeError of one sentence; no panic passes `except Exception`."""

import errno
import inspect

import dioptric as dp
import numpy as np
import pytest


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"f_number": -4}, ValueError, "FNumber is -4, expected 0.05 to 100000"),
        ({"f_number": 0.3}, ValueError, "opens to f/"),
        ({"f_number": "wide"}, TypeError, "f_number is str, expected a number"),
        ({"focus_mm": "far"}, ValueError, "focus_mm is 'far', expected a distance in mm"),
        ({"lens": "no-such-lens"}, ValueError, "no lens is named 'no-such-lens'"),
        ({"lens": 5}, TypeError, "lens is int, expected a name, a path or an object of dioptric"),
        ({"sensor": "no-such-sensor"}, ValueError, "no sensor is named 'no-such-sensor'"),
        ({"diffraction": "some"}, ValueError, "diffraction is 'some', expected 'none', 'hurb'"),
        ({"diffraction": "none", "gamma": 2}, ValueError, "gamma is 2, expected diffraction='hurb'"),
        ({"pixels": 5}, TypeError, "pixels is int, expected a pair"),
        ({"pixels": (0, 5)}, ValueError, "columns is 0, expected 1 to 65536"),
        ({"white": "pinkish"}, ValueError, "'pinkish' is not known, expected one of scene, none"),
        ({"noise": "hiss"}, ValueError, "'hiss' is not known"),
        ({"wavelengths_nm": []}, ValueError, "wavelengths_nm is empty"),
        ({"wavelengths_nm": [500, None]}, TypeError, "wavelengths_nm is list, expected a number or a list of numbers"),
        ({"seed": -1}, ValueError, "seed is -1, expected a whole number of 0 or more"),
        ({"seed": 1.5}, TypeError, "seed is float, expected a whole number of 0 or more"),
        ({"burst": -3}, ValueError, "burst is -3, expected a whole number of 0 or more"),
        ({"wavelengths_nm": np.ma.masked_greater([450, 550], 500)}, TypeError, "wavelengths_nm is a masked array"),
        ({"burst": 0}, ValueError, "Burst is 0"),
        ({"illuminant": "moon"}, ValueError, "moon"),
        ({"f_numbre": 4}, TypeError, r"with_\(\) has no argument 'f_numbre'; it has name, lens, f_number"),
    ],
)
def test_wrong_change_is_named(tiny: dp.Camera, change: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words) as raised:
        tiny.with_(**change)
    assert "\n" not in str(raised.value)


def test_files_that_are_not_there_are_os_errors() -> None:
    for act in (
        lambda: dp.Camera.read("/nowhere/camera.ron"),
        lambda: dp.Lens.read("/nowhere/lens.zmx"),
        lambda: dp.Sensor.read("/nowhere/sensor.ron"),
        lambda: dp.Scene.read("/nowhere/scene.exr"),
    ):
        with pytest.raises(FileNotFoundError, match="/nowhere/") as raised:
            act()
        assert raised.value.errno == errno.ENOENT and str(raised.value.filename).startswith("/nowhere/")


def test_files_that_are_none_of_ours_say_so(tmp_path) -> None:
    (tmp_path / "a.zmx").write_text("no lens")
    with pytest.raises((OSError, ValueError), match="a.zmx"):
        dp.Lens.read(tmp_path / "a.zmx")
    with pytest.raises(OSError, match="a.zmx") as raised:
        dp.Camera.demo().write(tmp_path / "a.zmx" / "camera.ron")
    assert str(tmp_path) in str(raised.value.filename)


def test_signatures_have_the_names_that_are_known(tiny: dp.Camera, shot: dp.Shot) -> None:
    lens = dp.Lens.thin(50, 10)
    for function, with_none in [
        (tiny.with_, lambda: tiny.with_(nonsense=1)),
        (shot.expose, lambda: shot.expose(nonsense=1)),
        (shot.develop, lambda: shot.develop(nonsense=1)),
        (lens.psf, lambda: lens.psf(nonsense=1)),
        (lens.psf_table, lambda: lens.psf_table(nonsense=1)),
        (lens.analyze, lambda: lens.analyze(nonsense=1)),
    ]:
        with pytest.raises(TypeError, match="it has ") as raised:
            with_none()
        known = str(raised.value).split("it has ")[1].split(", ")
        if function == lens.psf:
            known.remove("mtf_per_mm")
        assert sorted(inspect.signature(function).parameters) == sorted(known), function
    for function in (dp.Scene.read, dp.Scene.target, dp.Scene.still_life, dp.Scene.world, dp.develop):
        assert not any(p.kind is p.VAR_KEYWORD for p in inspect.signature(function).parameters.values()), function
    assert list(inspect.signature(lens.trace).parameters)[:3] == ["origins", "directions", "wavelength_nm"]


def test_camera_text_names_line_and_key(tiny: dp.Camera) -> None:
    with pytest.raises(ValueError, match=r"camera.ron:\d+:\d+: .*fokus"):
        dp.Camera.from_ron(tiny.to_ron().replace("focus:", "fokus:"))


def test_dictionary_of_other_keys_is_named(tiny: dp.Camera) -> None:
    data = tiny.to_dict()
    for wrong, words in [
        (data | {"fokus": 1}, "the camera: unknown field `fokus`"),
        (data | {"lens": "dgauss"}, "the camera: unknown variant `dgauss`"),
        (data | {"lens": 5}, "the camera: found int, expected one of BuiltIn, File"),
        (data | {"seed": "a"}, "the camera: invalid type: string"),
        (data | {"focus": {"DistanceMm": -5.0}}, "DistanceMm is -5"),
        ({"name": "a"}, "the camera: missing field"),
    ]:
        with pytest.raises(ValueError, match=words):
            dp.Camera.from_dict(wrong)


def test_scene_of_wrong_arrays_is_named() -> None:
    good = np.ones((2, 3, 4))
    bad = good.copy()
    bad[1, 2, 0] = -1
    for radiance, wavelengths, depth, words in [
        (good[0], [500, 600], 1.0, r"radiance is of shape \[3, 4\], expected an array of shape \(bands, rows, columns\)"),
        (good, [500], 1.0, "bands of an image"),
        (good, [600, 500], 1.0, "600|ascend"),
        (good, [500, 600], -1.0, "-1"),
        (good, [500, 600], np.ones((4, 3)), "the depth is 4 × 3 samples"),
        (bad, [500, 600], 1.0, "row 2, column 0"),
    ]:
        with pytest.raises(ValueError, match=words):
            dp.Scene.from_array(radiance, wavelengths, depth_m=depth, fov_deg=30)
    with pytest.raises(ValueError, match="0|180"):
        dp.Scene.from_array(good, [500, 600], depth_m=1, fov_deg=190)


def test_part_made_in_python_is_in_no_file(tiny: dp.Camera, tmp_path) -> None:
    camera = tiny.with_(scene=dp.Scene.from_array(np.ones((2, 3, 4)), [500, 600], depth_m=1, fov_deg=30))
    for act in (camera.to_ron, lambda: camera.write(tmp_path / "a.ron")):
        with pytest.raises(ValueError, match="scene: it was made in a program and is in no file"):
            act()
    assert list(tmp_path.iterdir()) == []


def test_panic_is_an_exception_like_others() -> None:
    with pytest.raises(RuntimeError, match="a fault of dioptric, please report it: on purpose"):
        dp._native._panic()


def test_no_class_can_be_made_or_changed_by_hand(shot: dp.Shot) -> None:
    for kind in (dp.Shot, dp.Rays, dp.Lens, dp.Camera, dp._native.Memory):
        with pytest.raises(TypeError):
            kind()
    with pytest.raises(AttributeError):
        shot.quality = "draft"  # type: ignore[misc]
