"""Pairs of links that overlap at home."""

from collections.abc import Iterator

import numpy as np

from hsp_control.geometry import Proximity, link_shapes, self_pairs
from hsp_control.inspection.finding import Finding
from hsp_control.robot import Robot


def check_self_collisions(robot: Robot) -> Iterator[Finding]:
    """Yield the pairs of links whose capsules overlap at the home posture."""
    shapes = link_shapes(robot)
    pairs = self_pairs(robot, shapes)
    if not pairs:
        return
    home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    proximity = Proximity(robot, shapes, (), pairs)
    distances = proximity.measure(home)
    deepest: dict[tuple[str, str], float] = {}
    for (i, j), distance in zip(proximity.pairs, distances, strict=True):
        links = shapes[i].link, shapes[j].link
        deepest[links] = min(deepest.get(links, 0.0), float(distance))
    for (first, second), distance in deepest.items():
        if distance < 0.0:
            yield Finding(
                "note",
                "self-collision",
                f"{first!r} and {second!r}",
                f"their capsules overlap at home by {-distance:.3g} m: self_clearance "
                "leaves this pair out",
                "if they can collide, bound their joints by limits: position",
            )
