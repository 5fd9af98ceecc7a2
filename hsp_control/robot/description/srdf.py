"""The pairs of links that never collide, by a robot's SRDF and its own description."""

from collections.abc import Collection
from pathlib import Path

from hsp_control.common.errors import ModelError
from hsp_control.robot.description.access import XmlError, read_xml
from hsp_control.robot.description.sources import RobotSource

Pair = frozenset[str]
"""The names of two links."""


def excluded_pairs(source: RobotSource, links: Collection[str]) -> set[Pair]:
    """Return the pairs of some links that never collide, and others that are named.

    Raises:
        ModelError: If the SRDF cannot be read.
    """
    found = set(source.excluded)
    return found if source.srdf is None else found | _by_srdf(source.srdf, links)


def _by_srdf(path: Path, links: Collection[str]) -> set[Pair]:
    """Return the pairs that an SRDF disables.

    As in MoveIt: those of a link of ``disable_default_collisions``, but for those of
    ``enable_collisions``; and all of ``disable_collisions``.
    """
    try:
        srdf = read_xml(path)
    except XmlError as error:
        raise ModelError(error.within(path)) from None
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}") from error

    def pairs(tag: str) -> set[Pair]:
        every = srdf.iter(tag)
        return {frozenset((x.get("link1", ""), x.get("link2", ""))) for x in every}

    every = srdf.iter("disable_default_collisions")
    whole = {frozenset((x.get("link", ""), other)) for x in every for other in links}
    return whole - pairs("enable_collisions") | pairs("disable_collisions")
