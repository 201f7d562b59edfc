"""Many pictures of a varied camera: plans, and the stores that keep their pictures.

>>> from dioptric.sweep import Plan, Store, Sweep
>>> Sweep(Plan.read("plan.ron")).run("store", progress=True)
>>> table = Store("store").to_pandas()

A plan and a store are those of ``dioptric sweep``; an item is the same to the byte, whoever makes it.
"""

from __future__ import annotations

import copy
import importlib
import json
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ._native import Camera, Maker, Plan, Sweep, read_index, read_samples

__all__ = ["Index", "Item", "Items", "Maker", "Plan", "Store", "Sweep", "read_samples"]

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
        path = self.path("report.json")
        if not path.exists():
            raise FileNotFoundError(f"{path}: there is no report; `keep` of the plan says what is kept of an item")
        report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return report

    def camera(self) -> Camera:
        """Returns its camera."""
        return Camera.read(self.path("camera.ron"))

    def _repr_png_(self) -> bytes | None:
        picture = self.path("picture")
        return picture.read_bytes() if picture.exists() else None

    def __repr__(self) -> str:
        return f"<Item {self.number}: {self.status}, {self.values}>"


class Index(Sequence[dict[str, Any]]):
    """The lines of a store's index: a dictionary an item, with ``item``, ``id``, ``status``, ``values``, and ``metrics`` or ``reason``.

    A line is read when it is asked for: what is held is where each begins, some 16 bytes an item.

    Parameters
    ----------
    folder : str or os.PathLike
        The store. When its index is written anew later, it must be opened again: reading from this one is an ``OSError``.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._path = Path(folder) / "index.jsonl"
        try:
            self._stamp = _stamp(os.stat(self._path))
        except FileNotFoundError as error:
            raise FileNotFoundError(
                f"{self._path}: there is no index; `dioptric sweep index PLAN` writes one"
            ) from error
        self._starts, self._done = read_index(self._path)
        self._numbers: NDArray[np.uint64] = np.arange(len(self._starts) - 1, dtype=np.uint64)

    def done(self) -> Index:
        """Returns the lines of items that have a picture, each item once."""
        return self._of(self._done)

    def _of(self, numbers: NDArray[np.uint64]) -> Index:
        part = copy.copy(self)
        part._numbers = numbers
        return part

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, number: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, number: slice) -> Index: ...
    def __getitem__(self, number: int | slice) -> dict[str, Any] | Index:
        if isinstance(number, slice):
            return self._of(self._numbers[number])
        return next(self._read([int(self._numbers[number])]))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return self._read(map(int, self._numbers))

    def _read(self, numbers: Iterable[int]) -> Iterator[dict[str, Any]]:
        with self._path.open("rb") as lines:
            if _stamp(os.fstat(lines.fileno())) != self._stamp:
                raise OSError(f"{self._path}: it was written anew since it was opened; open the store again")
            place = 0
            for number in numbers:
                start, end = int(self._starts[number]), int(self._starts[number + 1])
                if start != place:
                    lines.seek(start)
                row: dict[str, Any] = json.loads(lines.read(end - start))
                place = end
                yield row


def _stamp(state: os.stat_result) -> tuple[int, int, int]:
    return state.st_ino, state.st_size, state.st_mtime_ns


class Items(Sequence[Item]):
    """Items of a store, each read from its index when it is asked for.

    Parameters
    ----------
    folder : pathlib.Path
        The store.
    rows : Index
        The lines of the items.
    """

    def __init__(self, folder: Path, rows: Index) -> None:
        self._store = folder
        self.rows: Index = rows

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, number: int) -> Item: ...
    @overload
    def __getitem__(self, number: slice) -> Items: ...
    def __getitem__(self, number: int | slice) -> Item | Items:
        if isinstance(number, slice):
            return Items(self._store, self.rows[number])
        return Item(self._store, self.rows[number])

    def __iter__(self) -> Iterator[Item]:
        return (Item(self._store, row) for row in self.rows)

    def __repr__(self) -> str:
        return f"<{len(self)} items of {self._store}>"


class Store:
    """The items of a store as its index has them, in the order of the plan.

    Parameters
    ----------
    folder : str or os.PathLike
        The store of a sweep. Its ``index.jsonl`` is looked through now, and its lines are read when they are asked for;
        `Sweep.write_index` writes it anew.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._folder = Path(folder)
        self._index = Index(self._folder)

    @property
    def folder(self) -> Path:
        """The folder."""
        return self._folder

    @property
    def index(self) -> Index:
        """A dictionary an item: ``item``, ``id``, ``status``, ``values``, and ``metrics`` or ``reason``."""
        return self._index

    @property
    def done(self) -> Items:
        """The items that have a picture, each once."""
        return Items(self._folder, self._index.done())

    def __len__(self) -> int:
        return len(self._index)

    @overload
    def __getitem__(self, number: int) -> Item: ...
    @overload
    def __getitem__(self, number: slice) -> Items: ...
    def __getitem__(self, number: int | slice) -> Item | Items:
        return Items(self._folder, self._index)[number]

    def __iter__(self) -> Iterator[Item]:
        return iter(self[:])

    def to_pandas(self) -> Any:
        """Returns the index as a ``pandas.DataFrame``: a row an item, a column a key and a metric."""
        try:
            pandas = importlib.import_module("pandas")
        except ImportError as error:
            raise ImportError("to_pandas needs pandas: pip install pandas") from error
        return pandas.DataFrame(columns(self._index, as_objects=True)).infer_objects().set_index("item")

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
        table = columns(done.rows)
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

    def _stacked(self, name: str, done: Items) -> tuple[tuple[str, ...], NDArray[Any], list[float] | None]:
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


def kinds(rows: Iterable[dict[str, Any]]) -> dict[str, type]:
    """Returns the types of the columns of an index: bool, int, float, str where they differ otherwise; NoneType without a value."""
    known: dict[str, type] = {}
    for row in rows:
        for name, value in flat(row).items():
            known[name] = _wider(known.get(name, type(None)), type(value))
    return known


def _wider(known: type, found: type) -> type:
    if known is found or found is type(None):
        return known
    if known is type(None):
        return found
    return float if {known, found} == {int, float} else str


def columns(rows: Sequence[dict[str, Any]], *, as_objects: bool = False) -> dict[str, NDArray[Any]]:
    """Returns lines of an index as columns: float64 where all cells are numbers, with NaN where there is none; else text.

    As objects, the cells of other columns than those of floats stay what they are. The lines are gone through twice.
    """
    types = kinds(rows)
    numeric = [float] if as_objects else [bool, int, float, type(None)]
    result: dict[str, NDArray[Any]] = {}
    for name, kind in types.items():
        is_number = kind in numeric
        empty = math.nan if is_number else None if as_objects else ""
        result[name] = np.full(len(rows), empty, np.float64 if is_number else object)
    for n, row in enumerate(rows):
        for name, value in flat(row).items():
            if value is not None:
                result[name][n] = value if as_objects or types[name] in numeric else str(value)
    if as_objects:
        return result
    return {name: column if types[name] in numeric else column.astype(str) for name, column in result.items()}


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
