"""The native part of the package; docstrings are those of the classes."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._psf import Psf
from ._world import World

_Path: TypeAlias = str | os.PathLike[str]
_Numbers: TypeAlias = float | Sequence[float] | NDArray[Any]
_Diffraction: TypeAlias = Literal["none", "hurb", "hurb-scene3d", "hurb-calibrated", "wave"]
_Planes: TypeAlias = tuple[NDArray[Any], ...]
_Point: TypeAlias = tuple[float, float, float]
_Medium: TypeAlias = str | float | tuple[float, float] | dict[str, Any] | None
_Progress: TypeAlias = bool | Callable[[str, float], object] | None

__all__ = [
    "Camera",
    "Developed",
    "Lens",
    "LightField",
    "Rays",
    "Scene",
    "Sensor",
    "Shot",
    "Maker",
    "Plan",
    "Sweep",
    "Video",
    "VideoFrame",
    "Memory",
    "_World",
    "_restore_world",
    "_measure",
    "_panic",
    "_restore_camera",
    "_restore_lens",
    "_restore_scene",
    "_restore_scene_spec",
    "_restore_sensor",
    "_restore_shot",
    "develop",
    "read_index",
    "read_samples",
    "set_threads",
    "threads",
    "__version__",
]

__version__: str

def set_threads(n: int) -> None: ...
def threads() -> int: ...
def _panic() -> None: ...
def _measure(kind: str, subject: Any, options: dict[str, Any]) -> Any: ...
def _restore_lens(text: str, stop_mm: float, glass_range: Any, other_coating: Any, notes: list[str], choice: Any) -> Lens: ...
def _restore_sensor(text: str, spec: Any) -> Sensor: ...
def _restore_scene_spec(spec: Any) -> Scene: ...
def _restore_scene(
    name: str,
    wavelengths_nm: Sequence[float],
    planes: Sequence[NDArray[np.float32]],
    depth_m: NDArray[np.float32],
    view: tuple[float, float, float],
    light: Any,
    notes: list[str],
) -> Scene: ...
def _restore_camera(text: str, lens: Lens | None, scene: Scene | None, sensor: Sensor | None) -> Camera: ...
def _restore_shot(
    camera: Camera, quality: str, imaged: Any, wavelengths_nm: Sequence[float], cubes: Sequence[Sequence[NDArray[np.float32]]]
) -> Shot: ...
def read_index(path: _Path) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]: ...
def read_samples(path: _Path) -> tuple[NDArray[Any], list[Any]]: ...
@final
class Memory:
    @property
    def __array_interface__(self) -> dict[str, Any]: ...
    @property
    def address(self) -> int: ...

@final
class Camera:
    @staticmethod
    def demo() -> Camera: ...
    @staticmethod
    def read(path: _Path) -> Camera: ...
    @staticmethod
    def from_ron(text: str, folder: _Path | None = None) -> Camera: ...
    @staticmethod
    def from_dict(data: dict[str, Any]) -> Camera: ...
    @staticmethod
    def resume(folder: _Path) -> Camera: ...
    def with_(
        self,
        *,
        name: str | None = ...,
        lens: Lens | _Path | None = ...,
        f_number: float | None = ...,
        stop_mm: float | None = ...,
        coating: _Path | None = ...,
        blades: int | None = ...,
        blade_rotation_deg: float | None = ...,
        blade_curvature: float | None = ...,
        focus_mm: float | Literal["near"] | None = ...,
        film_mm: float | None = ...,
        tilt_deg: float | None = ...,
        swing_deg: float | None = ...,
        rise_mm: float | None = ...,
        shift_mm: float | None = ...,
        sensor: Sensor | _Path | None = ...,
        film: Literal["sensor", "scene", "field"] | None = ...,
        crop: tuple[int, int, int, int] | None = ...,
        pixels: tuple[int, int] | None = ...,
        pixel_um: float | None = ...,
        dual_pixel: str | None = ...,
        filters: Sequence[str] | None = ...,
        diffraction: _Diffraction | None = ...,
        gamma: float | None = ...,
        psfs: _Path | None = ...,
        blur: str | None = ...,
        border: str | None = ...,
        lens_reflections: Literal["off", "ghosts"] | str | None = ...,
        bank: Any = ...,
        bank_error: Any = ...,
        scene: Scene | _Path | None = ...,
        fov_deg: float | None = ...,
        depth_m: float | None = ...,
        width_mm: float | None = ...,
        distance_mm: float | None = ...,
        fill_depth: Literal["beside", "far"] | float | None = ...,
        hidden: _Path | None = ...,
        points: _Path | None = ...,
        white_level: float | None = ...,
        quantity: Literal["radiance", "reflectance", "photons"] | None = ...,
        unit: str | None = ...,
        scale: float | None = ...,
        scene_wavelengths_nm: _Numbers | None = ...,
        variable: str | None = ...,
        axes: str | None = ...,
        no_data: Literal["black", "fill", "refuse"] | None = ...,
        depth: _Path | None = ...,
        depth_unit: str | None = ...,
        depth_kind: str | None = ...,
        depth_variable: str | None = ...,
        view: _Path | None = ...,
        panorama: str | None = ...,
        illuminant: str | None = ...,
        illuminance_lux: float | None = ...,
        scene_light: str | None = ...,
        mean_luminance_cd_m2: float | None = ...,
        mean_lux: float | None = ...,
        wavelengths_nm: _Numbers | Literal["scene"] | None = ...,
        exposure_s: float | Literal["auto"] | None = ...,
        analog_gain: float | None = ...,
        gain_mode: Literal["low", "high"] | None = ...,
        binning: str | None = ...,
        temperature_c: float | None = ...,
        metering: str | None = ...,
        chip_seed: int | None = ...,
        noise: str | None = ...,
        burst: int | None = ...,
        bracket_stops: Sequence[float] | None = ...,
        both_gains: bool | None = ...,
        interleaved_ratio: float | None = ...,
        interleaved_gain_ratio: float | None = ...,
        white: str | None = ...,
        demosaic: str | None = ...,
        denoise: float | None = ...,
        highlights: str | None = ...,
        lens_corrections: str | None = ...,
        color: str | None = ...,
        sharpen_px: float | None = ...,
        local_tone: str | None = ...,
        perspective: str | None = ...,
        brightness: str | None = ...,
        curve: str | None = ...,
        space: str | None = ...,
        defect_threshold: float | None = ...,
        seed: int | None = ...,
    ) -> Camera: ...
    def render(
        self,
        *,
        quality: Literal["full", "draft", "preview", "sketch"] = "full",
        progress: _Progress = None,
        memory_bytes: int | None = None,
        memory: str | int | None = None,
    ) -> Shot: ...
    def video(
        self,
        *,
        frames: int | None = None,
        frames_per_s: float | None = None,
        row_time_us: float | None = None,
        pan_deg_per_s: float | None = None,
        tilt_deg_per_s: float | None = None,
        roll_deg_per_s: float | None = None,
        shake_deg: float | None = None,
        shake_hz: float | None = None,
        progress: _Progress = None,
    ) -> Video: ...
    def light_field(
        self,
        *,
        views: int | None = None,
        frame: _Path | None = None,
        white: _Path | None = None,
        progress: _Progress = None,
    ) -> LightField: ...
    def compare_methods(self, *, samples: int | None = None, progress: _Progress = None) -> dict[str, Any]: ...
    @property
    def name(self) -> str: ...
    @property
    def lens(self) -> Lens: ...
    @property
    def scene(self) -> Scene: ...
    @property
    def sensor(self) -> Sensor: ...
    def stage_counts(self) -> dict[str, int]: ...
    def to_dict(self) -> dict[str, Any]: ...
    def to_ron(self) -> str: ...
    def write(self, path: _Path) -> None: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __copy__(self) -> Camera: ...
    def __deepcopy__(self, memo: Any) -> Camera: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Shot:
    @property
    def camera(self) -> Camera: ...
    @property
    def quality(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def pitch_um(self) -> float: ...
    @property
    def film_mm(self) -> float: ...
    @property
    def exposure_s(self) -> float: ...
    @property
    def wavelengths_nm(self) -> NDArray[np.float64]: ...
    @property
    def irradiance(self) -> NDArray[np.float32]: ...
    @property
    def electron_rate(self) -> NDArray[np.float32] | _Planes: ...
    @property
    def electrons(self) -> NDArray[np.float32] | _Planes: ...
    @property
    def volts(self) -> NDArray[np.float32] | _Planes: ...
    @property
    def raw(self) -> NDArray[np.uint16] | NDArray[np.float32] | _Planes: ...
    @property
    def levels(self) -> dict[str, float]: ...
    @property
    def picture(self) -> NDArray[np.float32]: ...
    @property
    def rgb(self) -> NDArray[np.uint8]: ...
    @property
    def depth_m(self) -> NDArray[np.float32]: ...
    def objects(self) -> tuple[NDArray[np.uint32], list[str]]: ...
    def report(self) -> dict[str, Any]: ...
    def expose(
        self,
        *,
        seed: int | None = ...,
        exposure_s: float | Literal["auto"] | None = ...,
        analog_gain: float | None = ...,
        gain_mode: Literal["low", "high"] | None = ...,
        binning: str | None = ...,
        temperature_c: float | None = ...,
        metering: str | None = ...,
        chip_seed: int | None = ...,
        noise: str | None = ...,
        burst: int | None = ...,
        bracket_stops: Sequence[float] | None = ...,
        both_gains: bool | None = ...,
        interleaved_ratio: float | None = ...,
        interleaved_gain_ratio: float | None = ...,
        white: str | None = ...,
        demosaic: str | None = ...,
        denoise: float | None = ...,
        highlights: str | None = ...,
        lens_corrections: str | None = ...,
        color: str | None = ...,
        sharpen_px: float | None = ...,
        local_tone: str | None = ...,
        perspective: str | None = ...,
        brightness: str | None = ...,
        curve: str | None = ...,
        space: str | None = ...,
        defect_threshold: float | None = ...,
    ) -> Shot: ...
    def develop(
        self,
        *,
        white: str | None = ...,
        demosaic: str | None = ...,
        denoise: float | None = ...,
        highlights: str | None = ...,
        lens_corrections: str | None = ...,
        color: str | None = ...,
        sharpen_px: float | None = ...,
        local_tone: str | None = ...,
        perspective: str | None = ...,
        brightness: str | None = ...,
        curve: str | None = ...,
        space: str | None = ...,
        defect_threshold: float | None = ...,
    ) -> Shot: ...
    def png(self) -> bytes: ...
    def save(self, path: _Path) -> list[str]: ...
    def to_xarray(self) -> Any: ...
    def __copy__(self) -> Shot: ...
    def __deepcopy__(self, memo: Any) -> Shot: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...
    def _repr_png_(self) -> bytes: ...
    def _repr_html_(self) -> str: ...

@final
class Developed:
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def raw(self) -> NDArray[np.uint16] | _Planes: ...
    @property
    def picture(self) -> NDArray[np.float32]: ...
    @property
    def rgb(self) -> NDArray[np.uint8]: ...
    @property
    def notes(self) -> list[str]: ...
    def report(self) -> dict[str, Any]: ...
    def png(self) -> bytes: ...
    def save(self, path: _Path) -> list[str]: ...
    def _repr_png_(self) -> bytes: ...

def develop(
    source: _Path | ArrayLike,
    *,
    cfa: str | None = None,
    black: float | Literal["stated", "masked"] | None = None,
    saturation: float | None = None,
    color_matrix: ArrayLike | None = None,
    sensor: Sensor | _Path | None = None,
    exposure_s: float | None = None,
    analog_gain: float | None = None,
    illuminant: str | None = None,
    rendering: str | None = None,
    profile: _Path | None = None,
    white: str | None = ...,
    demosaic: str | None = ...,
    denoise: float | None = ...,
    highlights: str | None = ...,
    lens_corrections: str | None = ...,
    color: str | None = ...,
    sharpen_px: float | None = ...,
    local_tone: str | None = ...,
    perspective: str | None = ...,
    brightness: str | None = ...,
    curve: str | None = ...,
    space: str | None = ...,
    defect_threshold: float | None = ...,
) -> Developed: ...

@final
class Lens:
    @staticmethod
    def names() -> list[str]: ...
    @staticmethod
    def library() -> list[dict[str, Any]]: ...
    @staticmethod
    def built_in(name: str) -> Lens: ...
    @staticmethod
    def read(
        path: _Path,
        *,
        glasses: Sequence[_Path] | None = None,
        missing_glass: Literal["refuse", "nd-vd", "nearest"] = "refuse",
        glass_range: Literal["refuse", "extend"] = "refuse",
        slope_per_nm: float | None = None,
        configuration: int | None = None,
        lens_scale: float | None = None,
    ) -> Lens: ...
    @staticmethod
    def parse(text: str, name: str = "lens.ron") -> Lens: ...
    @staticmethod
    def thin(focal_length_mm: float, diameter_mm: float) -> Lens: ...
    @staticmethod
    def pinhole(diameter_mm: float) -> Lens: ...
    @staticmethod
    def measured_eye(path: _Path, pupil_mm: float, *, number: int | None = None, seed: int = 0) -> Lens: ...
    def with_stop(self, *, f_number: float | None = None, diameter_mm: float | None = None) -> Lens: ...
    def with_coating(self, coating: str | None = None) -> Lens: ...
    def with_iris(self, blades: int | None, *, rotation_deg: float = 0.0, curvature: float = 0.0) -> Lens: ...
    def with_glass_range(self, glass_range: Literal["refuse", "extend"]) -> Lens: ...
    def notes_at(self, wavelengths_nm: Sequence[float]) -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def configurations(self) -> list[str]: ...
    @property
    def configuration(self) -> int: ...
    @property
    def source(self) -> str: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def n_surfaces(self) -> int: ...
    @property
    def is_rotational(self) -> bool: ...
    @property
    def efl_mm(self) -> float: ...
    @property
    def f_number(self) -> float: ...
    @property
    def t_number(self) -> float | None: ...
    def info(
        self,
        wavelengths_nm: _Numbers | None = None,
        *,
        distance_mm: float | None = None,
        field_deg: float = 10.0,
        blur_um: float | None = None,
    ) -> Any: ...
    def surfaces(self) -> list[dict[str, Any]]: ...
    def with_surface(
        self,
        surface: int,
        *,
        radius_mm: float | None = ...,
        thickness_mm: float | None = ...,
        semi_aperture_mm: float | None = ...,
        medium: _Medium = ...,
        stop: bool | None = ...,
        conic: float | None = ...,
        coefficients: Sequence[float] | None = ...,
        shape: Any = ...,
        mirror: bool | None = ...,
        coating: Any = ...,
        comment: str | None = ...,
    ) -> Lens: ...
    @staticmethod
    def from_surfaces(
        surfaces: Sequence[dict[str, Any]] | dict[str, Any],
        *,
        name: str = "lens",
        stop: int | None = None,
        film_mm: float | None = None,
    ) -> Lens: ...
    def to_dict(self) -> dict[str, Any]: ...
    @staticmethod
    def from_dict(data: dict[str, Any]) -> Lens: ...
    def trace(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        wavelength_nm: float | ArrayLike = ...,
        *,
        film_mm: float | None = None,
        clip: bool = True,
    ) -> Rays: ...
    def psf(
        self,
        *,
        field_deg: _Numbers | None = ...,
        field_y_deg: _Numbers | None = ...,
        film_xy_mm: ArrayLike | None = ...,
        distance_mm: _Numbers | None = ...,
        wavelengths_nm: _Numbers | None = ...,
        focus_mm: float | None = ...,
        film_mm: float | None = ...,
        pixel_um: float | None = ...,
        shape: int | None = ...,
        diffraction: _Diffraction | None = ...,
        gamma: float | None = ...,
        psfs: _Path | None = ...,
        rays: int | None = ...,
        exact_grid: bool | None = ...,
        seed: int | None = ...,
    ) -> Psf: ...
    def psf_table(
        self,
        *,
        field_deg: _Numbers | None = ...,
        field_y_deg: _Numbers | None = ...,
        film_xy_mm: ArrayLike | None = ...,
        distance_mm: _Numbers | None = ...,
        wavelengths_nm: _Numbers | None = ...,
        focus_mm: float | None = ...,
        film_mm: float | None = ...,
        pixel_um: float | None = ...,
        shape: int | None = ...,
        diffraction: _Diffraction | None = ...,
        gamma: float | None = ...,
        psfs: _Path | None = ...,
        rays: int | None = ...,
        exact_grid: bool | None = ...,
        seed: int | None = ...,
        mtf_per_mm: _Numbers | None = ...,
    ) -> list[dict[str, Any]]: ...
    def analyze(
        self,
        *,
        fields_deg: _Numbers | None = ...,
        wavelengths_nm: _Numbers | None = ...,
        distance_mm: float | None = ...,
        film_mm: float | None = ...,
        focus_mm: float | None = ...,
        rings: int | None = ...,
    ) -> dict[str, Any]: ...
    def draw(
        self,
        *,
        fields_deg: _Numbers | None = None,
        distance_mm: float = ...,
        wavelengths_nm: _Numbers | None = None,
        film_mm: float | None = None,
    ) -> str: ...
    def film_mm_for(self, distance_mm: float, wavelength_nm: float | None = None) -> float: ...
    def to_ron(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def _repr_html_(self) -> str: ...
    def __copy__(self) -> Lens: ...
    def __deepcopy__(self, memo: Any) -> Lens: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

def _restore_world(spec: Any) -> _World: ...

@final
class _World:
    def __new__(
        cls,
        path: _Path | None = None,
        unit_m: float = 1.0,
        time_s: float | None = None,
        animation: str | None = None,
        variant: str | None = None,
    ) -> _World: ...
    def change(self, change: Any) -> None: ...
    def objects(self) -> list[dict[str, Any]]: ...
    def find(self, name: str) -> list[str]: ...
    def bounds_m(self, name: str | None) -> list[_Point] | None: ...
    def materials(self) -> list[str]: ...
    def cameras(self) -> list[str]: ...
    def notes(self) -> list[str]: ...
    def write(self, path: _Path, strict: bool) -> list[str]: ...
    @staticmethod
    def light(word: str) -> Any: ...
    @staticmethod
    def sky(word: str) -> Any: ...
    def copy(self) -> _World: ...
    def words(self) -> dict[str, Any]: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Rays:
    FATES: ClassVar[list[str]]
    def __len__(self) -> int: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def x_mm(self) -> NDArray[np.float64]: ...
    @property
    def y_mm(self) -> NDArray[np.float64]: ...
    @property
    def z_mm(self) -> NDArray[np.float64]: ...
    @property
    def l(self) -> NDArray[np.float64]: ...
    @property
    def m(self) -> NDArray[np.float64]: ...
    @property
    def n(self) -> NDArray[np.float64]: ...
    @property
    def opl_mm(self) -> NDArray[np.float64]: ...
    @property
    def positions_mm(self) -> NDArray[np.float64]: ...
    @property
    def directions(self) -> NDArray[np.float64]: ...
    @property
    def passed(self) -> NDArray[np.bool_]: ...
    @property
    def fate(self) -> NDArray[np.uint8]: ...
    @property
    def surface(self) -> NDArray[np.int16]: ...

@final
class Scene:
    @staticmethod
    def from_array(
        radiance: ArrayLike,
        wavelengths_nm: _Numbers,
        *,
        depth_m: ArrayLike,
        fov_deg: float | None = None,
        intrinsics: tuple[float, float, float] | None = None,
        quantity: Literal["radiance", "reflectance", "photons"] = "radiance",
        light: str | None = None,
        illuminance_lux: float | None = None,
        fill_depth: Literal["beside", "far"] | float | None = None,
        name: str = "scene",
    ) -> Scene: ...
    @staticmethod
    def world(
        path: _Path | World,
        *,
        eye: _Point | None = None,
        look_at: _Point | None = None,
        up: _Point | None = None,
        camera: str | None = None,
        unit_m: float = 1.0,
        time_s: float | None = None,
        animation: str | None = None,
        variant: str | None = None,
        sky: str | None = None,
        lamps: Sequence[tuple[float, float, float, float]] | None = None,
        method: Literal["backward", "forward"] = "backward",
        samples: int | None = None,
        noise: float | None = None,
        bounces: int | None = None,
        size: tuple[int, int] | None = None,
        seed: int | None = None,
        fov_deg: float | None = ...,
        depth_m: float | None = ...,
        width_mm: float | None = ...,
        distance_mm: float | None = ...,
        fill_depth: Literal["beside", "far"] | float | None = ...,
        hidden: _Path | None = ...,
        points: _Path | None = ...,
        white_level: float | None = ...,
        quantity: Literal["radiance", "reflectance", "photons"] | None = ...,
        unit: str | None = ...,
        scale: float | None = ...,
        scene_wavelengths_nm: _Numbers | None = ...,
        variable: str | None = ...,
        axes: str | None = ...,
        no_data: Literal["black", "fill", "refuse"] | None = ...,
        depth: _Path | None = ...,
        depth_unit: str | None = ...,
        depth_kind: str | None = ...,
        depth_variable: str | None = ...,
        view: _Path | None = ...,
        panorama: str | None = ...,
        illuminant: str | None = ...,
        illuminance_lux: float | None = ...,
        light: str | None = ...,
        mean_luminance_cd_m2: float | None = ...,
    ) -> Scene: ...
    @staticmethod
    def read(
        path: _Path,
        *,
        fov_deg: float | None = ...,
        depth_m: float | None = ...,
        width_mm: float | None = ...,
        distance_mm: float | None = ...,
        fill_depth: Literal["beside", "far"] | float | None = ...,
        hidden: _Path | None = ...,
        points: _Path | None = ...,
        white_level: float | None = ...,
        quantity: Literal["radiance", "reflectance", "photons"] | None = ...,
        unit: str | None = ...,
        scale: float | None = ...,
        scene_wavelengths_nm: _Numbers | None = ...,
        variable: str | None = ...,
        axes: str | None = ...,
        no_data: Literal["black", "fill", "refuse"] | None = ...,
        depth: _Path | None = ...,
        depth_unit: str | None = ...,
        depth_kind: str | None = ...,
        depth_variable: str | None = ...,
        view: _Path | None = ...,
        panorama: str | None = ...,
        illuminant: str | None = ...,
        illuminance_lux: float | None = ...,
        light: str | None = ...,
        mean_luminance_cd_m2: float | None = ...,
    ) -> Scene: ...
    @staticmethod
    def still_life(
        columns: int = 1080,
        rows: int = 720,
        *,
        fov_deg: float | None = ...,
        depth_m: float | None = ...,
        width_mm: float | None = ...,
        distance_mm: float | None = ...,
        fill_depth: Literal["beside", "far"] | float | None = ...,
        hidden: _Path | None = ...,
        points: _Path | None = ...,
        white_level: float | None = ...,
        quantity: Literal["radiance", "reflectance", "photons"] | None = ...,
        unit: str | None = ...,
        scale: float | None = ...,
        scene_wavelengths_nm: _Numbers | None = ...,
        variable: str | None = ...,
        axes: str | None = ...,
        no_data: Literal["black", "fill", "refuse"] | None = ...,
        depth: _Path | None = ...,
        depth_unit: str | None = ...,
        depth_kind: str | None = ...,
        depth_variable: str | None = ...,
        view: _Path | None = ...,
        panorama: str | None = ...,
        illuminant: str | None = ...,
        illuminance_lux: float | None = ...,
        light: str | None = ...,
        mean_luminance_cd_m2: float | None = ...,
    ) -> Scene: ...
    @staticmethod
    def target(
        pattern: Literal[
            "uniform",
            "checkerboard",
            "slanted-bar",
            "radial-lines",
            "point-array",
            "siemens-star",
            "color-chart",
            "dead-leaves",
        ],
        columns: int,
        rows: int,
        *,
        size: float | None = None,
        fov_deg: float | None = ...,
        depth_m: float | None = ...,
        width_mm: float | None = ...,
        distance_mm: float | None = ...,
        fill_depth: Literal["beside", "far"] | float | None = ...,
        hidden: _Path | None = ...,
        points: _Path | None = ...,
        white_level: float | None = ...,
        quantity: Literal["radiance", "reflectance", "photons"] | None = ...,
        unit: str | None = ...,
        scale: float | None = ...,
        scene_wavelengths_nm: _Numbers | None = ...,
        variable: str | None = ...,
        axes: str | None = ...,
        no_data: Literal["black", "fill", "refuse"] | None = ...,
        depth: _Path | None = ...,
        depth_unit: str | None = ...,
        depth_kind: str | None = ...,
        depth_variable: str | None = ...,
        view: _Path | None = ...,
        panorama: str | None = ...,
        illuminant: str | None = ...,
        illuminance_lux: float | None = ...,
        light: str | None = ...,
        mean_luminance_cd_m2: float | None = ...,
    ) -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def wavelengths_nm(self) -> NDArray[np.float64]: ...
    @property
    def depth_m(self) -> NDArray[np.float32]: ...
    @property
    def mean_luminance_cd_m2(self) -> float: ...
    def band(self, band: int) -> NDArray[np.float32]: ...
    def to_array(self) -> NDArray[np.float32]: ...
    def write(self, path: _Path) -> None: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __copy__(self) -> Scene: ...
    def __deepcopy__(self, memo: Any) -> Scene: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Sensor:
    @staticmethod
    def names() -> list[str]: ...
    @staticmethod
    def built_in(name: str) -> Sensor: ...
    @staticmethod
    def read(path: _Path) -> Sensor: ...
    @staticmethod
    def from_ron(text: str) -> Sensor: ...
    @staticmethod
    def from_dict(data: dict[str, Any]) -> Sensor: ...
    def with_(self, **changes: Any) -> Sensor: ...
    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def pixel_pitch_um(self) -> float: ...
    @property
    def filters(self) -> list[str]: ...
    def quantum_efficiency(self, wavelengths_nm: _Numbers) -> NDArray[np.float64]: ...
    def to_dict(self) -> dict[str, Any]: ...
    def to_ron(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __copy__(self) -> Sensor: ...
    def __deepcopy__(self, memo: Any) -> Sensor: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class LightField:
    @property
    def shape(self) -> tuple[int, int, int, int, int]: ...
    @property
    def views(self) -> NDArray[np.float32]: ...
    @property
    def whole(self) -> NDArray[np.bool_]: ...
    @property
    def true_depth_m(self) -> NDArray[np.float32]: ...
    def disparity_px(self, depth_m: float) -> float: ...
    def refocus(self, depth_m: float) -> NDArray[np.float32]: ...
    def depth(self, near_m: float, far_m: float, *, radius_px: int | None = None) -> dict[str, NDArray[np.float32]]: ...

@final
class Video:
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def frames_per_s(self) -> float: ...
    @property
    def exposure_s(self) -> float: ...
    @property
    def row_time_us(self) -> float: ...
    @property
    def notes(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, frame: int, /) -> VideoFrame: ...

@final
class VideoFrame:
    @property
    def facts(self) -> dict[str, Any]: ...
    @property
    def raw(self) -> NDArray[np.uint16] | _Planes: ...
    @property
    def picture(self) -> NDArray[np.float32]: ...
    @property
    def rgb(self) -> NDArray[np.uint8]: ...

@final
class Plan:
    @staticmethod
    def read(path: _Path) -> Plan: ...
    @staticmethod
    def from_ron(text: str, path: _Path | None = None) -> Plan: ...
    @property
    def path(self) -> Path: ...
    @property
    def store(self) -> Path: ...
    @property
    def keys(self) -> list[str]: ...
    def to_ron(self) -> str: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[str, Path]]: ...

@final
class Sweep:
    def __new__(cls, plan: Plan) -> Sweep: ...
    @property
    def plan(self) -> Plan: ...
    @property
    def n_irradiances(self) -> int: ...
    def __len__(self) -> int: ...
    def id(self, item: int) -> str: ...
    def values(self, item: int) -> dict[str, Any]: ...
    def camera(self, item: int) -> Camera: ...
    def groups(self, store: _Path | None = None, *, shard: str | None = None) -> list[list[int]]: ...
    def run(
        self,
        store: _Path | None = None,
        *,
        shard: str | None = None,
        limit: int | None = None,
        progress: _Progress = None,
    ) -> dict[str, Any]: ...
    def write_index(self, store: _Path | None = None) -> None: ...
    def counts(self, store: _Path | None = None, *, shard: str | None = None) -> dict[str, int]: ...
    def pack(
        self, target: _Path, *, store: _Path | None = None, items_per_tar: int | None = None
    ) -> list[Path]: ...

@final
class Maker:
    def __new__(cls, plan: Plan, store: _Path) -> Maker: ...
    def make(self, items: Sequence[tuple[int, str]]) -> list[tuple[str, str | None]]: ...
