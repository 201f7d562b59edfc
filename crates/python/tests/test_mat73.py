"""The converter of MATLAB files of version 7.3, on a file that h5py wrote, against the same scene that scipy wrote."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

scipy_io = pytest.importorskip("scipy.io")
pytest.importorskip("h5py")

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "fixtures" / "scenes"


def convert(*arguments: str) -> "subprocess.CompletedProcess[str]":
    script = ROOT / "scripts" / "mat73_to_mat7.py"
    return subprocess.run([sys.executable, str(script), *arguments], capture_output=True, text=True)


def check_same(found: object, expected: object, name: str) -> None:
    if isinstance(expected, np.ndarray) and expected.dtype.names:
        assert isinstance(found, np.ndarray) and found.dtype.names
        assert set(found.dtype.names) == set(expected.dtype.names), name
        for field in expected.dtype.names:
            check_same(found[field][0, 0], expected[field][0, 0], f"{name}.{field}")
    elif isinstance(expected, np.ndarray) and expected.dtype != object:
        # MATLAB keeps nothing of the shape of what is empty.
        assert np.array_equal(found, expected) or (np.size(found) == 0 == expected.size), name
    elif isinstance(expected, np.ndarray):
        assert np.size(found) == expected.size, name


def test_converted_scene_is_the_same(tmp_path: Path) -> None:
    target = tmp_path / "scene.mat"
    assert convert(str(SCENES / "iset_scene_v73.mat"), str(target)).returncode == 0
    found = scipy_io.loadmat(target)["scene"]
    check_same(found, scipy_io.loadmat(SCENES / "iset_scene.mat")["scene"], "scene")
    assert found["data"][0, 0]["photons"][0, 0].shape == (4, 6, 5)


def test_absent_variable_is_named(tmp_path: Path) -> None:
    run = convert(str(SCENES / "iset_scene_v73.mat"), str(tmp_path / "scene.mat"), "oi")
    assert run.returncode != 0 and "holds no variable 'oi', but" in run.stderr
    assert not (tmp_path / "scene.mat").exists()
