"""Measurements of shots and arrays are those of the program on files, and of known answers."""

import json
import subprocess
from pathlib import Path

import dioptric as dp
import numpy as np
import pytest


@pytest.fixture(scope="module")
def edge(tiny: dp.Camera) -> dp.Shot:
    """A slanted edge on 160 × 120 pixels."""
    bar = dp.Scene.target("slanted-bar", 320, 240, fov_deg=30, depth_m=1.2)
    return tiny.with_(scene=bar, pixels=(160, 120), pixel_um=160, focus_mm=1200, wavelengths_nm=[450, 550, 650]).render()


def blurred_edge(sigma_px: float, shape: tuple[int, int] = (100, 120)) -> np.ndarray:
    """Light of an edge slanted by 5°, blurred by a Gaussian: its MTF is exp(−2 π² σ² f²)."""
    from math import erf

    rows, columns = np.indices(shape)
    away = (columns - shape[1] / 2 + 0.5) * np.cos(np.radians(5)) + (rows - shape[0] / 2 + 0.5) * np.sin(np.radians(5))
    return 0.2 + 0.6 * 0.5 * (1 + np.vectorize(erf)(away / (sigma_px * np.sqrt(2))))


def test_edge_of_a_known_blur_has_its_mtf50() -> None:
    for sigma in (0.7, 1.0, 1.5):
        # Half of the response: f = √(ln 2 / 2) / (π σ). The samples are points, so that there is no box of a pixel.
        expected = np.sqrt(np.log(2) / 2) / (np.pi * sigma)
        found = dp.measure.sfr(blurred_edge(sigma))["channels"][0]["mtf50_cycles_per_pixel"]
        assert found == pytest.approx(expected, rel=0.01), sigma


def test_shot_array_and_file_have_the_same_response(edge: dp.Shot, program: Path, tmp_path: Path) -> None:
    edge.save(tmp_path / "picture.png")
    stated = json.loads(subprocess.run(
        [program, "measure", "mtf", tmp_path / "picture.png", "--region", "40,20,80,80", "--json"],
        check=True, capture_output=True,
    ).stdout)
    of_file = dp.measure.mtf(tmp_path / "picture.png", region=(40, 20, 80, 80))
    assert json.loads(json.dumps(of_file)) == stated
    of_codes = dp.measure.mtf(edge.rgb, region=(40, 20, 80, 80))
    of_shot = dp.measure.mtf(edge, region=(40, 20, 80, 80))
    for ours, theirs in zip(of_codes["channels"], stated["channels"]):
        assert ours["mtf50_cycles_per_pixel"] == theirs["mtf50_cycles_per_pixel"]
    for ours, theirs in zip(of_shot["channels"], stated["channels"]):
        # The shot's codes are not rounded to 8 bits.
        assert ours["mtf50_cycles_per_pixel"] == pytest.approx(theirs["mtf50_cycles_per_pixel"], rel=0.02)


def test_pictures_of_a_list_are_measured_one_by_one(edge: dp.Shot, tmp_path: Path) -> None:
    edge.save(tmp_path / "a.png")
    (tmp_path / "b.png").write_text("no picture")
    region = (40, 20, 80, 80)
    of_folder = dp.measure.mtf([tmp_path], region=region)
    alone = dp.measure.mtf(tmp_path / "a.png", region=region)
    assert of_folder["pictures"] == [alone]
    assert [Path(other["picture"]).name for other in of_folder["not_measured"]] == ["b.png"]
    offsets = {channel["channel"]: channel["offset_px"] for channel in alone["channels"]}
    assert offsets["G"] == 0 and abs(offsets["R"]) < 0.5
    with pytest.raises(ValueError, match="one picture"):
        dp.measure.mtf([tmp_path], every=True)


def test_raw_frame_is_measured_by_its_filters(edge: dp.Shot) -> None:
    of_raw = dp.measure.mtf(edge, region=(40, 20, 80, 80), of="raw")
    levels = edge.levels
    light = (edge.raw.astype(float) - levels["black"]) / (levels["white"] - levels["black"])
    of_array = dp.measure.mtf(light, region=(40, 20, 80, 80), mosaic="RGGB")
    names = [channel["channel"] for channel in of_raw["channels"]]
    assert len(names) == 3
    ours = sorted(channel["mtf50_cycles_per_pixel"] for channel in of_raw["channels"])
    theirs = sorted(channel["mtf50_cycles_per_pixel"] for channel in of_array["channels"])
    np.testing.assert_allclose(ours, theirs, rtol=1e-3)


def test_region_of_a_ramp_has_its_mean_and_deviation() -> None:
    ramp = np.tile(np.linspace(0, 1, 101), (40, 1))
    region = dp.measure.region(ramp, (10, 5, 21, 30))["channels"][0]
    part = ramp[5:35, 10:31]
    assert region["mean"] == pytest.approx(part.mean(), rel=1e-6) and region["n_samples"] == part.size
    assert region["deviation"] == pytest.approx(part.std(ddof=1), rel=1e-6)
    codes = np.full((8, 8, 3), 188, np.uint8)
    # sRGB 188 is half of the light: ((188 / 255 + .055) / 1.055)^2.4.
    light = ((188 / 255 + 0.055) / 1.055) ** 2.4
    assert dp.measure.region(codes)["channels"][1]["mean"] == pytest.approx(light, rel=1e-6)
    assert dp.measure.region(codes, curve="linear")["channels"][1]["mean"] == pytest.approx(188 / 255, rel=1e-6)


def test_irradiance_of_a_shot_has_lux(shot: dp.Shot) -> None:
    measured = dp.measure.region(shot, of="irradiance")
    assert measured["channels"][0]["channel"] == "illuminance"
    means = [band["mean"] for band in measured["spectrum"]]
    np.testing.assert_allclose(means, shot.irradiance.mean(axis=(1, 2), dtype=float), rtol=1e-5)
    with pytest.raises(ValueError, match="measure.region alone takes bands"):
        dp.measure.shading(shot, of="irradiance")


def test_photon_transfer_finds_the_gain_of_frames() -> None:
    rng, gain, dark_e = np.random.default_rng(4), 0.25, 6.0
    def frames(electrons: float, n: int) -> list[np.ndarray]:
        noise = rng.normal(0, dark_e, (n, 200, 200))
        return list(np.rint(64 + gain * (rng.poisson(electrons, (n, 200, 200)) + noise)))
    levels = [250, 500, 1000, 2000, 4000, 8000]
    series = [(0.01, 0, frames(0, 4))] + [(0.01, 2.0 * level, frames(level, 2)) for level in levels]
    measured = dp.measure.emva(series)
    # A variance of 40,000 pixels is known to √(2 / 40,000) = 0.7 %; the line through six is better than that.
    assert measured["gain_dn_per_e"] == pytest.approx(gain, rel=0.01)
    assert measured["quantum_efficiency"] == pytest.approx(0.5, rel=0.01)
    assert measured["dark_noise_e"] == pytest.approx(dark_e, rel=0.02)


def test_bench_measures_a_sensor_of_ones_own() -> None:
    sensor = dp.Sensor.built_in("imx363").with_(read_noise_v=0.0)
    measured = dp.measure.bench(sensor, size=96, levels=8, stack=8)
    sheet = measured["data_sheet"]
    # Eight levels of 96² pixels: some 2 % of the gain, one standard error.
    assert measured["gain_dn_per_e"] == pytest.approx(sheet["gain_dn_per_e"], rel=0.06)
    assert dp.measure.bench("imx363", size=96, levels=8, stack=8)["data_sheet"]["dark_noise_e"] > sheet["dark_noise_e"]


def test_pictures_are_compared(shot: dp.Shot) -> None:
    same = dp.measure.compare(shot, shot)
    assert same["ssim"] == pytest.approx(1) and same["psnr_db"] is None and same["scielab"]["max"] == 0
    other = dp.measure.compare(shot, shot.expose(seed=9))
    assert other["ssim"] < 1 and other["psnr_db"] > 10
    # A shot in wider primaries is the same light.
    wide = dp.measure.compare(shot, shot.develop(space="display-p3"))
    assert wide["scielab"]["median"] < 0.2


def test_what_cannot_be_measured_is_refused(shot: dp.Shot, tmp_path: Path) -> None:
    flat = np.full((80, 80), 0.5)
    for act, error, words in [
        (lambda: dp.measure.sfr(flat), ValueError, "edge"),
        (lambda: dp.measure.sfr(flat, pixel_um=-1), ValueError, "^pixel_um is -1, expected a number above 0"),
        (lambda: dp.measure.sfr(flat, region=(0, 0, 90, 10)), ValueError, "do not lie within"),
        (lambda: dp.measure.sfr(flat, region="0,0,9,9"), TypeError, "region is str, expected four whole numbers"),
        (lambda: dp.measure.region(flat.astype(np.int64)), TypeError, "an array of int64, expected uint8 or uint16"),
        (lambda: dp.measure.region(np.ma.masked_less(flat, 1)), TypeError, "picture is a masked array"),
        (lambda: dp.measure.region(np.full((4, 4), np.nan)), ValueError, "not finite"),
        (lambda: dp.measure.region(np.zeros((3, 4, 4))), ValueError, r"of shape \[3, 4, 4\]"),
        (lambda: dp.measure.region(flat, of="raw"), ValueError, "of is 'raw', expected it for shots"),
        (lambda: dp.measure.region(shot, of="volts"), ValueError, "expected 'picture', 'raw' or 'irradiance'"),
        (lambda: dp.measure.region(flat, curve="film"), ValueError, "curve is 'film'"),
        (lambda: dp.measure.color(shot), ValueError, "chart"),
        (lambda: dp.measure.emva([(0.01, 0, [flat])]), ValueError, "has 1 frames"),
        (lambda: dp.measure.emva([1]), TypeError, "a list of .exposure_s, photons, frames."),
        (lambda: dp.measure.region(tmp_path / "no.png"), FileNotFoundError, "no.png"),
        (lambda: dp.measure.bench("no-sensor"), ValueError, "no-sensor"),
    ]:
        with pytest.raises(error, match=words):
            act()
