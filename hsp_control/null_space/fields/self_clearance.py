"""The cost of links that come close to each other."""

from dataclasses import KW_ONLY
from weakref import WeakKeyDictionary

import numpy as np

from hsp_control.declaration.quantities import Positive
from hsp_control.geometry import Proximity, Proxy, link_shapes, self_pairs
from hsp_control.null_space.fields.clearance import Clearance
from hsp_control.robot import Robot


class SelfClearance(Clearance, type="self_clearance"):
    """f = Σ b(d_k / influence) over pairs of shapes of different links.

    Neighbouring links and pairs that the SRDF disables do not count. Pairs that overlap
    at the robot's home configuration do not count either, because the approximating
    shapes are larger than the links.

    The gradient between two capsules jumps when they become parallel. This is rare in
    space, but not for a planar arm. With ``spheres`` it does not jump, but the
    computation takes longer.
    """

    influence: Positive = 0.1
    _: KW_ONLY
    proxy: Proxy = "capsules"

    def _pairs(self, robot: Robot) -> Proximity:
        pairs = _apart_at_home(robot, self.proxy)
        return Proximity(robot, link_shapes(robot, self.proxy), (), pairs)


_Pairs = tuple[tuple[int, int], ...]
_found: "WeakKeyDictionary[Robot, dict[Proxy, _Pairs]]" = WeakKeyDictionary()


def _apart_at_home(robot: Robot, proxy: Proxy) -> _Pairs:
    """Return the pairs of link shapes that do not overlap at home; found once."""
    known = _found.setdefault(robot, {})
    if proxy not in known:
        shapes = link_shapes(robot, proxy)
        pairs = self_pairs(robot, shapes)
        home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
        apart = Proximity(robot, shapes, (), pairs).measure(home) > 0.0
        known[proxy] = tuple(pair for pair, ok in zip(pairs, apart, strict=True) if ok)
    return known[proxy]
