"""Light fields of a raster of cameras have the parallax of their spacing."""

from pathlib import Path

import dioptric as dp
import numpy as np
import pytest


@pytest.fixture(scope="module")
def field(tiny: dp.Camera, tmp_path_factory: pytest.TempPathFactory) -> dp.LightField:
    """A dark post 2 m before three cameras side by side, 20 mm apart."""
    folder = tmp_path_factory.mktemp("world")
    (folder / "post.obj").write_text("v -0.1 -2 0\nv 0.1 -2 0\nv 0.1 2 0\nv -0.1 2 0\nf 1 2 3 4\n")
    world = dp.Scene.world(folder / "post.obj", eye=(0, 0, 2), look_at=(0, 0, 0), sky="even:0.01", samples=16, size=(48, 32))
    data = tiny.with_(scene=world, focus_mm=2000, lens=dp.Lens.thin(50, 5), diffraction="none").to_dict()
    data["light_field"] = {"Cameras": {"columns": 3, "rows": 1, "spacing_mm": 20.0}}
    return dp.Camera.from_dict(data).light_field()


def place(view: np.ndarray) -> float:
    """The column of the middle of what is darker than the sky."""
    light = view[:, :, 1].mean(axis=0)
    dark = np.clip(light.max() * 0.9 - light, 0, None)
    return float((dark * np.arange(len(dark))).sum() / dark.sum())


def test_neighbors_are_apart_by_the_disparity(field: dp.LightField) -> None:
    assert field.shape == (1, 3, 32, 48, 3) == field.views.shape and field.whole.all()
    left, middle, right = (place(view) for view in field.views[0])
    expected = field.disparity_px(2.0)
    # By triangles: 20 mm at 2 m through 50 mm onto pixels of 660 µm; the noise of 16 samples moves a middle by some hundredths.
    assert abs(expected) == pytest.approx(20 / 2000 * 51.3 / 0.66, rel=0.02)
    assert abs(middle - left) == pytest.approx(abs(expected), abs=0.1)
    assert abs(right - left) == pytest.approx(2 * abs(expected), abs=0.1)


def test_refocused_picture_is_sharp_at_its_depth(field: dp.LightField) -> None:
    at, before = (field.refocus(depth_m)[:, :, 1].mean(axis=0) for depth_m in (2.0, 0.5))
    assert at.min() < before.min()
    with pytest.raises(ValueError, match="depth_m is -1"):
        field.refocus(-1)


def test_depth_is_found_where_there_is_an_edge(field: dp.LightField) -> None:
    found = field.depth(0.5, 20)
    assert set(found) == {"depth_m", "disparity_px", "confidence"}
    light = field.views[0, 1, :, :, 1].mean(axis=0)
    edges = np.argsort(np.abs(np.gradient(light)))[-2:]
    # Elsewhere there is nothing to tell depths by.
    assert np.median(found["depth_m"][:, edges]) == pytest.approx(2.0, rel=0.25)
    with pytest.raises(ValueError, match="nearer one first"):
        field.depth(3, 1)


def test_camera_without_a_raster_has_none(tiny: dp.Camera) -> None:
    with pytest.raises(ValueError, match="light_field: the camera has none"):
        tiny.light_field()


def test_truth_is_the_post_before_the_sky(field: dp.LightField) -> None:
    truth = field.true_depth_m
    assert truth.shape == field.shape[:4]
    post = truth[:, :, 16][np.isfinite(truth[:, :, 16])]
    assert post == pytest.approx(2.0, rel=1e-4) and np.isinf(truth[:, :, 16, 0]).all()
    # It moves as the disparity says.
    middles = [np.flatnonzero(np.isfinite(view[16])).mean() for view in truth[0]]
    assert middles[0] - middles[2] == pytest.approx(2 * field.disparity_px(2.0), abs=1)


def test_white_frame_needs_another(tiny: dp.Camera) -> None:
    with pytest.raises(ValueError, match="white is given, expected none without a frame"):
        tiny.light_field(white="white.dng")
