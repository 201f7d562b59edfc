"""Pictures for PyTorch: from a store, or taken on the fly.

>>> from torch.utils.data import DataLoader
>>> from dioptric.torch import Dataset, Rendered
>>> batches = DataLoader(Dataset("plan.store", ["raw", "irradiance"]), batch_size=8, num_workers=4)

Both are map-style datasets without state: a sample depends on its number alone, whichever worker makes it, however workers are
started. PyTorch is imported when the first sample is asked for.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ._native import Camera, set_threads
from .sweep import Item, Items, Store, Sweep

__all__ = ["Dataset", "Rendered"]

_Sample = dict[str, Any]
_ARRAYS = ("picture", "rgb", "raw", "irradiance", "depth_m", "volts", "electrons", "electron_rate")


class Dataset:
    """The finished items of a store.

    Parameters
    ----------
    store : Store, str or os.PathLike
    arrays : list of str
        What a sample has, by name: the files ``"picture"``, ``"raw"``, ``"irradiance"``, ``"depth"``, ``"volts"``,
        ``"electrons"``; keys of the plan, as ``"stop.FNumber"``; and metrics, as ``"exposure_time_s"``.
    transform : callable, optional
        Takes the sample, a dictionary of tensors by name, and returns what the data set gives. Where workers are spawned it must be
        a function of a module.

    Notes
    -----
    Pictures are (3, rows, columns), as layers want them; other arrays as `read_samples` has them. Codes of 16 bits are int32, for few
    operations know uint16; numbers are float32.
    """

    def __init__(
        self,
        store: Store | str | os.PathLike[str],
        arrays: Sequence[str] = ("picture",),
        transform: Callable[[_Sample], Any] | None = None,
    ) -> None:
        self._store = store if isinstance(store, Store) else Store(store)
        self._items = self._store.done
        self._names = list(arrays)
        self._transform = transform
        if not self._items:
            raise ValueError(f"{self._store.folder}: none of its items is finished")
        first = self._items[0]
        for name in self._names:
            if not _is_number(first, name) and not first.path(name).exists():
                raise ValueError(f"arrays has '{name}', expected a file of the items, a key with numbers or a metric")

    @property
    def items(self) -> Items:
        """The items, one a sample."""
        return self._items

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, number: int) -> Any:
        item = self._items[number]
        sample = {name: self._value(item, name) for name in self._names}
        return _given(sample, self._transform)

    @staticmethod
    def _value(item: Item, name: str) -> Any:
        if _is_number(item, name):
            return float(item.values[name] if name in item.values else item.metrics[name])
        return item.array(name)


class Rendered:
    """Pictures that are taken when they are asked for.

    Parameters
    ----------
    cameras : Sweep or callable
        A sweep, whose items are taken without a store; or a function of a ``numpy.random.Generator`` that returns a `Camera`. Where
        workers are spawned, the function must be that of a module.
    n : int
        The number of samples; of a sweep all its items, if left out.
    arrays : list of str
        What a sample has: names of arrays of a `Shot`, ``"picture"`` (float32, 0-1), ``"rgb"``, ``"raw"``, ``"irradiance"``,
        ``"depth_m"``, ``"volts"``, ``"electrons"``, ``"electron_rate"``.
    seed : int
        Of the generators: sample i has one of its own from ``[seed, i]``, so that it is the same in any worker and any order. Another
        epoch is another seed.
    quality : str
        As of `Camera.render`.
    transform : callable, optional
        As of `Dataset`.

    Notes
    -----
    In a worker of a ``DataLoader`` each picture is taken by one thread. Draw cameras with a fixed ``seed`` of their own only where equal
    noise is wanted: ``camera.with_(seed=int(rng.integers(2**31)))`` varies it.
    """

    def __init__(
        self,
        cameras: Sweep | Callable[[np.random.Generator], Camera],
        n: int | None = None,
        arrays: Sequence[str] = ("picture",),
        *,
        seed: int = 0,
        quality: str = "full",
        transform: Callable[[_Sample], Any] | None = None,
    ) -> None:
        if n is None and not isinstance(cameras, Sweep):
            raise ValueError("n is missing, expected a number of samples: a function has none of its own")
        if n is not None and (n < 1 or (isinstance(cameras, Sweep) and n > len(cameras))):
            most = f"1 to {len(cameras)}, the items of the sweep" if isinstance(cameras, Sweep) else "1 or more"
            raise ValueError(f"n is {n}, expected {most}")
        for name in arrays:
            if name not in _ARRAYS:
                raise ValueError(f"arrays has '{name}', expected names of {', '.join(_ARRAYS)}")
        self._plan = cameras.plan if isinstance(cameras, Sweep) else None
        self._cameras: Sweep | Callable[[np.random.Generator], Camera] | None = cameras
        self._n = len(cameras) if n is None and isinstance(cameras, Sweep) else int(n or 0)
        self._names = list(arrays)
        self._seed = seed
        self._quality = quality
        self._transform = transform

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, number: int) -> Any:
        if not 0 <= number < self._n:
            raise IndexError(f"sample {number} is asked for, expected one of the {self._n} from 0")
        _one_thread_in_workers()
        shot = self._camera(number).render(quality=self._quality)  # type: ignore[arg-type]
        return _given({name: getattr(shot, name) for name in self._names}, self._transform)

    def camera(self, number: int) -> Camera:
        """Returns the camera of a sample."""
        return self._camera(number)

    def _camera(self, number: int) -> Camera:
        if self._cameras is None and self._plan is not None:
            self._cameras = Sweep(self._plan)
        if isinstance(self._cameras, Sweep):
            return self._cameras.camera(number)
        assert self._cameras is not None
        return self._cameras(np.random.default_rng([self._seed, number]))

    def __getstate__(self) -> dict[str, Any]:
        # A sweep is drawn up again from its plan in a spawned worker.
        return {**self.__dict__, "_cameras": None if self._plan is not None else self._cameras}


def _is_number(item: Item, name: str) -> bool:
    return isinstance(item.values.get(name), (int, float)) or name in item.metrics


def _given(sample: _Sample, transform: Callable[[_Sample], Any] | None) -> Any:
    torch = _torch()
    tensors = {name: _tensor(torch, name, value) for name, value in sample.items()}
    return tensors if transform is None else transform(tensors)


def _tensor(torch: Any, name: str, value: Any) -> Any:
    if isinstance(value, float):
        return torch.tensor(value, dtype=torch.float32)
    if isinstance(value, tuple):
        value = np.stack(value)
    if name in ("picture", "rgb") and value.ndim == 3:
        value = value.transpose(2, 0, 1)
    kind = np.int32 if value.dtype == np.uint16 else value.dtype
    # A copy of its own: results are read-only.
    return torch.from_numpy(np.array(value, dtype=kind, order="C"))


def _torch() -> Any:
    try:
        return importlib.import_module("torch")
    except ImportError as error:
        raise ImportError("dioptric.torch needs PyTorch: pip install 'dioptric[torch]'") from error


# The process that takes pictures with one thread.
_worker: int | None = None


def _one_thread_in_workers() -> None:
    """As many workers as cores share them; a process is asked once."""
    global _worker
    if _worker != os.getpid() and _torch().utils.data.get_worker_info() is not None:
        set_threads(1)
        _worker = os.getpid()
