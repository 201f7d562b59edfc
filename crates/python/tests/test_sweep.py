"""Plans and stores are those of the program; results are read back as arrays and tables."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import dioptric as dp
import numpy as np
import pytest
from dioptric.sweep import Item, Maker, Plan, Store, Sweep, read_samples
from plans import PLAN, files, write_plan


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sweep, Path]:
    """A plan and its store."""
    path = write_plan(tmp_path_factory.mktemp("sweep"))
    sweep = Sweep(Plan.read(path))
    told: list[tuple[str, float]] = []
    counts = sweep.run(progress=lambda *at: told.append(at))
    assert counts == {"there": 0, "done": 6, "refused": 3, "failed": 0, "left": 0, "first_failure": None}
    assert told and all("/9 " in what and 0 <= part < 1 for what, part in told)
    return sweep, sweep.plan.store


def test_items_are_those_of_the_plan(made: tuple[Sweep, Path]) -> None:
    sweep, _ = made
    assert (len(sweep), len(sweep.plan), sweep.n_irradiances) == (9, 9, 3)
    assert sweep.plan.keys == ["exposure.Manual.time_s", "stop.FNumber"]
    assert sweep.values(4) == {"exposure.Manual.time_s": 0.01, "stop.FNumber": 8}
    assert sweep.camera(4).to_dict()["stop"] == {"FNumber": 8.0}
    assert len(sweep.id(4)) == 64 and len({sweep.id(item) for item in range(9)}) == 9
    assert sorted(map(sorted, sweep.groups())) == [[0, 3, 6], [1, 4, 7], [2, 5, 8]]
    parts = [group for n in (1, 2) for group in sweep.groups(shard=f"{n}/2")]
    assert sorted(parts) == sorted(sweep.groups())
    with pytest.raises(IndexError, match="item is 9, expected one of the 9"):
        sweep.id(9)


def test_store_is_the_programs(made: tuple[Sweep, Path], program: Path, tmp_path: Path) -> None:
    sweep, store = made
    path = write_plan(tmp_path)
    subprocess.run([program, "sweep", path, "--quiet"], check=True, timeout=120)
    assert files(tmp_path / "plan.store") == files(store)
    assert sweep.run(store)["there"] == 9 and sweep.groups(store) == []
    assert sweep.counts(store) == {"done": 6, "refused": 3, "missing": 0}
    subprocess.run([program, "sweep", "pack", path, "--webdataset", tmp_path / "a.tar"], check=True, timeout=120)
    assert [archive.read_bytes() for archive in sweep.pack(tmp_path / "b.tar")] == [(tmp_path / "a.tar").read_bytes()]


def test_parts_and_limits_fill_the_same_store(made: tuple[Sweep, Path], tmp_path: Path) -> None:
    sweep, store = made
    assert sweep.run(tmp_path / "s", limit=2)["left"] == 7
    for n in (1, 2, 3):
        sweep.run(tmp_path / "s", shard=f"{n}/3")
    (tmp_path / "s" / "index.jsonl").unlink()
    sweep.write_index(tmp_path / "s")
    assert files(tmp_path / "s") == files(store)


def test_maker_knows_items_by_name(made: tuple[Sweep, Path], tmp_path: Path) -> None:
    sweep, store = made
    plan = pickle.loads(pickle.dumps(sweep.plan))
    assert plan.to_ron() == sweep.plan.to_ron() and plan.path == sweep.plan.path
    maker = Maker(plan, tmp_path / "s")
    items = [(item, sweep.id(item)) for item in range(9)]
    outcomes = maker.make(items[:5]) + maker.make(items[4:])
    assert [status for status, _ in outcomes] == "done done refused done done there refused done done refused".split()
    assert files(tmp_path / "s" / "items") == files(store / "items")
    with pytest.raises(ValueError, match="item 0 is called"):
        Maker(plan, tmp_path / "other").make([(0, sweep.id(1))])
    with pytest.raises(ValueError, match="64 hexadecimal digits"):
        maker.make([(0, "x")])


def test_store_reads_back(made: tuple[Sweep, Path]) -> None:
    _, folder = made
    store = Store(folder)
    assert len(store) == 9 and len(store.done) == 6 and [item.number for item in store[1:3]] == [1, 2]
    assert store.index[3]["values"] == {"exposure.Manual.time_s": 0.01, "stop.FNumber": 4}
    refused, item = store[2], store[3]
    assert refused.status == "refused" and "opens to f/" in (refused.reason or "") and refused.metrics == {}
    shot = item.camera().render()
    assert np.array_equal(item.array("picture"), shot.rgb) and item.array("picture").dtype == np.uint8
    assert np.array_equal(item.array("raw"), shot.raw) and item.array("raw").dtype == np.uint16
    irradiance, bands = read_samples(item.path("irradiance"))
    assert np.array_equal(irradiance, shot.irradiance) and bands == [450.0, 550.0, 650.0]
    assert not irradiance.flags.writeable
    assert item.report()["sensor"]["exposure_time_s"] == item.metrics["exposure_time_s"] == 0.01
    assert item._repr_png_() == shot.png() and refused._repr_png_() is None
    with pytest.raises(FileNotFoundError, match="the outputs of the plan"):
        item.array("depth")


def test_samples_of_other_files(tiny: dp.Camera, tmp_path: Path) -> None:
    """Channels of numbers, one and several, beside pictures and bands."""
    shot = tiny.render()
    shot.save(tmp_path / "run")
    volts, names = read_samples(tmp_path / "run" / "volts.exr")
    assert np.array_equal(volts, shot.volts) and names == ["V"]
    depth, names = read_samples(tmp_path / "run" / "depth.exr")
    assert np.array_equal(depth, shot.depth_m) and names == ["Z"]
    with pytest.raises(OSError, match="none.png"):
        read_samples(tmp_path / "none.png")


def test_store_as_tables(made: tuple[Sweep, Path]) -> None:
    _, folder = made
    xr = pytest.importorskip("xarray")
    data = Store(folder).to_xarray(["picture", "irradiance"])
    assert isinstance(data, xr.Dataset) and dict(data.sizes) == {
        "item": 6, "y": 32, "x": 48, "channel": 3, "wavelength": 3,
    }  # fmt: skip
    assert data["picture"].dims == ("item", "y", "x", "channel")
    assert data["irradiance"].dims == ("item", "wavelength", "y", "x") and data["wavelength"].attrs["units"] == "nm"
    assert list(data["stop.FNumber"].values) == [4, 8, 4, 8, 4, 8]
    # Ten times the time makes ten times the electrons, up to the rounding of a sum.
    electrons = data["mean_e.G"].values
    assert np.allclose(electrons[2:] / electrons[:-2], 10, rtol=1e-9)
    pandas = pytest.importorskip("pandas")
    table = Store(folder).to_pandas()
    assert isinstance(table, pandas.DataFrame) and len(table) == 9
    assert table.index.dtype == np.int64 and table["stop.FNumber"].dtype == table["mean_e.G"].dtype == np.float64
    assert pandas.isna(table.loc[3, "reason"]) and "opens to f/" in table.loc[2, "reason"]
    assert table.loc[3, "stop.FNumber"] == 4 and table.loc[2, "status"] == "refused"


def test_wrong_plans_and_stores_end_in_a_sentence(tmp_path: Path) -> None:
    path = write_plan(tmp_path, PLAN.replace("stop.FNumber", "stop.Fnumber"))
    with pytest.raises(ValueError, match="'stop.Fnumber'"):
        Sweep(Plan.read(path))
    with pytest.raises(ValueError, match="plan.ron:1:1"):
        Plan.from_ron("never")
    with pytest.raises(OSError, match="none.ron"):
        Plan.read(tmp_path / "none.ron")
    with pytest.raises(FileNotFoundError, match="dioptric sweep index"):
        Store(tmp_path)
    (tmp_path / "index.jsonl").write_text('{"item": 0}\n')
    with pytest.raises(OSError, match="line 1: missing field `id`"):
        Store(tmp_path)
    sweep = Sweep(Plan.from_ron(PLAN, tmp_path / "other.ron"))
    with pytest.raises(OSError, match="other.store"):
        sweep.write_index()
    with pytest.raises(ValueError, match="expected I/N"):
        sweep.run(shard="3")
    with pytest.raises(ValueError, match="items_per_tar is 0, expected 1 or more"):
        sweep.pack(tmp_path / "a.tar", items_per_tar=0)


def test_unreadable_files_are_no_results(tmp_path: Path) -> None:
    (tmp_path / "cut.exr").write_bytes(b"\x76\x2f\x31\x01")
    scene = '(source: File("cut.exr"), field_of_view_deg: 14.0, depth_m: 2.0)'
    text = PLAN.replace("scene: (source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0)", "scene: " + scene)
    sweep = Sweep(Plan.from_ron(text, tmp_path / "plan.ron"))
    counts = sweep.run()
    # The camera whose lens does not open so far is refused before the scene is read.
    assert (counts["done"], counts["failed"] + counts["refused"]) == (0, 9) and counts["failed"] >= 6
    assert "cut.exr" in counts["first_failure"]
    assert sweep.counts()["missing"] == counts["failed"]


def test_run_can_be_interrupted(tmp_path: Path) -> None:
    """What is finished stays, and nothing half made does."""
    sweep = Sweep(Plan.from_ron(PLAN, tmp_path / "plan.ron"))

    def stop(what: str, part: float) -> None:
        if part >= 2 / 9:
            raise KeyError(what)

    with pytest.raises(KeyError):
        sweep.run(progress=stop)
    assert {path.name for path in sweep.plan.store.iterdir()} == {"items"}
    counts = sweep.run()
    assert counts["there"] >= 2 and counts["there"] + counts["done"] + counts["refused"] == 9


def test_index_of_many_items_opens_quickly(tmp_path: Path) -> None:
    import time

    row = {"item": 0, "id": "a" * 64, "status": "done", "values": {"seed": 1}, "metrics": {f"m{n}": 1.5 for n in range(25)}}
    with (tmp_path / "index.jsonl").open("w") as out:
        for n in range(10_000):
            out.write(json.dumps({**row, "item": n, "id": f"{n:064x}", "values": {"seed": n}}) + "\n")
    start = time.perf_counter()
    store = Store(tmp_path)
    assert len(store) == 10_000 and isinstance(store[9_999], Item) and store[9_999].values == {"seed": 9_999}
    assert time.perf_counter() - start < 1


def write_lines(folder: Path, n_items: int) -> int:
    """Writes an index of items that are done; returns its size, bytes."""
    metrics = {f"m{n}": n + 0.123456789 for n in range(40)}
    with (folder / "index.jsonl").open("w") as out:
        for n in range(n_items):
            row = {"item": n, "id": f"{n:064x}", "status": "done", "values": {"seed": n}, "metrics": metrics}
            out.write(json.dumps(row) + "\n")
    return (folder / "index.jsonl").stat().st_size


def test_an_open_index_holds_no_lines(tmp_path: Path) -> None:
    """Some 16 bytes an item, and as many again while it is opened; all lines gone through one by one."""
    n_items = 60_000
    size = write_lines(tmp_path, n_items)
    script = (
        "import resource, sys\n"
        "from dioptric.sweep import Store\n"
        "most = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "before, store = most(), Store(sys.argv[1])\n"
        "assert sum(item.values['seed'] for item in store.done) == sum(range(len(store)))\n"
        "print(most() - before)"
    )
    run = [sys.executable, "-c", script, str(tmp_path)]
    grown = int(subprocess.run(run, check=True, capture_output=True, text=True).stdout)
    # Names of 32 bytes in a table that is up to twice as large, the lines' places, and 4 MB of buffers and code.
    unit = 1 if sys.platform == "darwin" else 1024
    assert size > 55e6 and grown * unit < 200 * n_items + 4e6


def test_an_index_that_was_written_anew_is_opened_again(tmp_path: Path) -> None:
    write_lines(tmp_path, 3)
    store = Store(tmp_path)
    last, middle = store[-1], store[1:2]
    assert (last.number, [item.number for item in middle], len(store.done)) == (2, [1], 3)
    with pytest.raises(IndexError):
        store[3]
    write_lines(tmp_path, 4)
    with pytest.raises(OSError, match="written anew"):
        store[0]
    assert pickle.loads(pickle.dumps(Store(tmp_path).done))[3].values == {"seed": 3}


def test_importing_the_package_imports_no_extras() -> None:
    script = "import sys, dioptric, dioptric.sweep; print([name for name in ('ray', 'torch', 'pandas', 'xarray', 'tqdm') if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout == "[]\n"
