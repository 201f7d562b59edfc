"""The notebooks of docs/notebooks run, at small size: as notebooks where nbclient is installed, else as the Python that they are."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.py"))
CAN_EXECUTE = all(importlib.util.find_spec(name) for name in ("nbclient", "ipykernel"))


@pytest.mark.parametrize("source", NOTEBOOKS, ids=lambda source: source.stem)
def test_notebook_runs(source: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    if CAN_EXECUTE:
        command = [sys.executable, str(ROOT / "scripts" / "notebooks.py"), str(tmp_path), "--execute", "--small", source.stem]
        environment = dict(os.environ)
    else:
        command = [sys.executable, str(source)]
        environment = {**os.environ, "DIOPTRIC_SMALL": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(command, env=environment, cwd=source.parent, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    if CAN_EXECUTE:
        made = json.loads((tmp_path / f"{source.stem}.ipynb").read_text(encoding="utf-8"))
        outputs = [output for cell in made["cells"] for output in cell.get("outputs", [])]
        assert any("image/png" in output.get("data", {}) for output in outputs), "a notebook shows pictures"
        assert made["cells"][0]["cell_type"] == "markdown" and made["cells"][0]["source"].startswith("# ")


def test_sources_are_small_and_whole(tmp_path: Path) -> None:
    assert {source.stem for source in NOTEBOOKS} >= {
        "first_picture", "figure_2", "figure_3", "figure_4", "phone_and_dslr", "psf_bank", "data_set", "fit_focus",
    }  # fmt: skip
    subprocess.run([sys.executable, str(ROOT / "scripts" / "notebooks.py"), str(tmp_path)], check=True, capture_output=True)
    for source in NOTEBOOKS:
        made = json.loads((tmp_path / f"{source.stem}.ipynb").read_text(encoding="utf-8"))
        code = "\n".join(cell["source"] for cell in made["cells"] if cell["cell_type"] == "code")
        lines = [line for line in source.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
        assert [line for line in code.splitlines() if line and not line.startswith("#")] == lines
        assert source.stat().st_size < 10_000
