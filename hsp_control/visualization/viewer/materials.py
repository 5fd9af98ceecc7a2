"""Materials in three.js's format: lit, or unlit (the same colour in any light)."""

from collections.abc import Sequence

from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.threejs import unique_name


def material(
    color: str | Sequence[float], *, opacity: float = 1.0, glow: float = 0.0
) -> Json:
    """Return a material that is lit by the scene's lights."""
    number = color_number(color)
    lit = color_number([(1.0 - glow) * (number >> k & 255) / 255 for k in (16, 8, 0)])
    surface: Json = {
        "uuid": unique_name(),
        "type": "MeshStandardMaterial",
        "color": lit,
        "roughness": 0.55,
        "metalness": 0.0,
        "emissive": number,
        "emissiveIntensity": glow,
    }
    if opacity < 1.0:
        surface |= {"transparent": True, "opacity": opacity, "depthWrite": False}
    return surface


def always_visible(surface: Json) -> Json:
    """Return a material without depth test: it is visible even inside a link."""
    return surface | {"transparent": True, "depthTest": False, "depthWrite": False}


def unlit_material(color: str) -> Json:
    """Return a material that has the same colour, ``#RRGGBB``, in any light."""
    return {
        "uuid": unique_name(),
        "type": "MeshBasicMaterial",
        "color": color_number(color),
        "side": 0,
    }


def color_number(color: str | Sequence[float]) -> int:
    """Return ``#RRGGBB``, or red, green and blue from 0 to 1, as three.js's number."""
    if isinstance(color, str):
        return int(color[1:], 16)
    red, green, blue = (round(255 * min(max(c, 0.0), 1.0)) for c in color[:3])
    return red << 16 | green << 8 | blue
