"""Sweeps on Ray: the processes of this machine, or a cluster by its address.

    python -m dioptric.ray PLAN.ron [--store DIR] [--address ADDRESS]

The store is that of ``dioptric sweep PLAN.ron``, byte by byte. A task is some items that share an irradiance. Items are in the store
when they are finished, so that a task whose worker or node is lost goes on behind the last of them; refused cameras are results.
Plan, files and store must have the same paths on all nodes.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from . import set_threads
from ._progress import Bar
from .sweep import Maker, Plan, Sweep

__all__ = ["Outcome", "main", "outcomes", "run"]

# How often Ray tries a task again whose worker is lost; then its items are tried one by one.
_RETRIES = 3
# So many tasks for each that can run at once, so that the last to end are short.
_TASKS_EACH = 4


class Outcome(NamedTuple):
    """What came of an item."""

    item: int
    """Its number in the plan."""
    status: str
    """``"done"``, ``"refused"``, ``"there"`` where another made it meanwhile, or ``"failed"``."""
    reason: str | None
    """Why it failed."""


def run(
    sweep: Sweep,
    store: str | os.PathLike[str] | None = None,
    *,
    address: str | None = None,
    workers: int | None = None,
    threads: int = 1,
    progress: bool = False,
) -> dict[str, Any]:
    """Makes the items that are not there, and writes the index.

    Parameters
    ----------
    sweep : Sweep
    store : str or os.PathLike, optional
        Folder that keeps the results, the same on all nodes. Default: ``plan.store``.
    address : str, optional
        Of a cluster, as ``"auto"`` or ``"ray://head:10001"``. Default: processes of this machine, unless Ray is connected already.
    workers : int, optional
        Processes of this machine, without an address. Default: as many as its cores have room for.
    threads : int
        Threads, and so cores, of a task.
    progress : bool
        Shows a bar.

    Returns
    -------
    dict
        As of `Sweep.run`.
    """
    folder = Path(store if store is not None else sweep.plan.store).absolute()
    counts: dict[str, Any] = {"there": 0, "done": 0, "refused": 0, "failed": 0, "left": 0, "first_failure": None}
    n_missing = sum(map(len, sweep.groups(folder)))
    counts["there"] = len(sweep) - n_missing
    bar = Bar() if progress else None
    try:
        for n, outcome in enumerate(
            outcomes(sweep, folder, address=address, workers=workers, threads=threads), start=1
        ):
            counts[outcome.status] += 1
            if outcome.reason is not None and counts["first_failure"] is None:
                counts["first_failure"] = outcome.reason
            if bar:
                bar(f"{n}/{n_missing} items", n / n_missing)
    finally:
        if bar:
            bar.close()
    folder.mkdir(parents=True, exist_ok=True)
    sweep.write_index(folder)
    return counts


def outcomes(
    sweep: Sweep,
    store: str | os.PathLike[str],
    *,
    address: str | None = None,
    workers: int | None = None,
    threads: int = 1,
) -> Iterator[Outcome]:
    """Makes the items that are not there, and yields what came of each as their tasks end.

    Parameters are those of `run`. Ray is connected, and left again, unless it was connected before.
    """
    if threads < 1 or (workers is not None and workers < 1):
        raise ValueError(f"threads is {threads} and workers is {workers}, expected 1 or more")
    if address is not None and workers is not None:
        raise ValueError(f"workers is {workers}, expected none with an address: the cluster's nodes have so many as they have")
    ray = _ray()
    if ray.is_initialized() and (address is not None or workers is not None):
        raise ValueError("Ray is connected already, expected neither an address nor a number of workers")
    folder = Path(store).absolute()
    groups = sweep.groups(folder)
    if not groups:
        return
    was_connected = ray.is_initialized()
    if not was_connected:
        _connect(ray, address, workers, threads)
    try:
        yield from _scheduled(ray, sweep, folder, groups, threads)
    finally:
        if not was_connected:
            ray.shutdown()


def _ray() -> Any:
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise ImportError("dioptric.ray needs Ray: pip install 'dioptric[ray]'") from error


def _connect(ray: Any, address: str | None, workers: int | None, threads: int) -> None:
    if address is not None:
        ray.init(address=address, log_to_driver=False, logging_level="warning")
        return
    # A session of this machine alone talks to nobody else.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    ray.init(
        num_cpus=(workers or max(1, _cores() // threads)) * threads,
        include_dashboard=False,
        log_to_driver=False,
        logging_level="warning",
        # Tasks hand over names alone.
        object_store_memory=100 << 20,
        _node_ip_address="127.0.0.1",
    )


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _scheduled(ray: Any, sweep: Sweep, store: Path, groups: list[list[int]], threads: int) -> Iterator[Outcome]:
    slots = max(1, int(ray.cluster_resources().get("CPU", 1)) // threads)
    waiting = deque(_tasks(groups, slots))
    make = ray.remote(num_cpus=threads, max_retries=_RETRIES, retry_exceptions=False)(_make)
    plan = ray.put(sweep.plan)
    running: dict[Any, list[int]] = {}
    try:
        while waiting or running:
            slots = max(slots, int(ray.cluster_resources().get("CPU", 1)) // threads)
            # Some more than can run, so that nobody waits for the next; not all, which may be many.
            while waiting and len(running) < 3 * slots:
                items = waiting.popleft()
                running[make.remote(plan, str(store), threads, [(item, sweep.id(item)) for item in items])] = items
            (ended,), _ = ray.wait(list(running), num_returns=1)
            items = running.pop(ended)
            try:
                results = ray.get(ended)
            except ray.exceptions.RayTaskError as error:
                raise (error.cause if isinstance(error.cause, Exception) else error) from None
            except ray.exceptions.RayError as error:
                # The worker was lost again and again: one of the items may be to blame.
                if len(items) > 1:
                    waiting.extendleft([item] for item in reversed(items))
                else:
                    reason = str(error).splitlines()[0]
                    yield Outcome(items[0], "failed", f"item {items[0]} ended its worker {_RETRIES + 1} times: {reason}")
                continue
            for item, (status, reason) in zip(items, results):
                yield Outcome(item, status, reason)
    finally:
        for task in running:
            ray.cancel(task, force=True)


def _tasks(groups: list[list[int]], slots: int) -> list[list[int]]:
    """Returns groups as tasks: large ones in parts, so that all slots have work; then a scene is imaged once a part."""
    n_items = sum(map(len, groups))
    most = max(1, -(-n_items // (_TASKS_EACH * slots)))
    return [group[first : first + most] for group in groups for first in range(0, len(group), most)]


# The plan that this worker had last, with what its items share.
_kept: tuple[tuple[str, str, str, int], Maker] | None = None


def _make(plan: Plan, store: str, threads: int, items: list[tuple[int, str]]) -> list[tuple[str, str | None]]:
    """Runs in a worker."""
    global _kept
    key = (plan.to_ron(), str(plan.path), store, threads)
    if _kept is None or _kept[0] != key:
        set_threads(threads)
        _kept = (key, Maker(plan, store))
    return _kept[1].make(items)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m dioptric.ray", description="Makes the items of a plan on Ray.")
    parser.add_argument("plan", type=Path, help="the plan file")
    parser.add_argument("--store", type=Path, help="folder that keeps the results [default: that of the plan's name, ending in .store]")
    parser.add_argument("--address", help="of a cluster, as auto or ray://head:10001 [default: processes of this machine]")
    parser.add_argument("--workers", type=int, help="processes of this machine [default: one a core]")
    parser.add_argument("--threads", type=int, default=1, help="threads, and so cores, of a task [default: 1]")
    parser.add_argument("--json", action="store_true", help="prints what came of it as JSON")
    parser.add_argument("--quiet", action="store_true", help="shows no progress")
    given = parser.parse_args(arguments)
    try:
        counts = run(
            Sweep(Plan.read(given.plan)),
            given.store,
            address=given.address,
            workers=given.workers,
            threads=given.threads,
            progress=not given.quiet,
        )
    except KeyboardInterrupt:
        print("error: interrupted; what is finished stays, and the next sweep goes on from there", file=sys.stderr)
        return 130
    except (ImportError, OSError, RuntimeError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    if given.json:
        print(json.dumps(counts))
    elif not given.quiet:
        told = "{there} items were there, {done} were made, {refused} refused, {failed} failed"
        print(told.format(**counts))
    if counts["failed"]:
        print(
            f"error: {counts['failed']} items were not made, the first since {counts['first_failure']}; "
            "they are tried again when the sweep is started again",
            file=sys.stderr,
        )
        return 1
    return 0


if __name__ == "__main__":
    # By its name, so that workers find the functions in the package.
    sys.exit(importlib.import_module("dioptric.ray").main())
