"""The abstract cost of small distances between shapes."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SceneError
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration.quantities import Positive
from hsp_control.geometry import Proximity, Proxy
from hsp_control.geometry.start import Start
from hsp_control.law import FieldSample, MetricSample
from hsp_control.null_space.differences import rate_along_flow
from hsp_control.null_space.fields.barrier import barrier
from hsp_control.null_space.fields.cost import Cost, descend
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

    A subclass implements `_pairs`.
    """

    _: KW_ONLY
    influence: Positive
    """Distance at which the cost begins [m]."""
    proxy: Proxy = "capsules"
    """Shapes that approximate the links [-]. With capsules or spheres g' is exact, but
    for meshes, clouds and height fields as obstacles: there, and with hulls or meshes
    for links, the nearest features jump. Of random states g' was off by more than 1e-3
    in 1 of 60 against meshes, 9 against clouds, 17 against height fields, and with
    hulls in 10 to 33, at worst by 1.6 times itself."""

    @abstractmethod
    def _pairs(self, robot: Robot) -> Proximity:
        """Return new memory for the pairs of shapes and their distances."""

    def placed(self, start: Start) -> Self:
        """Return the cost with obstacles instead of their names, checked.

        Raises:
            SceneError: If the scene has no such obstacle, or the robot starts in
                contact: a barrier cannot resolve a contact.
            FieldError: If there is no pair, or a link has no geometry.
        """
        fitted = self.fitted(start)
        distance, pair = fitted.proximity(start.state).nearest(start.state)
        if start.known and distance <= 0.0:
            raise SceneError(
                f"the robot starts in contact: {pair}, {-distance:.3g} m deep; "
                "change the start, for example to start: auto, or move the obstacle"
            )
        return fitted

    def fitted(self, start: Start) -> Self:
        """Return what `placed` returns, also if the robot starts in contact."""
        return self

    def proximity(self, state: RobotState) -> Proximity:
        """Return the pairs of shapes and their distances, for this state only.

        It belongs to the state, and is the same one every time: what it measured
        changes with its next `Proximity.measure`.
        """
        return self._work(state).proximity

    def minimum_distance(self, state: RobotState) -> float:
        """Return the minimum distance of all pairs [m]."""
        return self.proximity(state).nearest(state)[0]

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return the step plan; see `NullSpaceField.compile`."""
        work = self._work(state)
        closed_form, coal = work.proximity.closed_form, work.proximity.coal
        if closed_form is None or coal is not None:
            return super().compile(state, metric, form, out)
        follow, measure = closed_form.compile(state, work.proximity.distances)
        derivatives = closed_form.derivatives(state, work.slopes, work.curvatures, *out)
        to_field = bind(descend, metric.L, metric.W_dot, form, *out)
        return StepPlan(follow, (*measure, work.barrier, derivatives, to_field))

    def value(self, state: RobotState) -> float:
        """Return f."""
        work = self._work(state)
        work.proximity.measure(state)
        return float(work.barrier())

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f = Σ ∂f/∂d_k ∇d_k, shape (nv,)."""
        self.value(state)
        work = self._work(state)
        return work.proximity.gradient(state, work.slopes)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)', shape (nv,); exactly zero beyond the influence."""
        gradient, rate = np.zeros((2, state.robot.nv))
        Clearance.differentiate(self, state, gradient, rate)
        return rate

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)', shape (nv,) each; see `Cost.differentiate`."""
        self.value(state)
        proximity, slopes, curvatures, _ = self._work(state)
        closed_form, coal = proximity.closed_form, proximity.coal
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
        coal = self.proximity(state).coal
        assert coal is not None
        distances = np.full(len(self.proximity(state).pairs), np.inf)
        slopes, curvatures = np.zeros((2, len(distances)))
        coal.measure(state, distances)
        barrier(distances, self.influence, slopes, curvatures)
        gradient = np.zeros(state.robot.nv)
        coal.add_gradient(state, slopes, gradient)
        return gradient

    def _work(self, state: RobotState) -> "_Work":
        """Return the memory that the state keeps for the field."""

        def make() -> _Work:
            proximity = self._pairs(state.robot)
            slopes, curvatures = np.zeros((2, len(proximity.pairs)))
            arguments = proximity.distances, self.influence, slopes, curvatures
            return _Work(proximity, slopes, curvatures, bind(barrier, *arguments))

        return state.made(self, "proximity", make)


class _Work(NamedTuple):
    """What a clearance computes with at one state."""

    proximity: Proximity  # the pairs of shapes and their distances
    slopes: Array  # ∂f/∂d of each pair, written by ``barrier``
    curvatures: Array  # ∂²f/∂d² of each pair, written by ``barrier``
    barrier: Callable[[], float]
