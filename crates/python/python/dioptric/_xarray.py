"""Results with names, coordinates and units, for xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._native import Shot


def dataset(shot: Shot) -> Any:
    """Returns the stages of a shot as a Dataset; the arrays in it are the shot's, not copies.

    ``x`` and ``y`` are mm on the film as the picture shows it, from its middle to the right and upwards.
    """
    try:
        import xarray as xr
    except ImportError as error:
        raise ImportError("to_xarray needs xarray: pip install 'dioptric[xarray]'") from error

    rows, columns = shot.shape
    pitch_mm = 1e-3 * shot.pitch_um
    coordinates = {
        "wavelength": ("wavelength", shot.wavelengths_nm, {"units": "nm", "long_name": "center of the band"}),
        "y": ("y", pitch_mm * ((rows - 1) / 2 - np.arange(rows)), {"units": "mm", "long_name": "up in the picture"}),
        "x": ("x", pitch_mm * (np.arange(columns) - (columns - 1) / 2), {"units": "mm", "long_name": "to the right"}),
        "channel": ("channel", ["red", "green", "blue"]),
    }
    variables: dict[str, Any] = {
        "irradiance": (
            ("wavelength", "y", "x"),
            shot.irradiance,
            {"units": "W m-2 nm-1", "long_name": "spectral irradiance on the film"},
        ),
        "picture": (("y", "x", "channel"), shot.picture, {"units": "1", "long_name": "codes of the picture"}),
    }
    for name, unit, what in [
        ("electron_rate", "s-1", "mean rate of photo-electrons"),
        ("electrons", "1", "electrons at the end of the exposure"),
        ("volts", "V", "voltage at the pixel's output"),
        ("raw", "1", "digital numbers"),
    ]:
        frame = getattr(shot, name)
        attributes = {"units": unit, "long_name": what}
        if isinstance(frame, tuple):
            for number, plane in enumerate(frame):
                variables[f"{name}_{number}"] = (("y", "x"), plane, attributes)
        else:
            variables[name] = (("y", "x"), frame, attributes)
    depth = shot.depth_m
    variables["depth"] = (
        ("scene_y", "scene_x"),
        depth,
        {"units": "m", "long_name": "depth of the scene's samples along the axis"},
    )
    of_shot: dict[str, Any] = {"name": shot.camera.name, "exposure_s": shot.exposure_s, "pitch_um": shot.pitch_um}
    return xr.Dataset(variables, coordinates, of_shot)
