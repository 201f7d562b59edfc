"""Results as HTML, for notebooks."""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._native import Shot


def shot(shot: Shot) -> str:
    """Returns the picture above a table of what took it."""
    picture = base64.b64encode(shot.png()).decode()
    rows, columns = shot.shape
    wavelengths = shot.wavelengths_nm
    table = {
        "pixels": f"{columns} × {rows}, {shot.pitch_um:.4g} µm apart",
        "bands": f"{len(wavelengths)}, {wavelengths[0]:.0f}–{wavelengths[-1]:.0f} nm",
        "film": f"{shot.film_mm:.3f} mm behind the last vertex",
        "exposure": f"{1e3 * shot.exposure_s:.4g} ms",
        "quality": shot.quality,
    }
    cells = "".join(f"<tr><th>{name}</th><td>{html.escape(value)}</td></tr>" for name, value in table.items())
    name = html.escape(shot.camera.name)
    return (
        f'<figure><img alt="{name}" style="max-width:100%" src="data:image/png;base64,{picture}">'
        f"<figcaption>{name}</figcaption><table>{cells}</table></figure>"
    )
