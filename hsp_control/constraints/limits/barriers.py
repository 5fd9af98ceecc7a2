"""Barriers: functions of time and posture that the controller keeps above a minimum."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Annotated, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import LimitError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Names, NonNegative, Number
from hsp_control.geometry.scene import Start
from hsp_control.null_space.differences import gradient
from hsp_control.null_space.fields import Clearance, ObstacleClearance, SelfClearance
from hsp_control.null_space.fields.clearance import ObstacleOrName
from hsp_control.robot import RobotState

_STEP = 3e-4
"""Step of the differences of efforts along the motion [s]: rounding and truncation
errors are equal near 1e-7."""
_SPAN = 3e-3
"""Step of those of a barrier's values [s]. The curvature of a capsule jumps where its
side ends, and so would efforts: this far ahead and behind makes a ramp of it, at an
error of a hundredth of a m/s² at 2 m/s, 0.1 m away."""
_TURN = 1e-4
"""How far joints turn to see what an acceleration does to distances [rad]."""
_SLOPE = 1e-5
"""Step of the central differences of gravity [rad or m]: they err by 1e-10 of it."""
_AHEAD = 0.5
"""A pair gets a row if its distance may come close to the minimum within this time [s]
at its present rate."""
_NEAR = 0.5
"""A motor gets one if gravity takes more than this part of what it may take, now or
within the time `_AHEAD` at the present rate."""


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

    It may override `gradients`, which uses differences. h depends on q and t only. Its
    unit should be one in which it is about as large as a distance in metres: where
    limits contradict each other, their violations are compared. `rows` and
    `check_start` are for placed ones.
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
        """Return the barrier with values for what is relative to the start, checked.

        Raises:
            LimitError: If h is not one or more finite numbers, or ∇h has another shape.
        """
        state = start.state
        needed = len(self._numbers(state)), state.robot.nv
        if (shape := np.shape(self.gradients(state.read_only))) != needed:
            raise LimitError(
                f"{type(self).__name__} has gradients of shape {shape}; needs {needed}"
            )
        return self

    def rows(
        self, state: RobotState, bandwidth: float, wanted: Array
    ) -> tuple[Array, Array]:
        """Return the rows A a ≥ b, (k, nv) and (k,).

        Args:
            state: The state.
            bandwidth: α [1/s].
            wanted: The acceleration without them, shape (nv,): it may tell which count.
        """
        _, _, least = self._least_acceleration(state, bandwidth)
        return self.gradients(state.read_only), least

    def check_start(self, state: RobotState) -> None:
        """Check that none starts below the minimum."""
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

    def _least_acceleration(
        self, state: RobotState, bandwidth: float
    ) -> tuple[Array, Array, Array]:
        """Return h, h', and the least ∇h·a, shape (k,) each."""
        h = self._numbers(state)
        ahead = self._numbers(state.ahead(_SPAN))
        behind = self._numbers(state.ahead(-_SPAN))
        rate = (ahead - behind) / (2.0 * _SPAN)
        drift = (ahead - 2.0 * h + behind) / _SPAN**2
        left = h - self.minimum
        return h, rate, -drift - 2.0 * bandwidth * rate - bandwidth**2 * left


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
        """The field that knows the pairs of shapes."""

    def values(self, state: RobotState) -> Array:
        """Return the distances, shape (k,) [m]; the next call overwrites them."""
        return self.clearance.proximity(state).measure(state)

    def _numbers(self, state: RobotState) -> Array:
        return self.values(state).copy()

    def placed(self, start: Start) -> Self:
        """Return the distances with obstacles instead of their names, checked."""
        self.clearance.proximity(start.state)
        return self

    def rows(
        self, state: RobotState, bandwidth: float, wanted: Array
    ) -> tuple[Array, Array]:
        """Return the rows of pairs close or approaching; see `Barrier.rows`.

        Others have one as soon as the wanted acceleration takes half of what b leaves:
        an effort with a limited rate could not follow a row that is violated where it
        appears.
        """
        d, rate, b = self._least_acceleration(state, bandwidth)
        near = d - self.minimum + _AHEAD * np.minimum(rate, 0.0) < 2.0 / bandwidth
        # no joint moves a point by more than the robot's size for each radian
        most = float(np.sqrt(len(wanted) * (wanted @ wanted)))
        if np.where(near, -np.inf, b).max() > -2.0 * state.robot.size * most:
            step = _TURN / max(most, 1.0)
            turned = self._numbers(state.displaced(0.0, step * wanted))
            near |= (turned - d) / step < 0.5 * b
        chosen = np.flatnonzero(near)
        return self.clearance.proximity(state).gradients(state, chosen), b[chosen]

    def check_start(self, state: RobotState) -> None:
        """Check that no pair starts closer than the minimum distance."""
        distance, pair = self.clearance.proximity(state).nearest(state)
        if distance < self.minimum:
            raise LimitError(
                f"the start is outside the limits: {pair} are {distance:.4g} m apart, "
                f"must be at least {self.minimum:g} m"
            )


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
        """The field that knows the pairs of shapes."""
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
        """The field that knows the pairs of shapes."""
        return SelfClearance()


@dataclass(frozen=True, eq=False)
class StaticEffort:
    """Gravity takes at most a part of every motor's effort.

    Else an arm reaches postures in which its motors cannot hold it, and falls. A
    motor's gravity effort, G_i(q), depends on the posture only, so this is a limit on
    postures: with h = share - |G_i|/effort_i, the rows require h'' + 2α h' + α² h ≥ 0,
    with G_i'' = ∇G_i·a + the drift of G_i' at constant velocity. With mimic joints,
    of which Pinocchio has no ∇G, it is taken by central differences.

    Attributes:
        effort: Maximum effort, shape (nv,) [N·m or N]; inf where unlimited.
        share: The part of it that gravity may take, in (0, 1].
    """

    effort: Array
    share: float

    def rows(
        self, state: RobotState, bandwidth: float, excluded: Indices
    ) -> tuple[Array, Array]:
        """Return the rows A a ≥ b, (k, nv) and (k,), of the motors near their limit.

        Efforts of ``excluded`` dofs, from root to contact, depend on contact forces.
        """
        robot, model = state.robot, state.robot.model
        data = state.cached(self, "data", model.createData)

        def gravity(step: Array) -> Array:
            """Return G(q ⊕ step), shape (nv,)."""
            q = pin.integrate(model, state.q, step) if step.any() else state.q
            return np.array(pin.computeGeneralizedGravity(model, data, q))

        if robot.mimics:
            steps = _SLOPE * np.eye(robot.nv)
            differences = [gravity(step) - gravity(-step) for step in steps]
            slope = np.array(differences).T / (2.0 * _SLOPE)
        else:
            slope = pin.computeGeneralizedGravityDerivatives(model, data, state.q)
        forth = _STEP * state.v
        G, ahead, behind = gravity(0.0 * forth), gravity(forth), gravity(-forth)
        rate = slope @ state.v
        sign = np.where(G < 0.0, -1.0, 1.0)
        used, growth = sign * G / self.effort, sign * rate / self.effort
        soon = used + _AHEAD * np.maximum(growth, 0.0)
        near = np.isfinite(self.effort) & (soon > _NEAR * self.share)
        near[[*robot.unactuated, *excluded]] = False
        i = np.flatnonzero(near)
        side = (sign / self.effort)[i]
        drift = side * (ahead - 2.0 * G + behind)[i] / _STEP**2
        b = drift + 2.0 * bandwidth * growth[i] - bandwidth**2 * (self.share - used[i])
        return -side[:, None] * slope[i], b
