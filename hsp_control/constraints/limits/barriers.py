"""Barriers: functions of time and posture that the controller keeps above a minimum."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Annotated, NamedTuple, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import LimitError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Names, NonNegative, Number
from hsp_control.engine.plans import OnlyIf, PartCall, PartCalls, implemented_by
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields import Clearance, ObstacleClearance, SelfClearance
from hsp_control.null_space.fields.clearance import ObstacleOrName
from hsp_control.robot import RobotState
from hsp_control.robot.differences import gradient
from hsp_control.robot.gravity import Gravity

_SPAN = 3e-3
"""Step of the differences of a barrier's values [s]. The curvature of a capsule jumps
at the end of its side, and so would efforts: differences over this time turn the jump
into a ramp, with an error of a hundredth of a m/s² at 2 m/s, 0.1 m away."""
_TURN = 1e-4
"""Displacement of joints for the effect of an acceleration on distances [rad]."""
_AHEAD = 0.5
"""A pair gets a row if its distance may come close to the minimum within this time [s]
at its present rate."""
_NEAR = 0.5
"""A motor has a row if gravity uses more than this part of its permitted share, now or
within the time `_AHEAD` at the present rate."""


class BarrierRows(NamedTuple):
    """Rows A a ≥ least, written by calls of the engine."""

    number: Indices  # number of leading rows that are used, shape (1,)
    A: Array  # shape (r, nv)
    least: Array  # shape (r,)

    @classmethod
    def allocate(cls, rows: int, nv: int) -> Self:
        """Return memory for a number of rows."""
        return cls(np.zeros(1, dtype=np.int64), np.zeros((rows, nv)), np.zeros(rows))

    @property
    def used(self) -> tuple[Array, Array]:
        """A and least of the used rows."""
        number = self.number.item()
        return self.A[:number], self.least[:number]


class Barrier(Part, ABC, family="barriers", error=LimitError):
    """Numbers h(q, t) stay above a minimum.

    Their rows require h'' + 2α h' + α² (h - minimum) ≥ 0 (an exponential control
    barrier function). h'' = ∇h·a + the drift of h' at constant velocity.

    A subclass declares its parameters as fields and implements `values`::

        class FrameHeight(hsp.Barrier, type="frame_height"):
            \"\"\"A frame stays above a height.\"\"\"

            frame: str
            \"\"\"Name of the frame [-].\"\"\"

            def values(self, state: RobotState) -> float:
                return state.position(self.frame)[2]

    It may override `gradients`, which uses differences by default. h depends on q and t
    only. Its unit should make it comparable with a distance in metres: if limits
    contradict each other, their violations are compared. `rows` and `check_start` are
    for placed ones.
    """

    _: KW_ONLY
    minimum: Number = 0.0
    """The minimum [-], in the unit of h."""

    @abstractmethod
    def values(self, state: RobotState) -> ArrayLike:
        """Return h(q, t): a number, or shape (k,)."""

    def gradients(self, state: RobotState) -> Array:
        """Return ∇h in the tangent space, shape (k, nv); by default by differences."""
        return gradient(self._numbers, state)

    def placed(self, start: Start) -> Self:
        """Return the barrier with values relative to the start resolved, checked.

        Raises:
            LimitError: If h is not one or more finite numbers, or ∇h has another shape.
        """
        state = start.state
        self._checked_gradients(state, len(self._numbers(state)))
        return self

    def rows(
        self, state: RobotState, bandwidth: float, wanted: Array
    ) -> tuple[Array, Array]:
        """Return the rows A a ≥ b, (k, nv) and (k,).

        Args:
            state: The state.
            bandwidth: α [1/s].
            wanted: The unconstrained acceleration, shape (nv,); it may show which rows
                are needed.

        Raises:
            LimitError: If h or ∇h is not finite, or has another shape.
        """
        least = self._least_acceleration(state, bandwidth)
        return self._checked_gradients(state, len(least)), least

    def room(self, state: RobotState) -> int:
        """Return the maximum number of rows of `row_calls`; 0: `rows` is used."""
        return 0

    def row_calls(
        self, state: RobotState, bandwidth: float, wanted: Array, rows: BarrierRows
    ) -> PartCalls:
        """Return the calls that add the results of `rows` to ``rows``; see `room`.

        Args:
            state: The state.
            bandwidth: α [1/s].
            wanted: The array of the unconstrained acceleration, shape (nv,).
            rows: The rows to extend.
        """
        raise NotImplementedError

    def check_start(self, state: RobotState) -> None:
        """Check that no value starts below the minimum."""
        least = self._numbers(state).min()
        if least < self.minimum:
            raise LimitError(
                f"the start is outside the limits: {type(self).__name__} is "
                f"{least:.4g}, must be at least {self.minimum:g}"
            )

    def _numbers(self, state: RobotState) -> Array:
        """Return the values as a new array, shape (k,), checked."""
        h = self.values(state.read_only)
        try:
            found = np.atleast_1d(np.array(h, dtype=float))
        except (TypeError, ValueError):
            found = np.empty(0)
        if not found.size or found.ndim > 1 or not np.isfinite(found).all():
            raise LimitError(
                f"{type(self).__name__} has the values {h!r} at t = {state.t:.6g} s; "
                "needs finite numbers, one or shape (k,)"
            )
        return found

    def _checked_gradients(self, state: RobotState, count: int) -> Array:
        """Return ∇h, shape (k, nv): a NaN would end the search for an effort."""
        given, needed = self.gradients(state.read_only), (count, state.robot.nv)
        try:
            found = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            found = np.array(np.nan)
        if found.shape == needed and np.isfinite(found).all():
            return found
        what = f"of shape {found.shape}" if found.ndim else repr(given)
        if found.shape == needed:
            what = "with NaN or inf"
        raise LimitError(
            f"{type(self).__name__} has gradients {what} at t = {state.t:.6g} s; needs "
            f"finite numbers of shape {needed}"
        )

    def _least_acceleration(self, state: RobotState, bandwidth: float) -> Array:
        """Return the least ∇h·a, shape (k,)."""
        h = self._numbers(state)
        ahead = self._numbers(state.ahead(_SPAN))
        behind = self._numbers(state.ahead(-_SPAN))
        rate = (ahead - behind) / (2.0 * _SPAN)
        drift = (ahead - 2.0 * h + behind) / _SPAN**2
        left = h - self.minimum
        return -drift - 2.0 * bandwidth * rate - bandwidth**2 * left


class MinimumDistance(Barrier):
    """The distances of some pairs of shapes stay above a minimum.

    The drift includes the motion of the obstacles and of the nearest points. A subclass
    implements `clearance` and, if it refers to the scene, `placed`.
    """

    minimum: NonNegative
    """The minimum distance [m]."""

    @property
    @abstractmethod
    def clearance(self) -> Clearance:
        """The field with the pairs of shapes."""

    def values(self, state: RobotState) -> Array:
        """Return the distances, shape (k,) [m]; the next call overwrites them."""
        return self.clearance.proximity(state).measure(state)

    def _numbers(self, state: RobotState) -> Array:
        return self.values(state).copy()

    def placed(self, start: Start) -> Self:
        """Return the distances with obstacles instead of their names, checked."""
        self.clearance.proximity(start.state)
        return self

    def room(self, state: RobotState) -> int:
        """Return the number of pairs; see `Barrier.room`."""
        ways = "row_calls", "rows", "values", "gradients", "_numbers"
        own = implemented_by(self, *ways) == "row_calls"
        return len(self.clearance.proximity(state).pairs) if own else 0

    def rows(
        self, state: RobotState, bandwidth: float, wanted: Array
    ) -> tuple[Array, Array]:
        """Return the rows of `row_calls`; see `Barrier.rows`."""
        room, a = self.room(state), np.array(wanted)
        if not room:
            return super().rows(state, bandwidth, a)
        rows = BarrierRows.allocate(room, state.robot.nv)
        state.run(self.row_calls(state, bandwidth, a, rows))
        return rows.used

    def row_calls(
        self, state: RobotState, bandwidth: float, wanted: Array, rows: BarrierRows
    ) -> PartCalls:
        """Return the calls that add rows of pairs close or approaching.

        Others have one as soon as the unconstrained acceleration uses half of the value
        that b permits: an effort with a limited rate could not follow a row that is
        violated when it appears.
        """
        robot, turning = state.robot, {"turn": _TURN, "size": state.robot.size}
        here = self.clearance.proximity(state)
        now, count = here.distances, len(here.distances)
        ahead, behind, turned, least = np.zeros((4, count))
        near: Indices = np.zeros(count, dtype=np.int64)
        turn: Array = np.zeros(robot.nv)
        matters: Indices = np.zeros(1, dtype=np.int64)
        measured = _Elsewhere(state, self.clearance).calls
        close = PartCall(
            engine.NearPairs,
            minimum=self.minimum,
            bandwidth=bandwidth,
            span=_SPAN,
            look_ahead=_AHEAD,
            turning=turning,
            now=now,
            ahead=ahead,
            behind=behind,
            a=wanted,
            least=least,
            near=near,
            displacement=turn,
            turning_matters=matters,
        )
        approached = PartCall(
            engine.ApproachedPairs,
            turning=turning,
            now=now,
            turned=turned,
            least=least,
            a=wanted,
            near=near,
        )
        look = [*measured(1.0, turn, 0.0, turned), approached]
        return [
            *here.calls(state),
            *measured(_SPAN, state.v, _SPAN, ahead),
            *measured(-_SPAN, state.v, -_SPAN, behind),
            close,
            OnlyIf(look, matters),
            here.row_call(state, near, least, rows),
        ]

    def check_start(self, state: RobotState) -> None:
        """Check that no pair starts closer than the minimum distance."""
        distance, pair = self.clearance.proximity(state).nearest(state)
        if distance < self.minimum:
            raise LimitError(
                f"the start is outside the limits: {pair} are {distance:.4g} m apart, "
                f"must be at least {self.minimum:g} m"
            )


def barrier_names(barriers: Sequence[Barrier]) -> list[str]:
    """Return the names of barriers in a log: their types, numbered if several."""
    types = [each.yaml_type or type(each).__name__ for each in barriers]
    return [
        name if types.count(name) == 1 else f"{name}_{k}"
        for k, name in enumerate(types)
    ]


class _Elsewhere:
    """Distances at a displaced posture, at a later time."""

    def __init__(self, state: RobotState, clearance: Clearance) -> None:
        self._state, companion = state, state.companion
        proximity = clearance.proximity(companion)
        measure = companion.plan(proximity.calls(companion)).steps()
        self._move, self._measured = companion.bind_move(measure), proximity.distances
        self._q = state.robot.neutral()

    def calls(self, h: float, x: Array, later: float, out: Array) -> PartCalls:
        """Return the calls that measure at q ⊕ h x, and later by a time [s]."""
        state, q = self._state, self._q

        def displace() -> None:
            q[:] = pin.integrate(state.robot.model, state.q, h * x)

        place = PartCall(displace)
        if state.robot.linear:
            place = PartCall(engine.Displace, h=h, q=state.q, x=x, displaced=q)
        at = PartCall(
            engine.DistancesAt,
            move=self._move,
            time=state.time,
            later=later,
            q=q,
            v=state.v,
            measured=self._measured,
            distances=out,
        )
        return [place, at]


class ObstacleDistance(MinimumDistance, type="obstacle_distance"):
    """Minimum distance between links and obstacles."""

    minimum: NonNegative = 0.02
    """The minimum distance [m]."""
    _: KW_ONLY
    obstacles: (
        Annotated[Sequence[ObstacleOrName], Field(min_length=1), AfterValidator(tuple)]
        | None
    ) = None
    """Names of the obstacles; or, in Python, the obstacles themselves [-]; all of the
    scene by default."""
    links: Names | None = None
    """Names of the links [-]; all moving links by default."""

    @cached_property
    def clearance(self) -> ObstacleClearance:
        """The field with the pairs of shapes."""
        return ObstacleClearance(obstacles=self.obstacles, links=self.links)

    def placed(self, start: Start) -> Self:
        """Return the distances, checked; see `MinimumDistance.placed`."""
        obstacles = self.clearance.fitted(start).obstacles
        return super(ObstacleDistance, replace(self, obstacles=obstacles)).placed(start)


class SelfDistance(MinimumDistance, type="self_distance"):
    """Minimum distance between links."""

    minimum: NonNegative = 0.01
    """The minimum distance [m]."""

    @cached_property
    def clearance(self) -> SelfClearance:
        """The field with the pairs of shapes."""
        return SelfClearance()


@dataclass(frozen=True, eq=False)
class StaticEffort:
    """Gravity uses at most a share of every motor's effort.

    Otherwise an arm reaches postures in which its motors cannot hold it, and falls. A
    motor's gravity effort, G_i(q), depends on the posture only, so this is a limit on
    postures: with h = share - |G_i|/effort_i, the rows require h'' + 2α h' + α² h ≥ 0,
    with G_i'' = ∇G_i·a + the drift of G_i' at constant velocity.

    Attributes:
        effort: Maximum effort, shape (nv,) [N·m or N]; inf where unlimited.
        share: The share of it that gravity may use, in (0, 1].
    """

    effort: Array
    share: float

    def room(self) -> int:
        """Return the maximum number of rows of `row_calls`."""
        return int(np.isfinite(self.effort).sum())

    def row_calls(
        self,
        state: RobotState,
        bandwidth: float,
        excluded: Indices,
        rows: BarrierRows,
    ) -> PartCalls:
        """Return the calls that add rows A a ≥ b of the motors near their limit.

        Args:
            state: The state.
            bandwidth: α [1/s].
            excluded: Indices in v of motors whose effort depends on contact forces:
                those from the root to a contact.
            rows: The rows to extend.
        """
        gravity = Gravity(state.robot.model, state.dynamics, state.world)
        held = np.isfinite(self.effort)
        held[[*state.robot.unactuated, *excluded]] = False
        near = PartCall(
            engine.HoldingRows,
            share=self.share,
            bandwidth=bandwidth,
            look_ahead=_AHEAD,
            near=_NEAR,
            motors=np.flatnonzero(held),
            limit=self.effort,
            effort=gravity.effort,
            slope=gravity.slope,
            drift=gravity.drift,
            v=state.v,
            rows=rows,
        )
        return [*gravity.calls, near]
