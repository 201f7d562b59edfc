#!/usr/bin/env python3
"""Converts a MATLAB file of version 7.3, which is HDF5, to version 7, which dioptric reads: needs numpy, scipy and h5py.

    python3 scripts/mat73_to_mat7.py scene73.mat scene.mat [VARIABLE ...]

In MATLAB itself `save('scene.mat', 'scene', '-v7')` does the same. Structures, numbers, text and cells are kept; objects and
functions are left out. Numbers of more than 2 GiB do not fit into version 7.
"""

import sys

import h5py
import numpy as np
from scipy.io import savemat


def value_of(item: "h5py.Group | h5py.Dataset", file: h5py.File) -> object:
    """Returns a variable as scipy writes it, or None for what has no place in version 7."""
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if isinstance(item, h5py.Group):
        fields = {name: value_of(part, file) for name, part in item.items()}
        return {name: value for name, value in fields.items() if value is not None}
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.zeros((0, 0))
    if item.dtype == h5py.ref_dtype:
        cells = np.empty(item.shape[::-1], object)
        for index in np.ndindex(*item.shape):
            part = value_of(file[item[index]], file)
            cells[index[::-1]] = np.zeros((0, 0)) if part is None else part
        # An array of structures has its fields as references too; version 7 keeps them as cells.
        return cells
    numbers = np.asarray(item)
    if numbers.dtype.names == ("real", "imag"):
        numbers = numbers["real"] + 1j * numbers["imag"]
    if numbers.dtype.kind not in "fiuc":
        return None
    if kind == "char":
        return "".join(chr(code) for code in numbers.ravel())
    # HDF5 has the axes of MATLAB turned round.
    numbers = numbers.T
    return numbers.astype(bool) if kind == "logical" else numbers


def main() -> None:
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    source, target, *wanted = sys.argv[1:]
    with h5py.File(source, "r") as file:
        absent = [name for name in wanted if name not in file]
        if absent:
            sys.exit(f"{source}: holds no variable '{absent[0]}', but {', '.join(sorted(file))}")
        names = wanted or [name for name in file if not name.startswith("#")]
        variables = {name: value_of(file[name], file) for name in names}
    variables = {name: value for name, value in variables.items() if value is not None}
    savemat(target, variables, do_compression=True, long_field_names=True)


if __name__ == "__main__":
    main()
