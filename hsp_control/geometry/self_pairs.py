"""Which pairs of a robot's own links are worth keeping apart."""

from collections.abc import Sequence
from xml.etree import ElementTree

import pinocchio as pin

from hsp_control.geometry.links import LinkShape
from hsp_control.robot import Robot


def self_pairs(robot: Robot, links: Sequence[LinkShape]) -> list[tuple[int, int]]:
    """Return the pairs of shapes of different links that may come apart and together.

    Left out: shapes on one joint or on neighbouring ones, which always touch, and pairs
    that the robot's SRDF disables.
    """
    disabled = _disabled(robot)
    parents = list(robot.model.parents)
    pairs = []
    for i, first in enumerate(links):
        for j in range(i + 1, len(links)):
            second = links[j]
            a, b = first.joint, second.joint
            if a == b or parents[a] == b and a > 0 or parents[b] == a and b > 0:
                continue
            if frozenset((first.link, second.link)) in disabled:
                continue
            # Both on bodies that never move against each other: nothing to gain.
            if _rigid(robot.model, a, b):
                continue
            pairs.append((i, j))
    return pairs


def _rigid(model: pin.Model, a: int, b: int) -> bool:
    return a == 0 and b == 0


def _disabled(robot: Robot) -> set[frozenset[str]]:
    if robot.source.srdf is None:
        return set()
    root = ElementTree.parse(robot.source.srdf).getroot()
    return {
        frozenset((pair.get("link1", ""), pair.get("link2", "")))
        for pair in root.iter("disable_collisions")
    }
