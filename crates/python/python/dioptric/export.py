"""A store as one table or one array: Parquet for its numbers, Zarr for its pictures.

    python -m dioptric.export STORE --parquet index.parquet [--files picture.png]
    python -m dioptric.export STORE --zarr pictures.zarr [--arrays picture,raw]

Memory holds some lines of the index, or one item, at a time.
"""

from __future__ import annotations

import argparse
import importlib
import itertools
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .sweep import Index, Item, Items, Store, check_shape, flat, kinds, layout, read_samples

__all__ = ["main", "to_parquet", "to_zarr"]

# Lines of the index that are held at a time; a group of rows in a Parquet file.
_LINES = 4096
# Of those that hold whole files.
_LINES_WITH_FILES = 64


def to_parquet(
    store: str | os.PathLike[str], target: str | os.PathLike[str], files: Sequence[str] = ()
) -> int:
    """Writes the index of a store as a Parquet file, and returns the number of its rows.

    Parameters
    ----------
    store : str or os.PathLike
    target : str or os.PathLike
        The file; replaced when it is whole.
    files : list of str
        Names of files whose bytes become columns, as ``["picture.png"]``; null where an item has none.

    Notes
    -----
    The columns are ``item``, ``id``, ``status``, the keys of the plan, the metrics, ``reason``, and the files. A key whose values are
    all whole numbers is int64, one of numbers float64, one of true and false boolean, any other text, which is JSON where values are choices or lists.
    """
    arrow, parquet = _module("pyarrow"), _module("pyarrow.parquet", "pyarrow")
    folder, target = Path(store), Path(target)
    index = Index(folder)
    kind_of = kinds(index)
    types = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string(), type(None): arrow.string()}
    order = sorted(kind_of, key=lambda name: name == "reason")
    schema = arrow.schema([(name, types[kind_of[name]]) for name in order] + [(name, arrow.binary()) for name in files])
    n_rows = 0
    partial = target.with_name(f".{target.name}.partial-{os.getpid()}")
    try:
        with parquet.ParquetWriter(partial, schema, compression="zstd") as writer:
            for lines in _batches(iter(index), _LINES_WITH_FILES if files else _LINES):
                columns: dict[str, list[Any]] = {name: [] for name in schema.names}
                for row in lines:
                    cells = flat(row)
                    for name in order:
                        value = cells.get(name)
                        columns[name].append(str(value) if kind_of[name] is str and value is not None else value)
                    for name in files:
                        path = Item(folder, row).folder / name
                        columns[name].append(path.read_bytes() if path.is_file() else None)
                writer.write_table(arrow.table(columns, schema=schema))
                n_rows += len(lines)
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)
    return n_rows


def to_zarr(store: str | os.PathLike[str], target: str | os.PathLike[str], arrays: Sequence[str] = ("picture",)) -> int:
    """Writes the finished items of a store as a Zarr group, and returns their number.

    Parameters
    ----------
    store : str or os.PathLike
    target : str or os.PathLike
        The group's folder, which must not be there yet; it appears whole.
    arrays : list of str
        Files of the items, as of `Item.array`, all of one shape each.

    Notes
    -----
    Each file is an array whose first dimension is ``item``, in chunks of one item; keys and metrics are arrays of that dimension. The
    format is Zarr 2, which has text of a fixed length and which all readers know; dimensions have names and wavelengths are in nm, so that
    ``xarray.open_zarr(target, consolidated=False)`` reads it.
    """
    zarr = _module("zarr")
    folder, target = Path(store), Path(target)
    if target.exists():
        raise ValueError(f"{target} is there already, expected a new folder")
    items = Store(folder).done
    if not items:
        raise ValueError(f"{folder}: none of its items is finished")
    partial = target.with_name(f".{target.name}.partial-{os.getpid()}")
    try:
        group = zarr.open_group(str(partial), mode="w", zarr_format=2)
        _write_numbers(group, items)
        for name in arrays:
            _write_array(group, name, items)
        os.rename(partial, target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return len(items)


def _write_array(group: Any, name: str, items: Items) -> None:
    array = None
    for n, item in enumerate(items):
        path = item.path(name)
        if not path.is_file():
            raise ValueError(f"item {item.number} has no {path.name}; the outputs of the plan say what is written of an item")
        samples, names = read_samples(path)
        if array is None:
            dimensions, bands = layout(samples, names)
            array = group.create_array(
                name,
                shape=(len(items), *samples.shape),
                chunks=(1, *samples.shape),
                dtype=samples.dtype,
                attributes={"_ARRAY_DIMENSIONS": ["item", *dimensions]},
            )
            if bands is not None and "wavelength" not in group:
                attributes = {"_ARRAY_DIMENSIONS": ["wavelength"], "units": "nm"}
                centers = group.create_array(
                    "wavelength", shape=(len(bands),), chunks=(len(bands),), dtype="<f8", attributes=attributes
                )
                centers[:] = np.array(bands)
        check_shape(item, name, samples, array.shape[1:])
        array[n] = samples


def _write_numbers(group: Any, items: Items) -> None:
    """Writes keys and metrics, a batch at a time; the first pass tells which are numbers, and how long the texts are."""
    lengths: dict[str, int] = {}
    texts: set[str] = set()
    for item in items:
        for name, value in _cells(item).items():
            lengths[name] = max(lengths.get(name, 1), len(str(value)))
            if isinstance(value, str):
                texts.add(name)
    chunk = min(len(items), _LINES)
    types = {name: f"<U{length}" if name in texts else "<f8" for name, length in lengths.items()}
    for name, kind in types.items():
        group.create_array(
            name,
            shape=(len(items),),
            chunks=(chunk,),
            dtype=kind,
            fill_value="" if name in texts else np.nan,
            attributes={"_ARRAY_DIMENSIONS": ["item"]},
        )
    first = 0
    for batch in _batches(iter(items), chunk):
        cells = [_cells(item) for item in batch]
        for name, kind in types.items():
            missing: Any = "" if name in texts else np.nan
            values = [row.get(name, missing) for row in cells]
            column = np.array([str(value) for value in values] if name in texts else values, kind)
            group[name][first : first + len(batch)] = column
        first += len(batch)


def _cells(item: Item) -> dict[str, Any]:
    own = flat(item._row)
    return {name: value for name, value in own.items() if value is not None and name != "status"}


def _batches(lines: Iterator[Any], n: int) -> Iterator[list[Any]]:
    while batch := list(itertools.islice(lines, n)):
        yield batch


def _module(name: str, package: str | None = None) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = package or name
        raise ImportError(f"dioptric.export needs {package}: pip install 'dioptric[export]'") from error


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m dioptric.export", description="Writes a store as Parquet or Zarr.")
    parser.add_argument("store", type=Path, help="the store of a sweep, with its index")
    parser.add_argument("--parquet", type=Path, metavar="F", help="Parquet file of keys and metrics")
    parser.add_argument("--files", metavar="LIST", default="", help="files whose bytes become columns of it, as picture.png")
    parser.add_argument("--zarr", type=Path, metavar="F", help="Zarr group of arrays, keys and metrics")
    parser.add_argument("--arrays", metavar="LIST", default="picture", help="arrays of it [default: picture]")
    given = parser.parse_args(arguments)
    if given.parquet is None and given.zarr is None:
        parser.error("expected --parquet, --zarr or both")
    try:
        if given.parquet is not None:
            n = to_parquet(given.store, given.parquet, [name for name in given.files.split(",") if name])
            print(f"{n} rows in {given.parquet}")
        if given.zarr is not None:
            n = to_zarr(given.store, given.zarr, [name for name in given.arrays.split(",") if name])
            print(f"{n} items in {given.zarr}")
    except (ImportError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
