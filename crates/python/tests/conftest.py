"""What the tests share: a camera whose picture takes a fraction of a second, and the program `dioptric`."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import dioptric as dp
import pytest


@pytest.fixture(scope="session")
def tiny() -> dp.Camera:
    """The demo on a film of 48 × 32 pixels and three bands."""
    scene = dp.Scene.still_life(54, 36)
    return dp.Camera.demo().with_(
        name="tiny", scene=scene, pixels=(48, 32), pixel_um=660, wavelengths_nm=[450, 550, 650]
    )


@pytest.fixture(scope="session")
def shot(tiny: dp.Camera) -> dp.Shot:
    """The picture of the tiny camera."""
    return tiny.render()


@pytest.fixture(scope="session")
def program() -> Path:
    """The program `dioptric`, from the environment or the path."""
    found = os.environ.get("DIOPTRIC") or shutil.which("dioptric")
    if not found or not Path(found).exists():
        pytest.skip("the program dioptric is not built; name it in the variable DIOPTRIC")
    return Path(found)
