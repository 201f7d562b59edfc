"""The package and the program make the same files."""

import json
import subprocess
from pathlib import Path

import dioptric as dp
import pytest


def run(program: Path, *arguments: object) -> None:
    subprocess.run([program, "run", *map(str, arguments), "--quiet"], check=True, timeout=600)


def check_equal(a: Path, b: Path, names: list[str]) -> None:
    for name in names:
        assert (a / name).read_bytes() == (b / name).read_bytes(), name


def test_tiny_run_is_the_programs(tiny: dp.Camera, program: Path, tmp_path: Path) -> None:
    tiny.write(tmp_path / "camera.ron")
    run(program, tmp_path / "camera.ron", "--out", tmp_path / "program")
    # Read anew: what another test asked of the same camera before, as of a wider film, changes the last digits of tables.
    files = dp.Camera.read(tmp_path / "camera.ron").render().save(tmp_path / "python")
    assert {"picture.png", "irradiance.exr", "report.json", "camera.ron", "kept.ron"} <= set(files)
    names = ["picture.png", "irradiance.exr", "depth.exr", "volts.exr", "raw.png"]
    check_equal(tmp_path / "program", tmp_path / "python", names)
    reports = [json.loads((tmp_path / name / "report.json").read_text()) for name in ("program", "python")]
    for report in reports:
        del report["files"]
        # The program states paths as they are found.
        del report["camera"]
    assert reports[0] == reports[1]


def test_options_are_those_of_the_program(tiny: dp.Camera, program: Path, tmp_path: Path) -> None:
    tiny.write(tmp_path / "camera.ron")
    options = "--f-number 5.6 --focus-mm 1500 --diffraction none --exposure-s 0.004 --seed 7 --white gray-world --noise all,-read"
    run(program, tmp_path / "camera.ron", *options.split(), "--out", tmp_path / "program")
    changed = tiny.with_(
        f_number=5.6,
        focus_mm=1500,
        diffraction="none",
        exposure_s=0.004,
        seed=7,
        white="gray-world",
        noise="all,-read",
    )
    changed.render().save(tmp_path / "python")
    check_equal(tmp_path / "program", tmp_path / "python", ["picture.png", "irradiance.exr", "raw.png"])


def test_demo_is_the_programs_to_the_byte(program: Path, tmp_path: Path) -> None:
    """The slowest of the tests: the whole demo, twice."""
    run(program, "--out", tmp_path)
    shot = dp.Camera.demo().render()
    assert shot.png() == (tmp_path / "picture.png").read_bytes()
    assert shot.irradiance.shape == (31, 640, 960) and shot.irradiance.nbytes > 76e6


def test_run_continues_from_a_folder(tiny: dp.Camera, tmp_path: Path) -> None:
    tiny.render().save(tmp_path)
    resumed = dp.Camera.resume(tmp_path)
    again = resumed.with_(seed=5).render()
    assert resumed.stage_counts()["irradiance"] == 0
    assert again.png() == tiny.with_(seed=5).render().png()
    with pytest.raises(OSError, match="kept.ron"):
        dp.Camera.resume(tmp_path / "nowhere")


def test_picture_alone_is_saved(shot: dp.Shot, tmp_path: Path) -> None:
    assert shot.save(tmp_path / "a.png") == ["a.png"]
    assert (tmp_path / "a.png").read_bytes() == shot.png()
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    with pytest.raises(ValueError, match="ends in .png"):
        shot.save(tmp_path / "a.jpg")
    with pytest.raises(OSError, match="nowhere"):
        shot.save("/proc/nowhere/a.png")
