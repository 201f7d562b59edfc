"""Samples are those of stores and cameras, in whichever worker. A stand-in for PyTorch takes its place where it is not installed."""

from __future__ import annotations

import importlib.util
import pickle
import sys
import types
from pathlib import Path
from typing import Any

import dioptric as dp
import numpy as np
import pytest
from dioptric.sweep import Plan, Store, Sweep
from dioptric.torch import Dataset, Rendered
from plans import PLAN

HAS_TORCH = importlib.util.find_spec("torch") is not None


@pytest.fixture(autouse=True)
def torch(monkeypatch: pytest.MonkeyPatch) -> Any:
    """PyTorch, or of it what the data sets use, on arrays of NumPy."""
    if HAS_TORCH:
        return importlib.import_module("torch")
    fake = types.ModuleType("torch")
    fake.float32 = np.float32  # type: ignore[attr-defined]
    fake.from_numpy = lambda array: array  # type: ignore[attr-defined]
    fake.tensor = lambda value, dtype: np.array(value, dtype)  # type: ignore[attr-defined]
    fake.utils = types.SimpleNamespace(data=types.SimpleNamespace(get_worker_info=lambda: None))  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "torch", fake)
    return fake


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Sweep:
    """A plan that is made."""
    sweep = Sweep(Plan.from_ron(PLAN, tmp_path_factory.mktemp("torch") / "plan.ron"))
    sweep.run()
    return sweep


def draw(rng: np.random.Generator) -> dp.Camera:
    """A camera at random."""
    camera = dp.Camera.from_ron(CAMERA)
    return camera.with_(f_number=rng.uniform(3, 8), exposure_s=0.01, seed=int(rng.integers(2**31)))


CAMERA = PLAN[PLAN.index("((") + 1 : PLAN.index("vary")].rstrip().rstrip(",").removesuffix(")").rstrip()


def test_samples_of_a_store(sweep: Sweep) -> None:
    data = Dataset(sweep.plan.store, ["picture", "raw", "irradiance", "stop.FNumber", "exposure_time_s"])
    assert len(data) == 6 and [item.number for item in data.items] == [0, 1, 3, 4, 6, 7]
    for sample, item in zip(data, Store(sweep.plan.store).done):
        own = {name: np.asarray(value) for name, value in sample.items()}
        assert np.array_equal(own["picture"], item.array("picture").transpose(2, 0, 1))
        assert own["raw"].dtype == np.int32 and np.array_equal(own["raw"], item.array("raw"))
        assert own["irradiance"].flags.writeable and own["irradiance"].dtype == np.float32
        assert own["stop.FNumber"] == item.values["stop.FNumber"] and own["stop.FNumber"].dtype == np.float32
        assert own["exposure_time_s"] == np.float32(item.metrics["exposure_time_s"])
    assert Dataset(sweep.plan.store, transform=lambda sample: sorted(sample))[0] == ["picture"]
    with pytest.raises(ValueError, match="arrays has 'depth'"):
        Dataset(sweep.plan.store, ["depth"])


def test_samples_on_the_fly(sweep: Sweep) -> None:
    data = Rendered(sweep, arrays=["raw", "picture"])
    assert len(data) == 9
    raw = np.asarray(data[4]["raw"])
    assert np.array_equal(raw, Store(sweep.plan.store)[4].array("raw"))
    # A copy in another process draws the plan up again.
    assert np.array_equal(np.asarray(pickle.loads(pickle.dumps(data))[4]["raw"]), raw)
    with pytest.raises(ValueError, match="opens to f/"):
        data[2]
    with pytest.raises(IndexError, match="sample 9"):
        data[9]
    with pytest.raises(ValueError, match="n is missing"):
        Rendered(draw)
    drawn, again, other = Rendered(draw, 3), Rendered(draw, 3), Rendered(draw, 3, seed=1)
    pictures = [np.asarray(drawn[n]["picture"]) for n in range(3)]
    assert pictures[0].shape == (3, 32, 48) and pictures[0].dtype == np.float32
    # Each by its number alone, in any order.
    assert all(np.array_equal(np.asarray(again[n]["picture"]), pictures[n]) for n in (2, 0, 1))
    assert not np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(np.asarray(other[0]["picture"]), pictures[0])


@pytest.mark.skipif(not HAS_TORCH, reason="PyTorch is not installed")
@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_workers_give_the_same(sweep: Sweep, torch: Any, method: str) -> None:
    from torch.utils.data import DataLoader

    for data in (Rendered(draw, 5, ["raw", "irradiance"]), Rendered(sweep.__class__(sweep.plan), 2, ["raw"]), Dataset(sweep.plan.store, ["raw"])):
        alone = [data[n]["raw"] for n in range(len(data))]
        loader = DataLoader(data, batch_size=2, num_workers=2, multiprocessing_context=method)
        together = torch.cat([batch["raw"] for batch in loader])
        assert torch.equal(together, torch.stack(alone)), method


@pytest.mark.skipif(HAS_TORCH, reason="PyTorch is installed")
def test_missing_torch_is_named(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "torch")
    with pytest.raises(ImportError, match=r"pip install 'dioptric\[torch\]'"):
        Dataset(sweep.plan.store)[0]
