#!/usr/bin/env python3
"""Measures what sweeps cost beside their pictures, and from it says what a million pictures on a hundred machines take.

    python3 scripts/sweep_scale.py target/release/dioptric FOLDER [reuse] [overhead] [tiny] [kill] [paper] [index] [million]

FOLDER is made and removed; on a disk it shows what bringing files to the disk costs, in /dev/shm what is left without. Of each
command it prints seconds by the clock, those of processors, and the most memory; other programs on the machine make the first long.

`index` and `million` are of 100,000 and 1,000,000 items that are not made: each is a folder with a link to one report. The latter takes some
4 GB and ten minutes of two cores. Without words all but these two are run.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

PLAN = """(
    base: Camera((
        name: "scale", lens: BuiltIn("dgauss-50mm"), focus: DistanceMm(2000.0), sensor: BuiltIn("nikon-d5100"),
        film: Pixels(columns: %(columns)d, rows: %(rows)d, pitch_um: %(pitch_um)f),
        scene: (source: Target(pattern: Checkerboard(check_px: 4), columns: %(columns)d, rows: %(rows)d), field_of_view_deg: 14.0, depth_m: 2.0),
        wavelengths: ListNm([%(bands)s]),
    )),
    vary: [Grid({"stop.FNumber": Linear(first: 2.8, last: 8, count: %(lenses)d), "exposure.Manual.time_s": Log(first: 0.001, last: 0.1, count: %(exposures)d)})],
    outputs: (raw: true),
)"""


def plan(folder: Path, **values: object) -> Path:
    """Writes a plan."""
    path = folder / "plan.ron"
    path.write_text(PLAN % values)
    return path


def run(*command: object) -> tuple[float, float, float]:
    """Runs a command; returns seconds by the clock and of processors, and MB of memory."""
    start = time.perf_counter()
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{command}: exit status {process.returncode}")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def tell(what: str, measured: tuple[float, float, float], n: int = 1) -> None:
    wall_s, cpu_s, memory_mb = measured
    each = f"; an item {1e3 * wall_s / n:.1f} and {1e3 * cpu_s / n:.1f} ms" if n > 1 else ""
    print(f"{what}: {wall_s:.2f} s, processors {cpu_s:.2f} s, {memory_mb:.0f} MB{each}", flush=True)


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


BANDS = ", ".join(f"{nm}.0" for nm in range(420, 681, 20))
LARGE_BANDS = ", ".join(f"{nm}.0" for nm in range(400, 701, 10))
LARGE = {"columns": 960, "rows": 640, "pitch_um": 10, "bands": LARGE_BANDS, "lenses": 1, "exposures": 1}
SMALL = {"columns": 240, "rows": 160, "pitch_um": 40, "bands": BANDS, "lenses": 10, "exposures": 20}
ONE_LENS = {"columns": 24, "rows": 16, "pitch_um": 400, "bands": "450.0, 550.0, 650.0", "lenses": 1}
TINY = {"columns": 16, "rows": 12, "pitch_um": 600, "bands": "450.0, 550.0, 650.0", "lenses": 10, "exposures": 1000}


def reuse(program: str, folder: Path) -> None:
    """200 items at once, and each by itself."""
    path = plan(folder, **SMALL)
    together = run(program, "sweep", path, "--quiet")
    tell("200 items of 10 lenses × 20 exposures", together, 200)
    cameras = sorted((folder / "plan.store").rglob("camera.ron"))
    wall_s = cpu_s = memory_mb = 0.0
    for n, camera in enumerate(cameras):
        # A run writes its page too, with drawings of the lens and its point spreads, which items do not have.
        each = run(program, "run", camera, "--out", folder / f"run-{n}", "--quiet")
        wall_s, cpu_s, memory_mb = wall_s + each[0], cpu_s + each[1], max(memory_mb, each[2])
        shutil.rmtree(folder / f"run-{n}")
    tell("the same as 200 runs", (wall_s, cpu_s, memory_mb), 200)
    print(f"quicker by {wall_s / together[0]:.1f} by the clock, {cpu_s / together[1]:.1f} of processors")


def overhead(program: str, folder: Path) -> None:
    """What 1,000 items of 24 × 16 pixels and one irradiance take."""
    path = plan(folder, **ONE_LENS, exposures=1)
    one = run(program, "sweep", path, "--quiet")
    shutil.rmtree(folder / "plan.store")
    many = run(program, "sweep", plan(folder, **ONE_LENS, exposures=1001), "--quiet")
    tell("1,000 more exposures of one irradiance", tuple(b - a for a, b in zip(one, many)), 1000)


def tiny(program: str, folder: Path) -> None:
    """10,000 items of 16 × 12 pixels."""
    path = plan(folder, **TINY)
    tell("drawing up 10,000 items", run(program, "sweep", path, "--dry-run", "--quiet"), 10_000)
    tell("making them, and the index", run(program, "sweep", path, "--quiet"), 10_000)
    tell("again, when all are there", run(program, "sweep", path, "--quiet"), 10_000)
    tell("the index anew", run(program, "sweep", "index", path, "--quiet"), 10_000)
    store = folder / "plan.store"
    sizes = [file.stat().st_size for file in store.rglob("*") if file.is_file()]
    print(f"{len(sizes)} files of {sum(sizes) / 1e6:.0f} MB; index.jsonl {(store / 'index.jsonl').stat().st_size / 1e6:.1f} MB")
    open_index(store)


OPEN = """
import resource, sys, time
from dioptric.sweep import Store
most = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before, start = most(), time.perf_counter()
store = Store(sys.argv[1])
print(f"{len(store):,} items open in {time.perf_counter() - start:.2f} s, {most() - before:.0f} MB")
start = time.perf_counter()
n = sum(item.metrics["mean_lux"] > 0 for item in store.done)
print(f"gone through, {n:,} done: {time.perf_counter() - start:.1f} s, {most() - before:.0f} MB")
"""


def open_index(store: Path) -> None:
    """Opens a store from Python, where the package is installed, and goes through its items."""
    subprocess.run([sys.executable, "-c", OPEN, str(store)], check=False)


def index(program: str, folder: Path, n_items: int = 100_000) -> None:
    """The index of items that are there by name, all with one report."""
    path = plan(folder, **{**TINY, "lenses": 1, "exposures": 1})
    run(program, "sweep", path, "--store", folder / "one", "--quiet")
    report = next((folder / "one").rglob("report.json"))
    path = plan(folder, **{**TINY, "lenses": 10, "exposures": n_items // 10})
    tell(f"drawing up {n_items:,} items", run(program, "sweep", path, "--dry-run", "--quiet"), n_items)
    store = folder / "plan.store"
    store.mkdir()
    tell("the index while none is there", run(program, "sweep", "index", path, "--quiet"), n_items)
    with (store / "index.jsonl").open() as lines:
        for n, line in enumerate(lines):
            # As many links as every file system allows a file.
            if n % 30_000 == 0:
                source = folder / f"report-{n}.json"
                shutil.copyfile(report, source)
            name = json.loads(line)["id"]
            item = store / "items" / name[:2] / name
            item.mkdir(parents=True)
            os.link(source, item / "report.json")
    tell("the index when all are there", run(program, "sweep", "index", path, "--quiet"), n_items)
    for name in ("index.jsonl", "index.csv", "index.html"):
        print(f"{name}: {(store / name).stat().st_size / 1e6:.1f} MB")
    open_index(store)


def million(program: str, folder: Path) -> None:
    """The same of 1,000,000 items."""
    index(program, folder, 1_000_000)


def kill(program: str, folder: Path) -> None:
    """Killed at ten random moments, and ended: the store of one that was left alone."""
    values = {**SMALL, "lenses": 4, "exposures": 4}
    path, whole, cut = plan(folder, **values), folder / "whole", folder / "cut"
    wall_s = run(program, "sweep", path, "--store", whole, "--quiet")[0]
    moments, n_killed = random.Random(1), 0
    for _ in range(10):
        process = subprocess.Popen([program, "sweep", path, "--store", cut, "--quiet"])
        time.sleep(moments.uniform(0, wall_s / 4))
        n_killed += process.poll() is None
        process.send_signal(signal.SIGKILL)
        process.wait()
    n_there = len(list(cut.glob("items/*/*")))
    run(program, "sweep", path, "--store", cut, "--quiet")
    same = files(cut) == files(whole) and not list(cut.glob(".tmp-*"))
    print(f"killed {n_killed} times, {n_there} of 16 items there then; after the last run the same store: {same}")
    if not same:
        sys.exit(1)


def paper(program: str, folder: Path) -> None:
    """A million pictures on a hundred machines of 16 cores, from what this one does: small and large ones, 20 exposures an irradiance or one."""
    for values in (SMALL, LARGE):
        imaging, item, n_files, size = measured(program, folder, values)
        print(
            f"{values['columns']} × {values['rows']} pixels: imaging {imaging:.2f} s of a processor, an exposure {1e3 * item:.0f} ms, "
            f"{n_files:.0f} files of {size / 1e3:.0f} kB an item"
        )
        for n_exposures in (20, 1):
            cpu_s = 1e6 / n_exposures * imaging + 1e6 * item
            seconds = cpu_s / 1600
            print(
                f"    {n_exposures} an irradiance: {cpu_s / 3600:.0f} hours of processors, {seconds / 60:.0f} minutes; "
                f"{1e6 * size / 1e9:.0f} GB in {n_files:.0f} million files: {1e6 * n_files / seconds:.0f} files and {1e6 * size / seconds / 1e6:.0f} MB a second"
            )


def measured(program: str, folder: Path, values: dict[str, object]) -> tuple[float, float, float, float]:
    """Returns seconds of imaging and of one more exposure, and files and bytes of an item."""
    store = folder / "plan.store"
    cpu_s = []
    for n in (1, 11):
        path = plan(folder, **{**values, "lenses": 1, "exposures": n})
        shutil.rmtree(store, ignore_errors=True)
        cpu_s.append(run(program, "sweep", path, "--quiet")[1])
    item = max(cpu_s[1] - cpu_s[0], 0) / 10
    files = [file for file in (store / "items").rglob("*") if file.is_file()]
    return cpu_s[0] - item, item, len(files) / 11, sum(file.stat().st_size for file in files) / 11


def main() -> None:
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    program, target = sys.argv[1], Path(sys.argv[2])
    steps = {step.__name__: step for step in (reuse, overhead, tiny, kill, paper, index, million)}
    parts = sys.argv[3:] or ["reuse", "overhead", "tiny", "kill", "paper"]
    if unknown := [name for name in parts if name not in steps]:
        sys.exit(f"{unknown[0]} is none of {', '.join(steps)}")
    for name in parts:
        folder = target / name
        folder.mkdir(parents=True)
        print(f"-- {name}", flush=True)
        steps[name](program, folder)
        shutil.rmtree(folder)
    target.rmdir()


if __name__ == "__main__":
    main()
