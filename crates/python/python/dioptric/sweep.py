"""Many pictures of a varied camera: plans, and the stores that keep their pictures.

>>> from dioptric.sweep import Plan, Store, Sweep
>>> Sweep(Plan.read("plan.ron")).run("store", progress=True)
>>> table = Store("store").to_pandas()

A plan and a store are those of ``dioptric sweep``; an item is the same to the byte, whoever makes it.
"""

from __future__ import annotations

import importlib
import json
import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ._native import Camera, Maker, Plan, Sweep, read_samples

__all__ = ["Item", "Maker", "Plan", "Store", "Sweep", "read_samples"]

_FILES = {
    "picture": "picture.png",
    "raw": "raw.png",
    "irradiance": "irradiance.exr",
    "depth": "depth.exr",
    "volts": "volts.exr",
    "electrons": "electrons.exr",
}


class Item:
    """What came of an item of a plan: a line of the index, and its files."""

    def __init__(self, folder: Path, row: dict[str, Any]) -> None:
        self._store = folder
        self._row = row

    @property
    def number(self) -> int:
        """Its number in the plan, from 0."""
        return int(self._row["item"])

    @property
    def id(self) -> str:
        """Its name."""
        return str(self._row["id"])

    @property
    def status(self) -> str:
        """``"done"``, ``"refused"`` or ``"missing"``."""
        return str(self._row["status"])

    @property
    def reason(self) -> str | None:
        """Why its camera was refused."""
        return self._row.get("reason")

    @property
    def values(self) -> dict[str, Any]:
        """What it sets, by the keys of the plan."""
        return dict(self._row["values"])

    @property
    def metrics(self) -> dict[str, float]:
        """Numbers of its report."""
        return dict(self._row.get("metrics", {}))

    @property
    def folder(self) -> Path:
        """The folder of its files."""
        return self._store / "items" / self.id[:2] / self.id

    def path(self, name: str) -> Path:
        """Returns the path of a file: ``"picture"``, ``"raw"``, ``"irradiance"``, ``"depth"``, ``"volts"``, ``"electrons"``, or
        any name of a file."""
        return self.folder / _FILES.get(name, name)

    def array(self, name: str) -> NDArray[Any]:
        """Returns a file as a read-only array: shapes and types are those of `read_samples`.

        What a plan's ``outputs`` do not ask for is not there.
        """
        path = self.path(name)
        if not path.exists():
            raise FileNotFoundError(f"{path}: there is no such file; the outputs of the plan say what is written of an item")
        return read_samples(path)[0]

    def report(self) -> dict[str, Any]:
        """Returns what was measured, the keys of ``report.json``."""
        report: dict[str, Any] = json.loads(self.path("report.json").read_text(encoding="utf-8"))
        return report

    def camera(self) -> Camera:
        """Returns its camera."""
        return Camera.read(self.path("camera.ron"))

    def _repr_png_(self) -> bytes | None:
        picture = self.path("picture")
        return picture.read_bytes() if picture.exists() else None

    def __repr__(self) -> str:
        return f"<Item {self.number}: {self.status}, {self.values}>"


class Store:
    """The items of a store as its index has them, in the order of the plan.

    Parameters
    ----------
    folder : str or os.PathLike
        The store of a sweep. Its ``index.jsonl`` is read now; `Sweep.write_index` writes it anew.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._folder = Path(folder)
        self._rows = list(rows(self._folder))

    @property
    def folder(self) -> Path:
        """The folder."""
        return self._folder

    @property
    def index(self) -> list[dict[str, Any]]:
        """A dictionary an item: ``item``, ``id``, ``status``, ``values``, and ``metrics`` or ``reason``."""
        return self._rows

    @property
    def done(self) -> list[Item]:
        """The items that have a picture, each once."""
        known: dict[str, Item] = {}
        for item in self:
            if item.status == "done":
                known.setdefault(item.id, item)
        return list(known.values())

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, number: int) -> Item: ...
    @overload
    def __getitem__(self, number: slice) -> list[Item]: ...
    def __getitem__(self, number: int | slice) -> Item | list[Item]:
        if isinstance(number, slice):
            return [Item(self._folder, row) for row in self._rows[number]]
        return Item(self._folder, self._rows[number])

    def __iter__(self) -> Iterator[Item]:
        return (Item(self._folder, row) for row in self._rows)

    def to_pandas(self) -> Any:
        """Returns the index as a ``pandas.DataFrame``: a row an item, a column a key and a metric."""
        try:
            pandas = importlib.import_module("pandas")
        except ImportError as error:
            raise ImportError("to_pandas needs pandas: pip install pandas") from error
        table = pandas.DataFrame([flat(row) for row in self._rows])
        return table.set_index("item")

    def to_xarray(self, arrays: Sequence[str] = ()) -> Any:
        """Returns the finished items as an ``xarray.Dataset``.

        Parameters
        ----------
        arrays : list of str
            Files to load beside the metrics, as ``["picture", "raw"]``, all at once and so of one shape.

        Returns
        -------
        xarray.Dataset
            Dimension ``item``; the keys of the plan are its coordinates, metrics its variables, and arrays have dimensions
            ``y``, ``x``, ``channel`` and ``wavelength``, which is in nm.
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise ImportError("to_xarray needs xarray: pip install 'dioptric[xarray]'") from error
        done = self.done
        table = columns([flat(item._row) for item in done])
        metrics = {name for item in done for name in item.metrics}
        coordinates: dict[str, Any] = {
            name: ("item", column)
            for name, column in table.items()
            if name not in metrics and name not in ("item", "status", "reason")
        }
        coordinates["item"] = ("item", np.array([item.number for item in done]))
        variables: dict[str, Any] = {name: ("item", table[name]) for name in table if name in metrics}
        for name in arrays:
            dimensions, stacked, bands = self._stacked(name, done)
            variables[name] = (("item", *dimensions), stacked)
            if bands is not None:
                coordinates["wavelength"] = ("wavelength", bands, {"units": "nm"})
        return xr.Dataset(variables, coordinates)

    def _stacked(self, name: str, done: list[Item]) -> tuple[tuple[str, ...], NDArray[Any], list[float] | None]:
        stacked: NDArray[Any] | None = None
        dimensions: tuple[str, ...] = ()
        bands = None
        for n, item in enumerate(done):
            array, names = read_samples(item.path(name))
            if stacked is None:
                dimensions, bands = layout(array, names)
                stacked = np.empty((len(done), *array.shape), array.dtype)
            check_shape(item, name, array, stacked.shape[1:])
            stacked[n] = array
        if stacked is None:
            raise ValueError(f"{self._folder}: none of its items is finished")
        return dimensions, stacked, bands

    def __repr__(self) -> str:
        return f"<Store {self._folder}: {len(self)} items>"


def rows(folder: Path) -> Iterator[dict[str, Any]]:
    """Yields the lines of a store's index, without holding them."""
    path = folder / "index.jsonl"
    try:
        lines = path.open(encoding="utf-8")
    except FileNotFoundError as error:
        raise FileNotFoundError(f"{path}: there is no index; `dioptric sweep index PLAN` writes one") from error
    with lines:
        for line in lines:
            yield json.loads(line)


def flat(row: dict[str, Any]) -> dict[str, Any]:
    """Returns a line of an index as the row of a table: values that are neither numbers nor words are their JSON text."""
    values = {key: cell(value) for key, value in row["values"].items()}
    own = {"item": row["item"], "id": row["id"], "status": row["status"]}
    return {**own, **values, **row.get("metrics", {}), "reason": row.get("reason")}


def cell(value: Any) -> Any:
    """Returns a value of a plan as the cell of a table."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return json.dumps(value)


def columns(table: list[dict[str, Any]]) -> dict[str, NDArray[Any]]:
    """Returns rows as columns: numbers where all cells are, with NaN where there is none; else text."""
    names = dict.fromkeys(name for row in table for name in row)
    result: dict[str, NDArray[Any]] = {}
    for name in names:
        cells = [row.get(name) for row in table]
        if all(isinstance(cell, (int, float)) or cell is None for cell in cells):
            result[name] = np.array([math.nan if cell is None else cell for cell in cells], np.float64)
        else:
            result[name] = np.array(["" if cell is None else str(cell) for cell in cells])
    return result


def layout(array: NDArray[Any], names: Sequence[Any]) -> tuple[tuple[str, ...], list[float] | None]:
    """Returns the names of the dimensions of what `read_samples` returned, and the centers of its bands, nm."""
    if array.ndim == 2:
        return ("y", "x"), None
    if names and isinstance(names[0], float):
        return ("wavelength", "y", "x"), [float(name) for name in names]
    return (("y", "x", "channel") if array.shape[2] == len(names) else ("channel", "y", "x")), None


def check_shape(item: Item, name: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
    """Refuses an array of another shape than that of the first item."""
    if array.shape != shape:
        raise ValueError(f"item {item.number}: {name} is of shape {array.shape}, expected {shape} as of the first")
