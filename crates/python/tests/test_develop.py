"""Raw files of any camera are developed as on the command line."""

import json
import subprocess
from pathlib import Path

import dioptric as dp
import numpy as np
import pytest


@pytest.fixture(scope="module")
def raw(tiny: dp.Camera, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A raw file that the tiny camera wrote."""
    data = tiny.to_dict()
    data["outputs"]["also"] = ["RawDng"]
    folder = tmp_path_factory.mktemp("raw")
    assert "raw.dng" in dp.Camera.from_dict(data).render().save(folder / "out")
    return folder / "out" / "raw.dng"


def test_raw_file_is_developed_as_on_the_command_line(raw: Path, program: Path, tmp_path: Path) -> None:
    command = [program, "develop", raw, "--out", tmp_path / "a", "--white", "gray-world", "--sharpen-px", "0", "--quiet"]
    subprocess.run(command, check=True)
    developed = dp.develop(raw, white="gray-world", sharpen_px=0)
    assert developed.png() == (tmp_path / "a" / "picture.png").read_bytes()
    report = json.loads((tmp_path / "a" / "report.json").read_text())
    assert developed.report() == report and developed.notes == report["notes"]
    assert sorted(developed.save(tmp_path / "b")) == ["picture.png", "report.json"]
    for name in ("picture.png", "report.json"):
        assert (tmp_path / "b" / name).read_bytes() == (tmp_path / "a" / name).read_bytes()


def test_frame_and_picture_are_arrays(raw: Path, shot: dp.Shot, tmp_path: Path) -> None:
    developed = dp.develop(raw)
    assert developed.shape == (32, 48)
    assert developed.raw.dtype == np.uint16 and np.array_equal(developed.raw, shot.raw)
    assert developed.picture.shape == developed.rgb.shape == (32, 48, 3)
    codes = np.clip(developed.picture, 0, 1) * np.float32(255)
    np.testing.assert_allclose(developed.rgb, codes, atol=0.5 + 1e-4)
    assert not developed.picture.flags.writeable and "48 × 32" in repr(developed)
    darker = dp.develop(raw, brightness="0.5")
    assert darker.rgb.mean() != developed.rgb.mean()
    assert developed.save(tmp_path / "p.png") == ["p.png"]
    assert (tmp_path / "p.png").read_bytes() == developed.png()


def test_profile_is_followed_as_far_as_told(raw: Path) -> None:
    # Frames of this program have no look.
    plain, look = (dp.develop(raw, rendering=word) for word in ("matrices", "look"))
    assert np.array_equal(plain.rgb, look.rgb)
    with pytest.raises(ValueError, match="rendering is 'film', expected matrices, colors, look"):
        dp.develop(raw, rendering="film")
    with pytest.raises(ValueError, match="rendering is given, expected it for files"):
        dp.develop(np.zeros((8, 8), np.uint16), cfa="RGGB", rendering="look")


def test_profile_of_another_file_and_black_of_masked_pixels(raw: Path) -> None:
    # A raw file lends its own profile, which changes nothing.
    assert np.array_equal(dp.develop(raw, profile=raw).rgb, dp.develop(raw).rgb)
    with pytest.raises(OSError, match="MaskedAreas"):
        dp.develop(raw, black="masked")
    with pytest.raises(ValueError, match="stated, masked"):
        dp.develop(raw, black="dark")


def test_pixels_are_read_as_one(tiny: dp.Camera, shot: dp.Shot) -> None:
    whole = shot.expose(noise="none", exposure_s=shot.exposure_s)
    read = whole.expose(noise="none", exposure_s=shot.exposure_s, binning="voltage:2")
    assert whole.shape == (32, 48) and read.shape == read.raw.shape == (16, 24)
    # The mean of four voltages, to half a code and the scene within them.
    assert read.raw.mean() == pytest.approx(whole.raw.mean(), rel=0.01)
    assert tiny.with_(gain_mode="high", temperature_c=40, metering="mean", chip_seed=3, binning="charge:2").render().shape == (16, 24)
    with pytest.raises(ValueError, match="charge:2"):
        whole.expose(binning="sums")


def test_what_cannot_be_developed_is_refused(raw: Path, tmp_path: Path) -> None:
    with pytest.raises(OSError, match="missing.dng"):
        dp.develop(tmp_path / "missing.dng")
    (tmp_path / "text.dng").write_text("no picture")
    with pytest.raises(OSError, match="text.dng: cannot be read: is no TIFF file"):
        dp.develop(tmp_path / "text.dng")
    with pytest.raises(ValueError, match="need a simulated lens"):
        dp.develop(raw, lens_corrections="all")
    with pytest.raises(TypeError, match=r"develop\(\) has no argument 'seed'"):
        dp.develop(raw, seed=3)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="a folder, or a file that ends in .png"):
        dp.develop(raw).save(tmp_path / "a.jpg")
