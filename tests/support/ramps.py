"""Descending ground, unknown to the plan."""

from math import cos, radians, sin


def ramp(degrees: float, edge: float) -> list[str]:
    """Return the settings of a platform up to an edge [m], and a slippery ramp."""
    slope = radians(degrees)
    x, z = edge + 2.0 * cos(slope) - 0.1 * sin(slope), -2.0 * sin(slope)
    box = "shape: {type: box, size: [4, 4, 0.2]}, friction: 0.35, position"
    flat = f"flat: {{{box}: [{edge - 2.0}, 0, -0.1]}}"
    down = f"{{{box}: [{x}, 0, {z - 0.1 * cos(slope)}], rotation: [0, {slope}, 0]}}"
    return [f"plant.solids={{{flat}, ramp: {down}}}", "plant.ground={height: -3}"]
