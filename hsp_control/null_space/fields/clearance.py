"""Costs of the distance of links to moving obstacles and to other links."""

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
    """f = Σ b(d_k / influence) over pairs of shapes, b the function `barrier_at`.

    f is zero where all distances d_k are at least ``influence``. The gradient comes
    from the witness points, its rate from their motion, which includes the velocity of
    the obstacles and the sliding of the points on the shapes; with points fixed to the
    shapes the rate would be wrong by up to half. The rate is exact for spheres,
    capsules, boxes, cylinders and planes; for meshes, hulls and clouds it is a central
    difference of the gradient along the flow.

    Where the nearest features are flat or parallel and slide over each other, the
    gradient of a distance jumps. Between links and obstacles it does not jump: capsules
    are used with spheres only, and spheres along the capsules with all other shapes;
    the distance of a sphere to a convex shape has a Lipschitz gradient. The null-space
    error then decays exponentially even where the rate jumps.

    Attributes:
        influence: Distance at which the cost begins [m].
        proximity: The pairs of shapes and their distances.
    """

    def __init__(self, proximity: Proximity, influence: float, name: str) -> None:
        """Set the cost.

        Args:
            proximity: The pairs of shapes and their distances.
            influence: Distance at which the cost begins > 0 [m].
            name: Name of the field in the log.

        Raises:
            FieldError: If the influence is not positive and finite.
        """
        robot = proximity.robot
        super().__init__(robot, name)
        if not 0.0 < influence < np.inf:
            raise FieldError(f"field {name!r}: influence {influence} must be positive")
        self.proximity = proximity
        self.influence = float(influence)
        self._slopes = np.zeros(len(proximity.pairs))
        self._curvatures = np.zeros(len(proximity.pairs))
        self._barrier = bind(
            barrier, proximity.distances, self.influence, self._slopes, self._curvatures
        )
        self._own = np.zeros(robot.nv), np.zeros(robot.nv)

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return the step plan; see `NullSpaceField.compile`."""
        closed_form, distances = self.proximity.closed_form, self.proximity.distances
        if closed_form is None or self.proximity.coal is not None:
            return super().compile(state, metric, form, out)
        follow, measure = closed_form.compile(state, distances)
        arrays = self._slopes, self._curvatures, *out
        derivatives = closed_form.derivatives(state, *arrays)
        to_field = bind(descend, metric.L, metric.W_dot, form, *out)
        return StepPlan(follow, (*measure, self._barrier, derivatives, to_field))

    def value(self, state: RobotState) -> float:
        """Return f."""
        self.proximity.measure(state)
        return float(self._barrier())

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f = Σ ∂f/∂d_k ∇d_k, shape (nv,)."""
        self.value(state)
        return self.proximity.gradient(state, self._slopes)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)', shape (nv,); exactly zero beyond the influence."""
        Clearance.differentiate(self, state, *self._own)
        return self._own[1].copy()

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)', shape (nv,) each; see `Cost.differentiate`."""
        self.value(state)
        closed_form, coal = self.proximity.closed_form, self.proximity.coal
        slopes, curvatures = self._slopes, self._curvatures
        if closed_form is not None:
            closed_form.differentiate(state, slopes, curvatures, gradient, rate)
        else:
            gradient.fill(0.0)
            rate.fill(0.0)
        # Beyond the influence the gradient is zero in a whole neighbourhood.
        if coal is not None and slopes[coal.places].any():
            coal.add_gradient(state, slopes, gradient)
            rate += rate_along_flow(self._coal_gradient, state)

    def _coal_gradient(self, state: RobotState) -> Array:
        """Return the gradient of the pairs without a closed form, shape (nv,)."""
        coal = self.proximity.coal
        assert coal is not None
        distances, slopes, curvatures = np.full((3, len(self._slopes)), np.inf)
        coal.measure(state, distances)
        barrier(distances, self.influence, slopes, curvatures)
        gradient = np.zeros(self.robot.nv)
        coal.add_gradient(state, slopes, gradient)
        return gradient

    def minimum_distance(self, state: RobotState) -> float:
        """Return the minimum distance of all pairs [m]."""
        return self.proximity.nearest(state)[0]


class ObstacleClearance(Clearance):
    """f = Σ b(d_k / influence) over pairs of a link's shape and an obstacle."""

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
            obstacles: The obstacles, which may move.
            influence: Distance at which the cost begins > 0 [m].
            links: Names of the links; None: all links that can move.
            proxy: The shapes by which the links are approximated. For an obstacle that
                is not a sphere, ``capsules`` are replaced by spheres along them.
            name: Name of the field in the log.

        Raises:
            FieldError: If there is no obstacle, a link has no geometry, there is no
                pair, or the influence is not positive and finite.
            SceneError: If an obstacle's mesh cannot be read.
        """
        if not obstacles:
            raise FieldError(f"field {name!r} needs at least one obstacle")
        rounded = [o for o in obstacles if o.shape.rounded]
        flat = [o for o in obstacles if not o.shape.rounded]
        flat_proxy: Proxy = "spheres" if proxy == "capsules" else proxy
        shapes: list[LinkShape] = []
        pairs: list[tuple[int, int]] = []
        ordered = [*rounded, *flat]
        chosen = [(proxy, rounded), (flat_proxy, flat)]
        blocks = [(link_shapes(robot, kind), some) for kind, some in chosen if some]
        total = sum(len(block) for block, _ in blocks)
        for block, some in blocks:
            moving = _moving_shapes(robot, block, links, name)
            for i in moving:
                pairs += [
                    (len(shapes) + i, total + ordered.index(obstacle))
                    for obstacle in some
                ]
            shapes += block
        super().__init__(Proximity(robot, shapes, ordered, pairs), influence, name)


class SelfClearance(Clearance):
    """f = Σ b(d_k / influence) over pairs of shapes of different links."""

    def __init__(
        self,
        robot: Robot,
        *,
        influence: float = 0.1,
        proxy: Proxy = "capsules",
        name: str = "self_clearance",
    ) -> None:
        """Set the cost.

        Neighbouring links and pairs that the SRDF disables do not count. Pairs that
        overlap at the robot's home configuration do not count either, because the
        approximating shapes are larger than the links.

        The gradient between two capsules jumps when they become parallel. This is rare
        in space, but not for a planar arm. With ``spheres`` it does not jump, but the
        computation takes longer.

        Args:
            robot: The robot.
            influence: Distance at which the cost begins > 0 [m].
            proxy: The shapes by which the links are approximated.
            name: Name of the field in the log.

        Raises:
            FieldError: If no pair is left, or the influence is not positive and finite.
        """
        shapes = link_shapes(robot, proxy)
        pairs = self_pairs(robot, shapes)
        proximity = Proximity(robot, shapes, (), pairs)
        home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
        apart = proximity.measure(home) > 0.0
        kept = [pair for pair, ok in zip(pairs, apart, strict=True) if ok]
        super().__init__(Proximity(robot, shapes, (), kept), influence, name)


def _moving_shapes(
    robot: Robot, shapes: Sequence[LinkShape], links: Sequence[str] | None, name: str
) -> list[int]:
    """Return the indices of the shapes of links that move and are among ``links``.

    Raises:
        FieldError: If one of ``links`` has no shape.
    """
    known = tuple(dict.fromkeys(shape.link for shape in shapes))
    for link in links or ():
        if link not in known:
            raise FieldError(
                f"field {name!r}: link {link!r} has no geometry"
                f"{did_you_mean(link, known)} (links with geometry: {listing(known)})"
            )
    return [
        i
        for i, shape in enumerate(shapes)
        if shape.joint > 0 and (links is None or shape.link in links)
    ]
