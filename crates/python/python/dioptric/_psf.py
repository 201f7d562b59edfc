"""Point spread functions with what is known of them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_KNOWN = ("energy", "x_mm", "y_mm", "pixel_um", "film_mm")


class Psf(np.ndarray[Any, np.dtype[np.float32]]):
    """Point spread functions, as `Lens.psf` returns them: an array, with what is known of each of its pictures beside.

    Attributes
    ----------
    energy : ndarray
        The light of each point over that of one on the axis, of the axes before the last two.
    x_mm, y_mm : ndarray
        The centroids in the picture, to the right of the axis and above it.
    pixel_um : float
        The side of a pixel.
    film_mm : float
        Where the film stands behind the last vertex.

    Parts of it and results of arithmetic are arrays alone.
    """

    energy: NDArray[np.float64]
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    pixel_um: float
    film_mm: float

    def __new__(
        cls,
        samples: NDArray[np.float32],
        energy: NDArray[np.float64],
        x_mm: NDArray[np.float64],
        y_mm: NDArray[np.float64],
        pixel_um: float,
        film_mm: float,
    ) -> "Psf":
        """Joins pictures with what is known of them."""
        own = samples.view(cls)
        for name, value in zip(_KNOWN, (energy, x_mm, y_mm, pixel_um, film_mm)):
            setattr(own, name, value)
        return own

    def __getattr__(self, name: str) -> Any:
        if name in _KNOWN:
            raise AttributeError(f"{name} is known of what Lens.psf returns, not of a part of it")
        raise AttributeError(f"'Psf' object has no attribute '{name}'")

    def __reduce__(self) -> tuple[Any, ...]:
        if "energy" not in self.__dict__:
            return np.array, (np.asarray(self),)
        return Psf, (np.asarray(self), *(getattr(self, name) for name in _KNOWN))
