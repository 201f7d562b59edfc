"""Sweeps on Ray: the store of the program to the byte, whatever is lost on the way. Skipped where Ray is not installed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import dioptric.ray
import pytest
from dioptric.sweep import Plan, Sweep
from plans import PLAN, files, write_plan

pytest.importorskip("ray", reason="Ray is not installed")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are looked up as Linux has them")

# Each item takes a fraction of a second.
SLOW = PLAN.replace("columns: 48, rows: 32, pitch_um: 200.0", "columns: 300, rows: 200, pitch_um: 32.0").replace(
    "ListNm([450.0, 550.0, 650.0])", "ListNm([420.0, 460.0, 500.0, 540.0, 580.0, 620.0, 660.0])"
).replace("List([4, 8, 0.1])", "List([2.8, 4, 5.6, 8, 0.1])").replace("pattern: Uniform", "pattern: Checkerboard(check_px: 4)")


def local(sweep: Sweep, folder: Path) -> dict[str, bytes]:
    """Returns the files of the store that this process makes."""
    sweep.run(folder)
    return files(folder)


def holders(store: Path) -> list[int]:
    """Returns the processes that make items in a store: they hold the lock of a folder in it."""
    found = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            try:
                links = [os.readlink(link) for link in (process / "fd").iterdir()]
            except OSError:
                continue
            if any(link.startswith(f"{store}/.tmp-") and link.endswith("/lock") for link in links):
                found.append(int(process.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="processes are looked up as Linux has them")
def test_killed_worker_changes_nothing(tmp_path: Path) -> None:
    """Two workers, one of them killed in the midst of an item, twice."""
    path = write_plan(tmp_path, SLOW)
    sweep = Sweep(Plan.read(path))
    store = tmp_path / "on-ray"
    command = [sys.executable, "-m", "dioptric.ray", str(path), "--store", str(store), "--workers", "2", "--quiet", "--json"]
    driver = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    killed: list[int] = []
    deadline = time.monotonic() + 100
    while len(killed) < 2 and driver.poll() is None and time.monotonic() < deadline:
        # The second only after something was finished, so that a task that has begun is lost as well.
        if killed and not any(store.glob("items/*/*")):
            continue
        for process in [pid for pid in holders(store) if pid not in killed][:1]:
            os.kill(process, signal.SIGKILL)
            killed.append(process)
        time.sleep(0.01)
    out, error = driver.communicate(timeout=100)
    assert driver.returncode == 0, error
    assert len(killed) == 2, "the sweep was over before anybody was killed"
    assert files(store) == local(sweep, tmp_path / "local")
    assert {entry.name for entry in store.iterdir()} == {"items", "index.jsonl", "index.csv", "index.html"}


def test_lost_node_changes_nothing(tmp_path: Path) -> None:
    """A cluster of two nodes, one of which goes away with what it was making."""
    import ray
    from ray.cluster_utils import Cluster

    sweep = Sweep(Plan.from_ron(SLOW, tmp_path / "plan.ron"))
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        lost = cluster.add_node(num_cpus=1)
        ray.init(address=cluster.address, log_to_driver=False, logging_level="warning")
        outcomes = []
        for outcome in dioptric.ray.outcomes(sweep, tmp_path / "on-ray"):
            outcomes.append(outcome)
            if len(outcomes) == 1:
                cluster.remove_node(lost, allow_graceful=False)
        assert ray.is_initialized()
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert sorted(outcome.item for outcome in outcomes) == list(range(15))
    assert {outcome.status for outcome in outcomes} <= {"done", "refused", "there"}
    sweep.write_index(tmp_path / "on-ray")
    assert files(tmp_path / "on-ray") == local(sweep, tmp_path / "local")


def test_items_that_end_their_worker_fail_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their task is tried item by item; refused cameras are results, and unreadable files are reported."""
    (tmp_path / "cut.exr").write_bytes(b"\x76\x2f\x31\x01")
    cut = '(source: File("cut.exr"), field_of_view_deg: 14.0, depth_m: 2.0)'
    flat = "(source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0)"
    text = PLAN.replace('"stop.FNumber": List([4, 8, 0.1])})', f'"stop.FNumber": List([4, 0.1])}}), Grid({{"scene": List([{flat}, {cut}])}})')
    sweep = Sweep(Plan.from_ron(text, tmp_path / "plan.ron"))

    def make(plan: Plan, store: str, threads: int, items: list[tuple[int, str]]) -> list[tuple[str, str | None]]:
        import os

        from dioptric.sweep import Maker

        if any(item == 4 for item, _ in items):
            os._exit(1)
        return Maker(plan, store).make(items)

    monkeypatch.setattr(dioptric.ray, "_make", make)
    monkeypatch.setattr(dioptric.ray, "_RETRIES", 0)
    store = tmp_path / "store"
    counts = dioptric.ray.run(sweep, store, workers=2)
    assert counts["there"] == 0 and counts["failed"] == 1 + 3 and counts["done"] + counts["refused"] == 8, counts
    assert sweep.counts(store)["missing"] == 4
    monkeypatch.undo()
    # The one that ended its worker is made, the refused ones are not tried again, the others fail again.
    again = dioptric.ray.run(sweep, store, workers=1)
    assert (again["there"], again["done"], again["refused"], again["failed"]) == (8, 1, 0, 3)
    assert "cut.exr" in again["first_failure"]


def test_errors_end_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert dioptric.ray.main([str(tmp_path / "none.ron")]) == 1
    assert "none.ron" in capsys.readouterr().err
    path = write_plan(tmp_path)
    assert dioptric.ray.main([str(path), "--threads", "0"]) == 1
    assert "expected 1 or more" in capsys.readouterr().err
    assert dioptric.ray.main([str(path), "--workers", "2", "--address", "auto"]) == 1
    assert "expected none with an address" in capsys.readouterr().err
    # A store that cannot be written to ends the sweep in the words of the worker.
    (tmp_path / "file").write_text("")
    assert dioptric.ray.main([str(path), "--workers", "1", "--quiet", "--store", str(tmp_path / "file" / "store")]) == 1
    assert "Not a directory" in capsys.readouterr().err
