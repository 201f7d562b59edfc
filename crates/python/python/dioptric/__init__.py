"""Camera simulation from a scene's spectral radiance to the picture: lenses, diffraction, sensors, processing.

>>> import dioptric as dp
>>> shot = dp.Camera.demo().with_(f_number=2.8).render(quality="preview")
>>> shot.rgb.shape
(320, 480, 3)

Radiance is W m⁻² sr⁻¹ nm⁻¹, irradiance W m⁻² nm⁻¹; lens lengths mm, pixels µm, scene depth m, wavelengths nm, angles degrees.
Row 0 of a picture is its top. Arrays that come back are read-only views of the results, without a copy.
"""

from . import measure
from ._native import (
    Camera,
    Developed,
    Lens,
    LightField,
    Rays,
    Scene,
    Sensor,
    Shot,
    Video,
    VideoFrame,
    __version__,
    develop,
    set_threads,
    threads,
)
from ._psf import Psf
from ._world import World

__all__ = [
    "Camera",
    "Developed",
    "Lens",
    "LightField",
    "Psf",
    "Rays",
    "Scene",
    "Sensor",
    "Shot",
    "Video",
    "VideoFrame",
    "World",
    "__version__",
    "develop",
    "measure",
    "set_threads",
    "threads",
]
