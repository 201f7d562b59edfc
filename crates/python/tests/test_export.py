"""Stores as Parquet and Zarr hold what the index and the files hold. Skipped where pyarrow or zarr are not installed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from dioptric import export
from dioptric.sweep import Plan, Store, Sweep
from plans import PLAN


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Items with a key of numbers, one of whole numbers, and one of choices; three are refused."""
    text = PLAN.replace(
        '"stop.FNumber": List([4, 8, 0.1])', '"stop.FNumber": List([4, 0.1]), "diffraction": List([None, Hurb(gamma: 1.0)])'
    )
    sweep = Sweep(Plan.from_ron(text, tmp_path_factory.mktemp("export") / "plan.ron"))
    sweep.run()
    return Store(sweep.plan.store)


def test_parquet_is_the_index(store: Store, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    assert export.to_parquet(store.folder, tmp_path / "a.parquet", ["picture.png"]) == 12
    table = parquet.read_table(tmp_path / "a.parquet").to_pylist()
    assert [row["id"] for row in table] == [item.id for item in store]
    for row, item in zip(table, store):
        assert row["exposure.Manual.time_s"] == item.values["exposure.Manual.time_s"]
        assert row["stop.FNumber"] == item.values["stop.FNumber"] and isinstance(row["stop.FNumber"], float)
        # The word for no diffraction is that for nothing.
        choice = item.values["diffraction"]
        assert row["diffraction"] == (None if choice is None else json.dumps(choice)) and row["reason"] == item.reason
        for name, number in item.metrics.items():
            assert row[name] == number
        picture = item.path("picture").read_bytes() if item.status == "done" else None
        assert row["picture.png"] == picture
    assert json.loads(table[1]["diffraction"]) == {"Hurb": {"gamma": 1.0}}
    assert [path.name for path in tmp_path.iterdir()] == ["a.parquet"]


def test_zarr_holds_the_files(store: Store, tmp_path: Path) -> None:
    zarr = pytest.importorskip("zarr", reason="zarr is not installed")
    target = tmp_path / "a.zarr"
    assert export.to_zarr(store.folder, target, ["picture", "raw", "irradiance"]) == 6
    group = zarr.open_group(str(target), mode="r")
    assert group["irradiance"].shape == (6, 3, 32, 48) and group["irradiance"].chunks == (1, 3, 32, 48)
    for n, item in enumerate(store.done):
        assert str(group["id"][n]) == item.id and group["mean_e.G"][n] == item.metrics["mean_e.G"]
        for name in ("picture", "raw", "irradiance"):
            assert np.array_equal(group[name][n], item.array(name)) and group[name].dtype == item.array(name).dtype
    assert list(group["wavelength"][:]) == [450, 550, 650]
    assert set(map(str, group["diffraction"][:])) == {"", '{"Hurb": {"gamma": 1.0}}'}
    xr = pytest.importorskip("xarray")
    data = xr.open_zarr(str(target), consolidated=False)
    assert data["irradiance"].dims == ("item", "wavelength", "y", "x")
    with pytest.raises(ValueError, match="is there already"):
        export.to_zarr(store.folder, target)
    with pytest.raises(ValueError, match="no depth.exr"):
        export.to_zarr(store.folder, tmp_path / "b.zarr", ["depth"])
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_command(store: Store, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    command = [sys.executable, "-m", "dioptric.export", str(store.folder), "--parquet", str(tmp_path / "a.parquet")]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.startswith("12 rows in ")
    failed = subprocess.run([*command[:3], str(tmp_path), *command[4:]], capture_output=True, text=True)
    assert failed.returncode == 1 and failed.stderr.startswith("error: ") and "dioptric sweep index" in failed.stderr


def test_memory_is_bounded(tmp_path: Path) -> None:
    """A table of 60,000 rows in less memory than its index is large."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    metrics = {f"m{n}": n + 0.123456789 for n in range(40)}
    with (tmp_path / "index.jsonl").open("w") as out:
        for n in range(60_000):
            row = {"item": n, "id": f"{n:064x}", "status": "done", "values": {"seed": n}, "metrics": metrics}
            out.write(json.dumps(row) + "\n")
    size = (tmp_path / "index.jsonl").stat().st_size
    script = (
        "import resource, sys, pyarrow.parquet\n"
        "from dioptric import export\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "export.to_parquet(sys.argv[1], sys.argv[1] + '/a.parquet')\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    out_text = subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=True, capture_output=True, text=True).stdout
    unit = 1 if sys.platform == "darwin" else 1024
    assert size > 55e6 and int(out_text) * unit < 0.9 * size
