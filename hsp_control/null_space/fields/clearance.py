"""Costs that keep links away from obstacles, and from each other."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, NamedTuple, Self
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import AfterValidator

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError, SceneError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Name, Names, OrInstance, Positive
from hsp_control.engine.plans import PartCall, PartCalls, implemented_by
from hsp_control.geometry import LinkShape, Proximity, Proxy, link_shapes, self_pairs
from hsp_control.geometry.scene import Obstacle, Start
from hsp_control.law import FieldSample, MetricSample
from hsp_control.null_space.fields.cost import Cost, descent
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.differences import rate_along_flow


class Clearance(Cost):
    """f = Σ b(d_k / influence) over pairs of shapes: a barrier around obstacles.

    b(s) is -(1 - s)² ln s, zero for s ≥ 1, and a parabola below 0.02, finite where
    shapes overlap. So f is zero where all distances d_k are at least ``influence``. The
    gradient comes from the witness points, its rate from their motion, which includes
    the velocity of the obstacles and the sliding of the points on the shapes; with
    points fixed to the shapes the rate would be wrong by up to half. The rate is exact
    for spheres, capsules, boxes, cylinders and planes; for meshes, hulls and clouds it
    is a central difference of the gradient along the flow.

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
    hulls in 10 to 39, but none against spheres; at worst by 1.6 times itself."""

    @abstractmethod
    def _pairs(self, robot: Robot) -> Proximity:
        """Return new memory for the pairs of shapes and their distances."""

    def placed(self, start: Start) -> Self:
        """Return the cost with obstacles instead of their names, checked."""
        fitted = self.fitted(start)
        distance, pair = fitted.proximity(start.state).nearest(start.state)
        if start.known and distance <= 0.0:
            raise SceneError(
                f"the robot starts in contact: {pair}, {-distance:.3g} m deep; "
                "change the start, for example to start: auto, or move the obstacle"
            )
        return fitted

    def fitted(self, start: Start) -> Self:
        """Return the result of `placed`, also if the robot starts in contact."""
        return self

    def proximity(self, state: RobotState) -> Proximity:
        """Return the pairs of shapes and their distances, for this state only."""
        return self._work(state).proximity

    def minimum_distance(self, state: RobotState) -> float:
        """Return the minimum distance of all pairs [m]."""
        return self.proximity(state).nearest(state)[0]

    def own_calls(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> PartCalls:
        """Return the calls: the engine's alone if all distances have closed forms."""
        work = self._work(state)
        closed_form, coal = work.proximity.closed_form, work.proximity.coal
        ways = "own_calls", "differentiate", "gradient_rate", "gradient"
        if (
            closed_form is None
            or coal is not None
            or implemented_by(self, *ways) != "own_calls"
        ):
            return super().own_calls(state, metric, form, out)
        return [
            *closed_form.calls(state),
            work.barrier,
            *closed_form.derivatives(state, work.slopes, work.curvatures, *out),
            descent(metric, form, out),
        ]

    def value(self, state: RobotState) -> float:
        """Return f."""
        work = self._work(state)
        work.proximity.measure(state)
        return float(work.add_barriers())

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
        """Write ∇f and (∇f)', shapes (nv,); see `Cost.differentiate`."""
        self.value(state)
        proximity, slopes, curvatures, *_ = self._work(state)
        closed_form, coal = proximity.closed_form, proximity.coal
        gradient[:] = rate[:] = 0.0
        if closed_form is not None:
            found = closed_form.differentiate(state, slopes, curvatures)
            gradient[:], rate[:] = found
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
        engine.Barrier(
            distances=distances,
            influence=self.influence,
            slopes=slopes,
            curvatures=curvatures,
        )()
        gradient = np.zeros(state.robot.nv)
        coal.add_gradient(state, slopes, gradient)
        return gradient

    def _work(self, state: RobotState) -> "_Work":
        """Return the memory that the state keeps for the field."""

        def make() -> _Work:
            proximity = self._pairs(state.robot)
            slopes, curvatures = np.zeros((2, len(proximity.pairs)))
            call = PartCall(
                engine.Barrier,
                distances=proximity.distances,
                influence=self.influence,
                slopes=slopes,
                curvatures=curvatures,
            )
            add_barriers = state.plan([call]).call()
            return _Work(proximity, slopes, curvatures, call, add_barriers)

        return state.cached(self, "proximity", make)


class _Work(NamedTuple):
    """The memory of a clearance at one state."""

    proximity: Proximity  # the pairs of shapes and their distances
    slopes: Array  # ∂f/∂d of each pair, written by ``barrier``
    curvatures: Array  # ∂²f/∂d² of each pair, written by ``barrier``
    barrier: PartCall  # f of the distances; and the same, bound
    add_barriers: Callable[[], float]


ObstacleOrName = Annotated[str | Obstacle, OrInstance(Name, Obstacle)]
"""The name of an obstacle of the scene, or in Python the obstacle itself."""


class ObstacleClearance(Clearance, type="obstacle_clearance"):
    """f = Σ b(d_k / influence) over pairs of a link's shape and an obstacle."""

    obstacles: Annotated[Sequence[ObstacleOrName], AfterValidator(tuple)] | None = None
    """Names of the obstacles, which may move; or, in Python, the obstacles themselves
    [-]; all of the scene by default."""
    _: KW_ONLY
    influence: Positive = 0.2
    links: Names | None = None
    """Names of the links [-]; all moving links by default."""
    proxy: Proxy = "capsules"
    """Shapes that approximate the links [-]; for an obstacle that is not a sphere,
    ``capsules`` are replaced by spheres along them."""

    def __post_init__(self) -> None:
        """Check that there is an obstacle."""
        if self.obstacles is not None and not self.obstacles:
            with within("obstacles"):
                raise FieldError("needs at least one obstacle")

    def fitted(self, start: Start) -> Self:
        """Return the cost with its obstacles from the scene; see `Clearance.placed`."""
        if self.obstacles is None:
            if not start.scene:
                raise FieldError("the scene has no obstacle")
            return replace(self, obstacles=tuple(start.scene.values()))
        found = []
        for k, each in enumerate(self.obstacles):
            with within("obstacles", k):
                found.append(each if isinstance(each, Obstacle) else start.scene[each])
        return replace(self, obstacles=tuple(found))

    def _pairs(self, robot: Robot) -> Proximity:
        given = dict.fromkeys(self.obstacles or ())  # each obstacle is used once
        obstacles = [each for each in given if isinstance(each, Obstacle)]
        if not obstacles or len(obstacles) < len(given):
            raise self._not_placed("obstacles")
        rounded = [o for o in obstacles if o.shape.rounded]
        flat = [o for o in obstacles if not o.shape.rounded]
        flat_proxy: Proxy = "spheres" if self.proxy == "capsules" else self.proxy
        chosen = [(self.proxy, rounded), (flat_proxy, flat)]
        blocks = [(link_shapes(robot, kind), some) for kind, some in chosen if some]
        first = sum(len(block) for block, _ in blocks)  # index of an obstacle
        shapes: list[LinkShape] = []
        pairs: list[tuple[int, int]] = []
        for block, some in blocks:
            pairs += [
                (len(shapes) + i, first + k)
                for i in _moving_shapes(block, self.links)
                for k in range(len(some))
            ]
            shapes += block
            first += len(some)
        return Proximity(robot, shapes, [*rounded, *flat], pairs)


def _moving_shapes(
    shapes: Sequence[LinkShape], links: Sequence[str] | None
) -> list[int]:
    """Return the indices of the shapes of links that move and are among ``links``."""
    known = tuple(dict.fromkeys(shape.link for shape in shapes))
    for k, link in enumerate(links or ()):
        if link not in known:
            with within("links", k):
                raise FieldError(
                    f"link {link!r} has no geometry{did_you_mean(link, known)} "
                    f"(links with geometry: {listing(known)})"
                )
    return [
        i
        for i, shape in enumerate(shapes)
        if shape.joint > 0 and (links is None or shape.link in links)
    ]


class SelfClearance(Clearance, type="self_clearance"):
    """f = Σ b(d_k / influence) over pairs of shapes of different links.

    Neighbouring links and pairs that the SRDF disables are ignored. So are pairs that
    overlap at the robot's home configuration, because the approximating shapes are
    larger than the links.

    The gradient between two capsules jumps when they become parallel. This is rare in
    space, but not for a planar arm. With ``spheres`` it does not jump, but the
    computation is slower.
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
    """Return the pairs of link shapes that do not overlap at home; cached."""
    known = _found.setdefault(robot, {})
    if proxy not in known:
        shapes = link_shapes(robot, proxy)
        pairs = self_pairs(robot, shapes)
        home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
        apart = Proximity(robot, shapes, (), pairs).measure(home) > 0.0
        known[proxy] = tuple(pair for pair, ok in zip(pairs, apart, strict=True) if ok)
    return known[proxy]
