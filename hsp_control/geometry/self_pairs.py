"""Pairs of a robot's own links that are checked for self-collision."""

from collections.abc import Sequence

from hsp_control.common.exceptions import ModelError
from hsp_control.geometry.links import LinkShape, part_of
from hsp_control.robot import Robot
from hsp_control.robot.description.access import XmlError, read_xml


def self_pairs(robot: Robot, links: Sequence[LinkShape]) -> list[tuple[int, int]]:
    """Return the pairs of link shapes that can collide, as indices into ``links``.

    Neighbours, which always touch, and pairs that the SRDF or MJCF disables are none.
    """
    disabled = _disabled(robot)
    parents = list(robot.model.parents)
    pairs = []
    for i, first in enumerate(links):
        for j in range(i + 1, len(links)):
            second = links[j]
            a, b = first.joint, second.joint
            if a == b or _neighbours(robot, first, second, parents):
                continue
            if frozenset((first.link, second.link)) in disabled:
                continue
            pairs.append((i, j))
    return pairs


def _neighbours(
    robot: Robot, first: LinkShape, second: LinkShape, parents: Sequence[int]
) -> bool:
    """Return whether a link's joint is the parent of the other's, in one part."""
    a, b = first.joint, second.joint
    if parents[a] != b and parents[b] != a:
        return False
    return min(a, b) > 0 or part_of(robot, first.link) is part_of(robot, second.link)


def _disabled(robot: Robot) -> set[frozenset[str]]:
    disabled = set()
    for part in robot.parts:
        for pair in part.source.excluded:
            disabled.add(frozenset(part.prefix + link for link in pair))
        if part.source.srdf is None:
            continue
        try:
            srdf = read_xml(part.source.srdf)
        except XmlError as error:
            raise ModelError(error.within(part.source.srdf)) from None
        except OSError as error:
            raise ModelError(f"{part.source.srdf}: {error.strerror}") from error
        for element in srdf.iter("disable_collisions"):
            links = (element.get("link1", ""), element.get("link2", ""))
            disabled.add(frozenset(part.prefix + link for link in links))
    return disabled
