"""A laboratory's measurements of pictures, raw frames, sensors and arrays: what ``dioptric measure`` does.

A picture is a path, a `Shot` or `Developed` (its picture, or with ``of="raw"`` its raw frame), or an array: (rows, columns) or (rows,
columns, 3). Arrays are read as files of their type are: uint8 as sRGB codes, uint16 of three channels too, uint16 of one channel and
floats as linear light. ``curve="linear"`` or ``"srgb"`` says otherwise; of a shot, whose tone curve is known, it is not needed. Regions are
(x, y, columns, rows), pixels from the top left.

Results are dictionaries with the keys of ``dioptric measure --json``. What a file states and is not used is a warning.
"""

import os
from collections.abc import Iterable, Sequence
from typing import Any, Literal, TypeAlias

from numpy.typing import ArrayLike

from ._native import Developed, Sensor, Shot, _measure

_Path: TypeAlias = str | os.PathLike[str]
_Picture: TypeAlias = _Path | Shot | Developed | ArrayLike
_Region: TypeAlias = tuple[int, int, int, int]

__all__ = [
    "bench",
    "color",
    "compare",
    "emva",
    "grid",
    "mtf",
    "noise",
    "region",
    "sfr",
    "shading",
    "spot",
    "star",
    "steps",
    "texture",
]


def mtf(
    picture: _Picture | Sequence[str | os.PathLike[str]],
    *,
    region: _Region | None = None,
    size: int | None = None,
    every: bool = False,
    mosaic: str | None = None,
    pixel_um: float | None = None,
    pixels_per_degree: float | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures the spatial frequency response of a slanted edge (ISO 12233), of each channel; `sfr` is the same.

    Parameters
    ----------
    picture : path, Shot, Developed, array or list of paths
        Of a list of files and folders each picture is measured, and one that cannot be stops no other: "pictures" holds the measurements,
        "not_measured" the others with the reason.
    region : (x, y, columns, rows), optional
        Where the edge is; the most edge-like square without it.
    size : int, optional
        Side of the square that is looked for.
    every : bool
        Measures every slanted edge of the picture: the response over the field.
    mosaic : str, optional
        Of an array of digital numbers a letter a filter, as "RGGB".
    pixel_um : float, optional
        Distance between pixels, for cycles/mm.
    pixels_per_degree : float, optional
        Of the viewer's field, for acutance. Default 60.
    of, curve : str, optional
        As above.
    """
    options = _without(locals())
    if isinstance(picture, (list, tuple)) and picture and all(isinstance(p, (str, os.PathLike)) for p in picture):
        if every or of is not None:
            raise ValueError("every and of are for one picture, expected one in place of several")
        options.pop("every")
        return dict(_measure("mtf_of_pictures", list(picture), options))
    result: dict[str, Any] = _measure("mtf", picture, options)
    return result


def texture(
    picture: _Picture,
    reference: _Picture,
    *,
    region: _Region | None = None,
    flat: _Region | None = None,
    second_frame: _Picture | None = None,
    pixels_per_degree: float | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures the response of a texture (dead leaves, IEEE 1858) by its power and by a reference.

    Parameters
    ----------
    picture, reference : path, Shot, Developed or array
        The picture, and one of the same framing by an ideal camera.
    region : (x, y, columns, rows), optional
    flat : (x, y, columns, rows), optional
        An even patch, whose noise is subtracted.
    second_frame : path, Shot, Developed or array, optional
        Another frame of the same camera, whose difference is the noise.
    pixels_per_degree : float, optional
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("texture", picture, _without(locals()))
    return result


def spot(
    picture: _Picture,
    *,
    window: int | None = None,
    pixel_um: float | None = None,
    background: float | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures pictures of points: centroid, second moments, encircled energy.

    Parameters
    ----------
    picture : path, Shot, Developed or array
    window : int, optional
        Side of the window about each point, an odd number of pixels.
    pixel_um : float, optional
        At 1, the default, lengths are in pixels.
    background : float, optional
        Light between the points; the median of the picture without it.
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("spot", picture, _without(locals()))
    return result


def star(
    picture: _Picture,
    *,
    region: _Region | None = None,
    cycles: int | None = None,
    binary: bool = False,
    modulation: float | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures the response of a Siemens star.

    Parameters
    ----------
    picture : path, Shot, Developed or array
    region : (x, y, columns, rows), optional
    cycles : int, optional
        Of the star, 8 to 360; looked for without it.
    binary : bool
        The star is black and white, not sinusoidal.
    modulation : float, optional
        Of the star itself; without it the response is 1 at the coarsest ring.
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("star", picture, _without(locals()))
    return result


def grid(picture: _Picture, *, of: str | None = None, curve: Literal["by-file", "linear", "srgb"] | None = None) -> dict[str, Any]:
    """Measures distortion (ISO 17850) and lateral color (ISO 19084) of a grid of dots."""
    result: dict[str, Any] = _measure("grid", picture, _without(locals()))
    return result


def shading(picture: _Picture, *, of: str | None = None, curve: Literal["by-file", "linear", "srgb"] | None = None) -> dict[str, Any]:
    """Measures the shading of an even plane in luminance and color (ISO 17957)."""
    result: dict[str, Any] = _measure("shading", picture, _without(locals()))
    return result


def steps(
    picture: _Picture,
    steps: _Path | Iterable[tuple[_Region, float]],
    *,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures gray steps: conversion (ISO 14524), noise and dynamic range (ISO 15739).

    Parameters
    ----------
    picture : path, Shot, Developed or array
    steps : path, or list of (region, luminance)
        Each step's place and luminance, cd/m² or any unit that all share; or a table ``x,y,w,h,luminance``.
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("steps", picture, _without(locals()))
    return result


def region(
    picture: _Picture,
    region: _Region | None = None,
    *,
    reference: _Region | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures a region: mean, noise, percentiles, uniformity, profiles, color.

    Parameters
    ----------
    picture : path, Shot, Developed or array
        Of a shot with ``of="irradiance"`` also illuminance, color and the mean of each band.
    region : (x, y, columns, rows), optional
        All of it without it.
    reference : (x, y, columns, rows), optional
        A region whose color it is compared with; of spectral data the white.
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("region", picture, _without(locals()))
    return result


def color(
    picture: _Picture,
    *,
    corners: Sequence[tuple[float, float]] | None = None,
    illuminant: str | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Measures the colors of a 24-patch chart (ΔE00).

    Parameters
    ----------
    picture : path, Shot, Developed or array
    corners : four (column, row), optional
        Of the chart, clockwise from the one beside dark skin; found in the picture without it.
    illuminant : str, optional
        Light on the chart. Default "D65".
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("color", picture, _without(locals()))
    return result


def compare(
    picture: _Picture,
    against: _Picture,
    *,
    pixels_per_degree: float | None = None,
    display: str | None = None,
    distance_m: float | None = None,
    patch: _Region | None = None,
    of: str | None = None,
    curve: Literal["by-file", "linear", "srgb"] | None = None,
) -> dict[str, Any]:
    """Compares two pictures: S-CIELAB, VSNR, PSNR, SSIM.

    Parameters
    ----------
    picture, against : path, Shot, Developed or array
    pixels_per_degree : float, optional
        Of the viewer's field. Default 60.
    display : str, optional
        In place of it a display that shows both files: a RON file or srgb, display-p3, rec2020, apple-studio.
    distance_m : float, optional
        How far away the display is. Default 0.6.
    patch : (x, y, columns, rows), optional
        An even patch, whose visual SNR is measured.
    of, curve : str, optional
        As above.
    """
    result: dict[str, Any] = _measure("compare", picture, _without(locals()))
    return result


def noise(frames: _Path | Iterable[tuple[float | None, float | None, Iterable[ArrayLike]]]) -> dict[str, Any]:
    """Measures photon transfer after EMVA 1288, of flat and dark frames; `emva` is the same.

    Parameters
    ----------
    frames : path, or list of (exposure_s, photons, frames)
        A descriptor file or a folder as of ``dioptric measure noise``, or series under equal light: the exposure time, the photons that
        fell on a pixel (0 of dark frames, None where they were not counted), and two frames or more of digital numbers.
    """
    result: dict[str, Any] = _measure("noise", frames, {})
    return result


def bench(
    sensor: Sensor | str,
    *,
    filter: str | None = None,
    size: int | None = None,
    levels: int | None = None,
    stack: int | None = None,
    wavelength_nm: float | None = None,
    exposure_s: float | None = None,
    analog_gain: float | None = None,
    binning: str | None = None,
    temperature_c: float | None = None,
    seed: int | None = None,
) -> dict[str, Any]:
    """Puts a sensor on a simulated bench and measures it as `noise` does, beside its data sheet.

    Parameters
    ----------
    sensor : Sensor, name or path
    filter : str, optional
        The one that sees the light best without it.
    size, levels, stack : int, optional
        Side of the square of pixels (512), levels of light (40), frames of the stacks that show DSNU and PRNU (64).
    wavelength_nm, exposure_s, analog_gain, temperature_c : float, optional
        550 nm, 0.01 s, 1, 25 °C.
    binning : str, optional
        Pixels that are read as one: "charge:2", "voltage:2", "digital:2".
    seed : int, optional
    """
    result: dict[str, Any] = _measure("bench", sensor, _without(locals()))
    return result


sfr = mtf
emva = noise


def _without(arguments: dict[str, Any]) -> dict[str, Any]:
    """Leaves out what is not given, and the subject."""
    return {key: value for key, value in arguments.items() if value is not None and key not in ("picture", "sensor")}
