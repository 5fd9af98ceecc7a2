"""Find a posture from which a robot can work: regular, within limits and clear.

Of the postures that qualify, the nearest to the middle of the joints' limits is chosen.
The candidates are a Halton sequence, so that the result depends on the robot and the
task alone.
"""

import logging
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from operator import attrgetter, itemgetter
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.common.errors import ConfigurationError, ModelError
from hsp_control.geometry.links import link_shapes, self_pairs
from hsp_control.geometry.proximity import Proximity
from hsp_control.geometry.scene import Obstacle
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.inverse_kinematics import Reached, Target, reach
from hsp_control.robot.kinematics import joint_support

_SAMPLES = 48
_ALWAYS = 0.9
"""Pairs of links that overlap in this share of all samples touch by construction."""
_MARGIN = 0.05
"""Distance from a limit, as a share of the joint's range."""
_WIDE = 8.0 * np.pi
"""A joint with a greater range has no middle: files write 1e5 for no limit."""
_GAP = 0.02
"""Least distance from an obstacle [m]; links only must not overlap."""
_SHARE = 0.5
"""Smallest accepted singular value, relative to the best one found."""
_ARM = 3
"""Fewest joints of an arm; fingers have fewer."""
_EACH, _TOGETHER = 12, 60
"""Most postures of one arm, and of all together, where arms are searched separately."""
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71)

_log = logging.getLogger(__name__)

Rows = tuple[str, tuple[int, ...]]
"""A frame, and the rows of its Jacobian in world axes that a task tracks."""


class Judgement(NamedTuple):
    """The criteria by which a posture is judged."""

    q: Array  # the configuration, shape (nq,)
    regularity: float  # the smallest singular value of the tasks' stacked Jacobian
    # the smallest distance of links and obstacles [m]; inf: there are none
    distance: float
    pair: str  # the two that are at this distance
    clear: bool  # whether no links overlap, and no obstacle is near
    # distance from the middle: root mean square over the joints, 1 at the limits
    eccentricity: float


_eccentricity = attrgetter("eccentricity")


class PostureSearch:
    """Evaluates postures of one robot, and finds a good one."""

    def __init__(
        self, robot: Robot, rows: Sequence[Rows], obstacles: Sequence[Obstacle] = ()
    ) -> None:
        self.robot = robot  # the robot, with a fixed base
        self._state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
        self._rows = tuple(rows)
        lower, upper = robot.position_limits()
        bounded = upper - lower < _WIDE  # also not where there is no limit
        home = robot.joint_positions(robot.home())
        half = np.full(robot.nv, np.pi)
        half[bounded] = 0.5 * (upper[bounded] - lower[bounded])
        # displacement from neutral of the middle of the limits, shape (nv,); of a joint
        # without limits: of home
        self.middle: Array = home.copy()
        self.middle[bounded] = 0.5 * (lower[bounded] + upper[bounded])
        self._half = half
        self._root = np.array(["root_joint" in name for name in robot.dof_names])
        inner = (1.0 - 2.0 * _MARGIN) * half
        self._lower = np.maximum(self.middle - inner, lower)
        self._upper = np.minimum(self.middle + inner, upper)
        self._lower[self._root] = self._upper[self._root] = home[self._root]
        self._proximity = self._pairs_that_can_be_apart(obstacles)
        pairs = self._proximity.pairs if self._proximity else ()
        links = len(self._proximity.links) if self._proximity else 0
        self._gaps = np.array([_GAP if j >= links else 0.0 for _, j in pairs])

    def judge(self, q: Array) -> Judgement:
        """Return the criteria at a configuration, shape (nq,)."""
        robot, state = self.robot, self._state_at(q)
        regularity = np.inf
        if self._rows:
            blocks = [state.frame(f).jacobian[list(rows)] for f, rows in self._rows]
            values = np.linalg.svd(np.vstack(blocks), compute_uv=False)
            regularity = float(values[-1])
        distance, spare, pair = np.inf, np.inf, ""
        if self._proximity is not None:
            distance, pair = self._proximity.nearest(state)
            spare = float((self._proximity.measure(state) - self._gaps).min())
        offset = ((robot.joint_positions(q) - self.middle) / self._half)[~self._root]
        eccentricity = float(np.sqrt(np.mean(offset**2))) if offset.size else 0.0
        return Judgement(q, regularity, distance, pair, spare > 0.0, eccentricity)

    def overlap(self, q: Array) -> tuple[float, str]:
        """Return how deep [m] links and obstacles overlap, and the pair ``a to b``.

        Capsules are larger than the links; so overlapping pairs of them are measured
        again with the convex hulls of the links.
        """
        rough = self._proximity
        if rough is None:
            return 0.0, ""
        robot, state = self.robot, self._state_at(q)
        names = [each.link for each in rough.links] + [o.name for o in rough.obstacles]
        suspected = {
            (names[i], names[j])
            for (i, j), d in zip(rough.pairs, rough.measure(state), strict=True)
            if d <= 0.0
        }
        hulls = link_shapes(robot, "hulls")
        names = [each.link for each in hulls] + [o.name for o in rough.obstacles]
        pairs = [
            (i, j)
            for j in range(len(names))
            for i in range(min(j, len(hulls)))
            if {(names[i], names[j]), (names[j], names[i])} & suspected
        ]
        if not pairs:
            return 0.0, ""
        distance, pair = Proximity(robot, hulls, rough.obstacles, pairs).nearest(state)
        return max(-distance, 0.0), pair

    def find(self, least: float) -> Judgement:
        """Return a good posture near the middle, with few joints away from it."""
        seen = [self.judge(self._at(x)) for x in self._displacements()]
        good, needed = self._qualified(seen, least)
        if not good:
            together = [self.judge(self._at(x)) for x in self._assembled(least)]
            good, needed = self._qualified(together, least)
        if not good:
            raise ConfigurationError(
                f"no good posture is found: {_nearest(seen, least)}"
            )
        best = min(good, key=_eccentricity)
        return min(
            (self._nearer_to_the_middle(each, needed) for each in (best, good[0])),
            key=_eccentricity,
        )

    def rounded(self, found: Judgement) -> Judgement:
        """Return a posture with the numbers that `start_line` writes."""
        return self.judge(self._at(np.round(self.robot.joint_positions(found.q), 3)))

    def start_line(self, found: Judgement) -> str:
        """Return the value of ``start`` in a configuration that begins at a posture."""
        positions = self.robot.joint_positions(found.q) + 0.0  # no -0.000
        return f"{{joints: [{', '.join(f'{x:.3f}' for x in positions)}]}}"

    def find_with(self, target: Target, least: float) -> Judgement:
        """Return a good posture at which a frame is at a target."""
        self.robot.frame_id(target.frame)
        starts = [(x, self.middle) for x in self._displacements()]
        found, reached = self._reached(target, starts)
        if not reached:
            raise ConfigurationError(_too_far(found, target))
        good, _ = self._qualified(reached, least)
        if not good:  # the others keep their good postures
            starts = [(x, x) for x in self._assembled(least)]
            good, _ = self._qualified(self._reached(target, starts)[1], least)
        if not good:
            raise ConfigurationError(
                f"frame {target.frame!r} reaches its place, but in no good posture: "
                + _nearest(reached, least)
            )
        return min(good, key=_eccentricity)

    def _reached(
        self, target: Target, starts: Iterable[tuple[Array, Array]]
    ) -> tuple[list[Reached], list[Judgement]]:
        """Return where inverse kinematics end, and those postures that are there.

        ``starts``: initial postures, and those that attract them, shapes (nv,).
        """
        bounds = self._lower, self._upper
        found = [
            reach(self.robot, target, self._at(x), preferred, *bounds)
            for x, preferred in starts
        ]
        return found, [self.judge(each.q) for each in found if each.converged]

    def _qualified(
        self, seen: Sequence[Judgement], least: float
    ) -> tuple[list[Judgement], float]:
        """Return those that are clear and regular, and their least singular value."""
        clear = [each for each in seen if each.clear]
        best = max((each.regularity for each in clear), default=0.0)
        needed = max(least, _SHARE * best) if np.isfinite(best) else least
        return [each for each in clear if each.regularity > needed], needed

    def _nearer_to_the_middle(self, found: Judgement, needed: float) -> Judgement:
        """Return a good posture with fewer joints away from the middle, and less so."""
        for share in (0.0, 0.5, 0.7, 0.9):
            for k in np.flatnonzero(~self._root):
                x = self.robot.joint_positions(found.q)
                x[k] = self.middle[k] + share * (x[k] - self.middle[k])
                each = self.judge(self._at(x))
                if each.clear and each.regularity > needed:
                    found = each
        return found

    def _displacements(self) -> Iterator[Array]:
        """Yield home, the middle, and postures all over the limits, shape (nv,)."""
        yield np.clip(
            self.robot.joint_positions(self.robot.home()), self._lower, self._upper
        )
        yield self.middle.copy()
        for number in range(1, _SAMPLES + 1):
            yield self._drawn(number, np.arange(self.robot.nv))

    def _drawn(self, number: int, dofs: Indices) -> Array:
        """Return one of many postures of some joints all over their limits."""
        share = np.array([_halton(number, k) for k in range(len(dofs))])
        lower, upper = self._lower[dofs], self._upper[dofs]
        return np.asarray(lower + share * (upper - lower))

    def _assembled(self, least: float) -> Iterator[Array]:
        """Yield displacements in which the arms are good separately, shape (nv,).

        Where one posture in five is good for an arm, one in 25 is for two of them, but
        they hardly depend on one another. All else is at home.
        """
        home = next(self._displacements())
        arms = [(dofs, self._alone(dofs, home, least)) for dofs in self._arms()]
        choices = product(*(range(min(len(good), _EACH)) for _, good in arms))
        for choice in sorted(choices, key=sum)[:_TOGETHER]:
            x = home.copy()
            for (dofs, good), k in zip(arms, choice, strict=True):
                x[dofs] = good[k]
            yield x

    def _alone(self, dofs: Indices, home: Array, least: float) -> list[Array]:
        """Return an arm's displacements that are good independently of other arms."""
        pairs = self._pairs_of(dofs)
        found = []
        drawn = (self._drawn(k, dofs) for k in range(1, _SAMPLES + 1))
        for own in (home[dofs], self.middle[dofs], *drawn):
            x = home.copy()
            x[dofs] = own
            state = self._state_at(self._at(x))
            if self._proximity is not None:
                spare = self._proximity.measure(state) - self._gaps
                if spare[pairs].min(initial=np.inf) <= 0.0:
                    continue
            rows = [state.frame(f).jacobian[list(r)][:, dofs] for f, r in self._rows]
            rows = [J for J in rows if J.any()]
            regularity = np.inf
            if rows:
                regularity = np.linalg.svd(np.vstack(rows), compute_uv=False)[-1]
            away = float(np.linalg.norm((x - self.middle)[dofs]))
            found.append((away, regularity, x[dofs]))
        finite = [regular for _, regular, _ in found if np.isfinite(regular)]
        needed = max(least, _SHARE * max(finite, default=0.0))
        good = [each for each in found if each[1] > needed]
        return [x for _, _, x in sorted(good, key=itemgetter(0))]

    def _pairs_of(self, dofs: Indices) -> Flags:
        """Return which pairs an arm moves, and no other one."""
        if self._proximity is None:
            return np.zeros(0, dtype=bool)
        every = {int(each) for arm in self._arms() for each in arm}
        own, model = {*dofs.tolist()}, self.robot.model
        moved = [
            every & {*joint_support(model, link.joint)[1].tolist()}
            for link in self._proximity.links
        ]
        moved += [set() for _ in self._proximity.obstacles]
        both = [moved[i] | moved[j] for i, j in self._proximity.pairs]
        return np.array([bool(each) and each <= own for each in both], dtype=bool)

    def _arms(self) -> list[Indices]:
        """Return the degrees of freedom of each arm, where there are several."""
        model, arms = self.robot.model, [0]
        while len(arms) == 1:
            (base,) = arms
            arms = [
                joint
                for joint in range(1, model.njoints)
                if model.parents[joint] == base and len(self._beyond(joint)) >= _ARM
            ]
        return [self._beyond(joint) for joint in arms]

    def _beyond(self, joint: int) -> Indices:
        """Return the degrees of freedom of a joint and of all that it carries."""
        model = self.robot.model
        carried = [model.joints[each] for each in model.subtrees[joint]]
        dofs = [k for each in carried for k in range(each.idx_v, each.idx_v + each.nv)]
        return np.array(sorted(dofs), dtype=np.int64)

    def _state_at(self, q: Array) -> RobotState:
        """Return the state at rest in a configuration; the next call moves it."""
        return self._state.update(0.0, q, np.zeros(self.robot.nv))

    def _at(self, x: Array) -> Array:
        return self.robot.integrate(self.robot.neutral(), x)

    def _pairs_that_can_be_apart(
        self, obstacles: Sequence[Obstacle]
    ) -> Proximity | None:
        """Return the pairs to keep apart; None if there are none."""
        robot = self.robot
        try:
            links = link_shapes(robot)
        except ModelError as error:
            _log.warning("%s; postures are not checked for collisions", error)
            return None
        pairs = self_pairs(robot, links)
        if pairs:
            everywhere = Proximity(robot, links, (), pairs)
            overlaps = [
                everywhere.measure(self._state_at(self._at(x))) <= 0.0
                for x in self._displacements()
            ]
            apart = np.mean(overlaps, axis=0) < _ALWAYS
            pairs = [
                pair for pair, can in zip(everywhere.pairs, apart, strict=True) if can
            ]
        pairs += [
            (i, len(links) + k)
            for i, link in enumerate(links)
            for k in range(len(obstacles))
            if link.joint > 0
        ]
        return Proximity(robot, links, tuple(obstacles), pairs) if pairs else None


def _halton(number: int, dimension: int) -> float:
    """Return an entry of the Halton sequence, in (0, 1) (Halton 1960)."""
    base = _PRIMES[dimension % len(_PRIMES)]
    number += 409 * (dimension // len(_PRIMES))
    share, value = 1.0, 0.0
    while number:
        share /= base
        value += share * (number % base)
        number //= base
    return value


def _nearest(seen: Sequence[Judgement], least: float) -> str:
    """Describe how close the rejected postures came to the criteria."""
    clear = [each for each in seen if each.clear]
    if not clear:
        best = max(seen, key=lambda each: each.distance)
        return (
            f"of {len(seen)} postures none is clear; at best {best.pair} are "
            f"{best.distance:.3g} m apart (links must not overlap, and be {_GAP:g} m "
            "from obstacles)"
        )
    best = max(clear, key=lambda each: each.regularity)
    return (
        f"of {len(clear)} clear postures none is regular; the smallest singular value "
        f"of the tasks is at best {best.regularity:.3g}, needs more than {least:g}"
    )


def _too_far(found: Sequence[Reached], target: Target) -> str:
    nearest = min(each.error for each in found)
    unit = "m" if target.rows == 3 else "m and rad"
    return (
        f"frame {target.frame!r} cannot reach its place within the joints' limits: "
        f"from {len(found)} postures it came to {nearest:.3g} ({unit})"
    )
