"""Worlds made and changed from a program."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ._native import Scene, _World

_Path: TypeAlias = str | os.PathLike[str]
_Point: TypeAlias = Sequence[float]
_Color: TypeAlias = float | str | os.PathLike[str] | Sequence[float] | tuple[Sequence[float], Sequence[float]]
_Material: TypeAlias = Literal["matte", "plastic", "glossy", "metal", "mirror", "glass"] | str

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_LEVELS = {
    "watts": "Watts",
    "lumens": "Lumens",
    "candela": "Candela",
    "lux": "Lux",
    "cd_m2": "CandelaPerM2",
    "per_nm": "PerNm",
}


def _point(key: str, value: _Point) -> list[float]:
    point = [float(number) for number in value]
    if len(point) != 3:
        raise ValueError(f"{key}: {len(point)} numbers, expected x, y and z")
    return point


def _rows(key: str, values: ArrayLike, width: int, kind: Any) -> list[list[Any]]:
    rows = np.asarray(values)
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"{key}: an array of {rows.shape}, expected rows of {width}")
    return rows.astype(kind).tolist()  # type: ignore[no-any-return]


def _color(value: _Color) -> dict[str, Any]:
    if isinstance(value, str) and value.startswith("#"):
        if len(value) != 7:
            raise ValueError(f"color: '{value}', expected '#rrggbb'")
        codes = [int(value[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        return {"Rgb": [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in codes]}
    if isinstance(value, (str, os.PathLike)):
        return {"Picture": os.fspath(value)}
    if isinstance(value, (int, float)):
        return {"Even": float(value)}
    if len(value) == 2:
        wavelengths_nm, values = (np.asarray(part, float).tolist() for part in value)
        return {"Spectrum": {"wavelengths_nm": wavelengths_nm, "values": values}}
    return {"Rgb": _point("color", value)}


def _material(
    kind: _Material, color: _Color | None, roughness: float | None, metallic: float | None, made_of: str | None
) -> dict[str, Any]:
    words: dict[str, Any] = {}
    if color is not None:
        words["color"] = _color(color)
    if roughness is not None:
        words["roughness"] = float(roughness)
    if metallic is not None:
        words["metallic"] = float(metallic)
    known: dict[str, tuple[str, dict[str, Any], set[str]]] = {
        "matte": ("Matte", {"color": {"Even": 0.5}}, {"color"}),
        "plastic": ("Plastic", {"color": {"Even": 0.5}}, {"color", "roughness"}),
        "glossy": ("Glossy", {"color": {"Even": 0.5}}, {"color", "roughness", "metallic"}),
        "metal": ("Metal", {"metal": made_of or "aluminium"}, {"roughness"}),
        "mirror": ("Mirror", {"color": {"Even": 1.0}}, {"color", "roughness"}),
        "glass": ("Glass", {"glass": made_of or "N-BK7"}, {"roughness"}),
    }
    if kind not in known:
        if words or made_of is not None:
            raise ValueError(f"material: '{kind}' beside other words, expected one of {', '.join(known)}")
        return {"Named": kind}
    name, usual, allowed = known[kind]
    extra = set(words) - allowed | ({"made_of"} if made_of is not None and kind not in ("metal", "glass") else set())
    if extra:
        raise ValueError(f"material: '{kind}' has no {', '.join(sorted(extra))}")
    return {name: {**usual, **words}}


def _level(levels: dict[str, float | None]) -> dict[str, float]:
    given = {name: value for name, value in levels.items() if value is not None}
    if len(given) != 1:
        found = ", ".join(given) or "none"
        raise ValueError(f"how bright it is: {found}, expected one of {', '.join(levels)}")
    [(name, value)] = given.items()
    return {_LEVELS[name]: float(value)}


def _spectrum(value: str | tuple[Sequence[float], Sequence[float]]) -> Any:
    if isinstance(value, str):
        return _World.light(value)
    wavelengths_nm, values = (np.asarray(part, float).tolist() for part in value)
    return {"Spectrum": {"wavelengths_nm": wavelengths_nm, "values": values}}


class World:
    """A three-dimensional world that a program makes or changes: things, materials, lights and cameras by name.

    Parameters
    ----------
    path : str or os.PathLike, optional
        A file that it begins as: ``.pbrt``, ``.gltf``, ``.glb``, ``.obj``, ``.ply`` or ``.stl``; without one it is empty, with y up and z
        towards the viewer.
    unit_m : float
        Length of the file's unit, m.
    time_s, animation, variant : optional
        Of a glTF file, as of `Scene.world`.

    Objects have names, which `names` lists. In a name that is asked for, ``*`` stands for any letters and ``?`` for one; what an object is
    made of goes with it. Lengths are metres. An object that isn't there is a `ValueError` that tells which names are near.

    Examples
    --------
    >>> import dioptric as dp
    >>> world = dp.World()
    >>> world.add_plane("floor", (4, 4))
    >>> world.add_sphere("ball", 0.2, at=(0, 0.2, 0), material="plastic", color="#c02020")
    >>> world.add_spot("spot", at=(1, 2, 1), look_at=(0, 0, 0), cone_deg=40, lumens=800)
    >>> world.set_camera(eye=(0, 0.6, 2), look_at=(0, 0.2, 0))
    >>> scene = world.scene(samples=16)
    """

    def __init__(
        self,
        path: _Path | None = None,
        *,
        unit_m: float = 1.0,
        time_s: float | None = None,
        animation: str | None = None,
        variant: str | None = None,
    ) -> None:
        self._native = _World(None if path is None else os.fspath(path), unit_m, time_s, animation, variant)

    def _change(self, kind: str, **words: Any) -> None:
        self._native.change({kind: {key: value for key, value in words.items() if value is not None}})

    @property
    def names(self) -> list[str]:
        """The names of all objects."""
        return [row["name"] for row in self.objects]

    @property
    def objects(self) -> list[dict[str, Any]]:
        """What stands in the world, a dictionary each: ``name``, ``parent``, ``kinds``, ``materials``, ``n_primitives``,
        ``bounds_m`` and ``light``, the level of the largest light in it with its unit."""
        return self._native.objects()

    @property
    def lights(self) -> list[dict[str, Any]]:
        """Those of the `objects` that give light."""
        return [row for row in self.objects if row["light"] is not None]

    @property
    def materials(self) -> list[str]:
        """The names of the materials."""
        return self._native.materials()

    @property
    def cameras(self) -> list[str]:
        """The names of the cameras, the one that is looked through first."""
        return self._native.cameras()

    @property
    def notes(self) -> list[str]:
        """What of the files isn't understood, a sentence each."""
        return self._native.notes()

    def find(self, name: str) -> list[str]:
        """Returns the names of the objects that a name means, their parts included."""
        return self._native.find(name)

    def bounds_m(self, name: str | None = None) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Returns the corners of an upright box around objects, or around everything; None where nothing has a place."""
        corners = self._native.bounds_m(name)
        return None if corners is None else (corners[0], corners[1])

    def move(self, name: str, by: _Point | None = None, *, to: _Point | None = None) -> None:
        """Moves objects by so much, m, or so that the middle of the box around them is there."""
        if (by is None) == (to is None):
            raise ValueError("move: expected how far, 'by', or where, 'to'")
        if by is not None:
            self._change("Move", object=name, by_m=_point("by", by))
        elif to is not None:
            self._change("MoveTo", object=name, to_m=_point("to", to))

    def turn(self, name: str, axis: str | _Point, angle_deg: float, *, about: _Point | None = None) -> None:
        """Turns objects about an axis, ``"x"``, ``"y"``, ``"z"`` or a direction, by the right hand: through the middle of the box around
        them, or a point."""
        direction = _AXES.get(axis) if isinstance(axis, str) else axis
        if direction is None:
            raise ValueError(f"axis: '{axis}', expected 'x', 'y', 'z' or a direction")
        about_m = None if about is None else _point("about", about)
        self._change("Turn", object=name, axis=_point("axis", direction), angle_deg=float(angle_deg), about_m=about_m)

    def scale(self, name: str, by: float | _Point, *, about: _Point | None = None) -> None:
        """Makes objects so many times as large, from the middle of the box around them or from a point. What glows keeps its radiance."""
        factors = [float(by)] * 3 if isinstance(by, (int, float)) else _point("by", by)
        self._change("Scale", object=name, by=factors, about_m=None if about is None else _point("about", about))

    def copy(self, name: str, to: str) -> None:
        """Adds the same objects again, in the same place, under a name; a name that is taken gets a number."""
        self._change("Copy", object=name, to=to)

    def remove(self, name: str) -> None:
        """Takes objects out: things or lights."""
        self._change("Remove", object=name)

    def set_material(
        self,
        name: str,
        material: _Material,
        *,
        color: _Color | None = None,
        roughness: float | None = None,
        metallic: float | None = None,
        made_of: str | None = None,
    ) -> None:
        """Makes objects of another material.

        Parameters
        ----------
        material : {"matte", "plastic", "glossy", "metal", "mirror", "glass"} or str
            A kind, or the name of a material of the world. Plastic has a clear coat of index 1.5; glossy is the material of glTF.
        color : float, str, (r, g, b) or (wavelengths_nm, values), optional
            A reflectance; "#rrggbb" as seen; the path of a picture; a linear sRGB color; or a reflectance by wavelength.
        roughness : float, optional
            0 for a smooth surface to 1; its square is GGX's α.
        metallic : float, optional
            Of glossy the share of metal.
        made_of : str, optional
            Of metal "silver", "gold", "copper" or "aluminium"; of glass one of the catalogue, as "N-BK7", or an index, as "1.5".
        """
        self._change("Material", object=name, material=_material(material, color, roughness, metallic, made_of))

    def _add(self, name: str, shape: dict[str, Any], at: _Point, material: _Material, words: dict[str, Any]) -> None:
        known = ("color", "roughness", "metallic", "made_of")
        unknown = [word for word in words if word not in known]
        if unknown:
            raise TypeError(f"add: no argument '{unknown[0]}'; of materials there are {', '.join(known)}")
        made = _material(material, *(words.get(word) for word in known))
        self._change("Add", name=name, shape=shape, at_m=_point("at", at), material=made)

    def add_sphere(
        self, name: str, radius_m: float, *, at: _Point = (0, 0, 0), material: _Material = "matte", **words: Any
    ) -> None:
        """Adds a sphere whose middle is ``at``; ``material`` and more words as of `set_material`."""
        self._add(name, {"Sphere": {"radius_m": float(radius_m)}}, at, material, words)

    def add_box(
        self, name: str, size_m: _Point, *, at: _Point = (0, 0, 0), material: _Material = "matte", **words: Any
    ) -> None:
        """Adds a box along the axes, whose middle is ``at``; ``material`` and more words as of `set_material`."""
        self._add(name, {"Box": {"size_m": _point("size_m", size_m)}}, at, material, words)

    def add_plane(
        self, name: str, size_m: Sequence[float], *, at: _Point = (0, 0, 0), material: _Material = "matte", **words: Any
    ) -> None:
        """Adds a plane that lies flat, so wide and so deep; ``material`` and more words as of `set_material`."""
        self._add(name, {"Plane": {"size_m": [float(side) for side in size_m]}}, at, material, words)

    def add_disc(
        self, name: str, radius_m: float, *, at: _Point = (0, 0, 0), material: _Material = "matte", **words: Any
    ) -> None:
        """Adds a disc that lies flat; ``material`` and more words as of `set_material`."""
        self._add(name, {"Disc": {"radius_m": float(radius_m)}}, at, material, words)

    def add_mesh(
        self,
        name: str,
        positions_m: ArrayLike,
        triangles: ArrayLike,
        *,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        at: _Point = (0, 0, 0),
        material: _Material = "matte",
        **words: Any,
    ) -> None:
        """Adds triangles.

        Parameters
        ----------
        positions_m : array_like, (vertices, 3)
        triangles : array_like of int, (triangles, 3)
            Vertices by number, counterclockwise as seen from outside.
        normals : array_like, (vertices, 3), optional
        uvs : array_like, (vertices, 2), optional
            Texture coordinates, (0, 0) at the lower left of a picture.
        at, material, ... :
            As of `add_sphere`.
        """
        mesh = {
            "positions_m": _rows("positions_m", positions_m, 3, float),
            "triangles": _rows("triangles", triangles, 3, int),
            "normals": [] if normals is None else _rows("normals", normals, 3, float),
            "uvs": [] if uvs is None else _rows("uvs", uvs, 2, float),
        }
        self._add(name, {"Mesh": mesh}, at, material, words)

    def add_file(self, name: str, path: _Path, *, at: _Point = (0, 0, 0), unit_m: float = 1.0) -> None:
        """Adds the world of another file, upright, with its origin ``at``; its objects are parts of the one named."""
        self._change("AddFile", name=name, file=os.fspath(path), at_m=_point("at", at), unit_m=float(unit_m))

    def _add_light(self, name: str, kind: str, **words: Any) -> None:
        given = {key: value for key, value in words.items() if value is not None}
        self._change("Light", name=name, light={kind: given})

    def add_point_light(
        self,
        name: str,
        at: _Point,
        *,
        watts: float | None = None,
        lumens: float | None = None,
        candela: float | None = None,
        per_nm: float | None = None,
        spectrum: str | tuple[Sequence[float], Sequence[float]] = "D65",
    ) -> None:
        """Adds a point that shines alike in all directions.

        Parameters
        ----------
        at : (x, y, z)
        watts, lumens, candela, per_nm : float
            One of them: flux in all, intensity, or the intensity at 560 nm, W sr⁻¹ nm⁻¹.
        spectrum : str or (wavelengths_nm, values)
            A light, as "D65", "3200K" or a CSV file, or a table of its power.
        """
        level = _level({"watts": watts, "lumens": lumens, "candela": candela, "per_nm": per_nm})
        self._add_light(name, "Point", at_m=_point("at", at), level=level, spectrum=_spectrum(spectrum))

    def add_spot(
        self,
        name: str,
        at: _Point,
        look_at: _Point,
        *,
        cone_deg: float,
        soft: float = 0.0,
        watts: float | None = None,
        lumens: float | None = None,
        candela: float | None = None,
        per_nm: float | None = None,
        spectrum: str | tuple[Sequence[float], Sequence[float]] = "D65",
    ) -> None:
        """Adds a point that shines in a cone: ``cone_deg`` the whole angle, ``soft`` the share of it over which it falls to 0; how bright as of
        `add_point_light`."""
        level = _level({"watts": watts, "lumens": lumens, "candela": candela, "per_nm": per_nm})
        places = {"at_m": _point("at", at), "look_at_m": _point("look_at", look_at)}
        cone = {"cone_deg": float(cone_deg), "soft": float(soft)}
        self._add_light(name, "Spot", **places, **cone, level=level, spectrum=_spectrum(spectrum))

    def add_area_light(
        self,
        name: str,
        at: _Point,
        look_at: _Point,
        size_m: Sequence[float],
        *,
        watts: float | None = None,
        lumens: float | None = None,
        cd_m2: float | None = None,
        per_nm: float | None = None,
        spectrum: str | tuple[Sequence[float], Sequence[float]] = "D65",
    ) -> None:
        """Adds a rectangle that glows towards a point: how bright as flux, luminance, or radiance at 560 nm, W m⁻² sr⁻¹ nm⁻¹."""
        level = _level({"watts": watts, "lumens": lumens, "cd_m2": cd_m2, "per_nm": per_nm})
        places = {"at_m": _point("at", at), "look_at_m": _point("look_at", look_at)}
        size = [float(side) for side in size_m]
        self._add_light(name, "Area", **places, size_m=size, level=level, spectrum=_spectrum(spectrum))

    def add_distant_light(
        self,
        name: str,
        direction: _Point,
        *,
        lux: float | None = None,
        per_nm: float | None = None,
        spectrum: str | tuple[Sequence[float], Sequence[float]] = "D65",
    ) -> None:
        """Adds parallel light that comes from a direction: how bright on a surface that faces it, as illuminance or as irradiance at 560 nm,
        W m⁻² nm⁻¹."""
        level = _level({"lux": lux, "per_nm": per_nm})
        self._add_light(name, "Distant", **{"from": _point("direction", direction)}, level=level, spectrum=_spectrum(spectrum))

    def add_sky(self, name: str, sky: str = "day", *, turn_deg: float = 0.0, mean_cd_m2: float | None = None) -> None:
        """Adds light from all sides.

        Parameters
        ----------
        sky : str
            "even:RADIANCE" (W m⁻² sr⁻¹ nm⁻¹), "day:ELEVATION,AZIMUTH,TURBIDITY", or the path of a picture of all directions.
        turn_deg : float
            How far it is turned about what is up, to the right as seen from above.
        mean_cd_m2 : float, optional
            Its mean luminance; its own without it.
        """
        self._add_light(name, "Sky", sky=_World.sky(sky), turn_deg=float(turn_deg), mean_cd_m2=mean_cd_m2)

    def glow(
        self,
        name: str,
        *,
        cd_m2: float | None = None,
        per_nm: float | None = None,
        spectrum: str | tuple[Sequence[float], Sequence[float]] = "D65",
    ) -> None:
        """Makes objects glow: how bright as luminance, or as radiance at 560 nm, W m⁻² sr⁻¹ nm⁻¹."""
        self._change("Glow", object=name, level=_level({"cd_m2": cd_m2, "per_nm": per_nm}), spectrum=_spectrum(spectrum))

    def brighten(self, name: str, factor: float) -> None:
        """Makes the light of objects so many times as strong."""
        self._change("Brighten", object=name, factor=float(factor))

    def set_camera(
        self,
        eye: _Point,
        look_at: _Point | None = None,
        up: _Point | None = None,
        *,
        fov_deg: float = 40.0,
        size: tuple[int, int] = (720, 480),
        name: str = "camera",
    ) -> None:
        """Sets from where the world is seen: a place, what is in the middle of the picture (the middle of the world) and what is up in it, the
        angle across its width, and its columns and rows."""
        look_at_m = None if look_at is None else _point("look_at", look_at)
        up_of_picture = None if up is None else _point("up", up)
        view = {"eye_m": _point("eye", eye), "look_at_m": look_at_m, "up": up_of_picture}
        self._change("Camera", name=name, **view, fov_deg=float(fov_deg), size=list(size))

    def scene(self, **options: Any) -> Scene:
        """Returns the world as it is now before a camera; options as of `Scene.world`."""
        return Scene.world(self, **options)

    def write(self, path: _Path, *, strict: bool = False) -> list[str]:
        """Writes the world as ``.glb``, ``.gltf`` or ``.pbrt``, and returns what the format does not hold, a sentence each; ``strict`` refuses to
        write where that is anything."""
        return self._native.write(os.fspath(path), strict)

    def __copy__(self) -> World:
        other = World.__new__(World)
        other._native = self._native.copy()
        return other

    def __deepcopy__(self, memo: Any) -> World:
        return self.__copy__()

    def __repr__(self) -> str:
        words = self._native.words()
        return f"<World {words['file']}: {len(self.names)} objects, {len(words.get('changes', []))} changes>"
