"""Plans of small pictures, and stores compared."""

from __future__ import annotations

from pathlib import Path

# Apertures × exposures of a flat scene; the lens does not open to the last of the apertures.
PLAN = """(
    base: Camera((
        name: "small", lens: BuiltIn("dgauss-50mm"), focus: DistanceMm(2000.0),
        film: Pixels(columns: 48, rows: 32, pitch_um: 200.0), sensor: BuiltIn("nikon-d5100"),
        scene: (source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0),
        wavelengths: ListNm([450.0, 550.0, 650.0]),
    )),
    vary: [Grid({"exposure.Manual.time_s": List([0.001, 0.01, 0.1]), "stop.FNumber": List([4, 8, 0.1])})],
    outputs: (raw: true, irradiance: true),
)"""


def write_plan(folder: Path, text: str = PLAN) -> Path:
    """Writes a plan file."""
    path = folder / "plan.ron"
    path.write_text(text, encoding="utf-8")
    return path


def files(folder: Path) -> dict[str, bytes]:
    """Returns every file below a folder with its bytes."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
