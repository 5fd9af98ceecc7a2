"""Keep clear: of obstacles that may move, and of the robot's own links."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.geometry import LinkShape, Proximity, Proxy, link_shapes, self_pairs
from hsp_control.geometry.scene import Obstacle
from hsp_control.null_space.differences import rate_along_flow
from hsp_control.null_space.fields.barrier import barrier
from hsp_control.null_space.fields.cost import Cost, descend
from hsp_control.null_space.fields.field import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState


class Clearance(Cost):
    """f = Σ b(d_k) over pairs of shapes, b a barrier that is zero beyond its influence.

    The gradient comes from the witness points, its rate from their motion, which holds
    the obstacles' own velocity and the sliding of the witness points: freezing them
    would cost up to half of it. It is exact for balls, capsules, boxes, cylinders and
    planes; for meshes, hulls and clouds it is a central difference of the gradient
    along the flow.

    Where the nearest features are flat or parallel and slide over each other, the
    gradient of a distance jumps. Between links and obstacles it does not: capsules meet
    only balls, and balls along the capsules meet all other shapes; the distance of a
    ball to a convex shape has a Lipschitz gradient. The exponential law then holds
    across the rate's jumps.

    Attributes:
        influence: Distance at which the cost begins [m].
        proximity: The distances.
    """

    def __init__(self, proximity: Proximity, influence: float, name: str) -> None:
        """Set the cost.

        Raises:
            FieldError: If the influence is not a positive length.
        """
        robot = proximity.robot
        super().__init__(robot, name)
        if not 0.0 < influence < np.inf:
            raise FieldError(f"field {name!r}: influence {influence} must be positive")
        self.proximity = proximity
        self.influence = float(influence)
        self._slopes = np.zeros(len(proximity.pairs))
        self._bends = np.zeros(len(proximity.pairs))
        self._barrier = bind(
            barrier, proximity.distances, self.influence, self._slopes, self._bends
        )
        self._own = np.zeros(robot.nv), np.zeros(robot.nv)

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return what `evaluate` does; see `NullSpaceField.bind`."""
        formulas, distances = self.proximity.formulas, self.proximity.distances
        if formulas is None or self.proximity.others is not None:
            return super().compile(state, metric, form, out)
        follow, measure = formulas.compile(state, distances)
        derivatives = formulas.derivatives(state, self._slopes, self._bends, *out)
        down = bind(descend, metric.L, metric.W_dot, form, *out)
        return StepPlan(follow, (*measure, self._barrier, derivatives, down))

    def value(self, state: RobotState) -> float:
        """Return f."""
        self.proximity.measure(state)
        return float(self._barrier())

    def gradient(self, state: RobotState) -> Array:
        """Return Σ b'(d_k) ∇d_k."""
        self.value(state)
        return self.proximity.gradient(state, self._slopes)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return the gradient's rate along the flow; exactly zero out of influence."""
        Clearance.differentiate(self, state, *self._own)
        return self._own[1].copy()

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)', shape (nv,) each."""
        self.value(state)
        proximity, slopes = self.proximity, self._slopes
        if proximity.formulas is not None:
            proximity.formulas.differentiate(state, slopes, self._bends, gradient, rate)
        else:
            gradient.fill(0.0)
            rate.fill(0.0)
        others = proximity.others
        # Out of influence the gradient is zero in a whole neighbourhood.
        if others is not None and slopes[others.places].any():
            others.add_gradient(state, slopes, gradient)
            rate += rate_along_flow(self._gradient_of_others, state)

    def _gradient_of_others(self, state: RobotState) -> Array:
        """Return the gradient of the pairs that have no formula."""
        others = self.proximity.others
        assert others is not None
        distances, slopes, bends = np.full((3, len(self._slopes)), np.inf)
        others.measure(state, distances)
        barrier(distances, self.influence, slopes, bends)
        gradient = np.zeros(self.robot.nv)
        others.add_gradient(state, slopes, gradient)
        return gradient

    def least_distance(self, state: RobotState) -> float:
        """Return the least distance of all pairs [m]."""
        return self.proximity.nearest(state)[0]


class ObstacleClearance(Clearance):
    """The robot's links keep clear of obstacles."""

    def __init__(
        self,
        robot: Robot,
        obstacles: Sequence[Obstacle],
        *,
        influence: float = 0.2,
        links: Sequence[str] | None = None,
        proxy: Proxy = "capsules",
        name: str = "obstacle_clearance",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            obstacles: What to keep clear of.
            influence: Distance at which the cost begins [m].
            links: Names of the links that keep clear; None: all that can move.
            proxy: What stands for the links. ``capsules`` become balls along them
                before an obstacle that is not a ball.
            name: What the log calls it.

        Raises:
            FieldError: If there is no obstacle or no link, or the influence is none.
            SceneError: If an obstacle's mesh cannot be read.
        """
        if not obstacles:
            raise FieldError(f"field {name!r}: there is no obstacle to keep clear of")
        rounded = [o for o in obstacles if o.shape.rounded]
        flat = [o for o in obstacles if not o.shape.rounded]
        beads: Proxy = "spheres" if proxy == "capsules" else proxy
        shapes: list[LinkShape] = []
        pairs: list[tuple[int, int]] = []
        ordered = [*rounded, *flat]
        chosen = [(proxy, rounded), (beads, flat)]
        blocks = [(link_shapes(robot, kind), some) for kind, some in chosen if some]
        total = sum(len(block) for block, _ in blocks)
        for block, some in blocks:
            moving = _moving(robot, block, links, name)
            for i in moving:
                pairs += [
                    (len(shapes) + i, total + ordered.index(obstacle))
                    for obstacle in some
                ]
            shapes += block
        super().__init__(Proximity(robot, shapes, ordered, pairs), influence, name)


class SelfClearance(Clearance):
    """The robot's links keep clear of each other."""

    def __init__(
        self,
        robot: Robot,
        *,
        influence: float = 0.1,
        proxy: Proxy = "capsules",
        name: str = "self_clearance",
    ) -> None:
        """Set the cost.

        Pairs of neighbours and those that the SRDF disables are left out, and so are
        pairs that overlap at the robot's home: proxies are fatter than the links.

        The gradient between two capsules jumps at the instant that they are parallel:
        rare in space, but not for a planar arm; ``spheres`` do not, at their price.

        Args:
            robot: The robot.
            influence: Distance at which the cost begins [m].
            proxy: What stands for the links.
            name: What the log calls it.

        Raises:
            FieldError: If no pair is left, or the influence is none.
        """
        shapes = link_shapes(robot, proxy)
        pairs = self_pairs(robot, shapes)
        proximity = Proximity(robot, shapes, (), pairs)
        home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
        apart = proximity.measure(home) > 0.0
        kept = [pair for pair, ok in zip(pairs, apart, strict=True) if ok]
        super().__init__(Proximity(robot, shapes, (), kept), influence, name)


def _moving(
    robot: Robot, shapes: Sequence[LinkShape], links: Sequence[str] | None, name: str
) -> list[int]:
    known = tuple(dict.fromkeys(shape.link for shape in shapes))
    for link in links or ():
        if link not in known:
            raise FieldError(
                f"field {name!r}: link {link!r} has no geometry"
                f"{did_you_mean(link, known)} (those that have: {listing(known)})"
            )
    return [
        i
        for i, shape in enumerate(shapes)
        if shape.joint > 0 and (links is None or shape.link in links)
    ]
