"""Fields: g and g' against independent differences, in every metric, on every kind.

A cost is written a second time with plain Pinocchio; g = -W⁻¹∇f of that, by differences
of eighth order, is what the field must give. g' is compared with differences of the
field along the flow (q ⊕ s v, t + s), which hold whatever the cost.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsp_control import (
    ConstantMetric,
    Cost,
    EqualJointAngles,
    FunctionCost,
    FunctionField,
    HspControlError,
    IdentityMetric,
    JointCentering,
    MassMatrixMetric,
    Metric,
    NullSpaceField,
    Obstacle,
    PointDistance,
    Rest,
    Robot,
    RobotState,
    TargetPosture,
    Uncontrolled,
    VectorField,
    WeightedSum,
)
from hsp_control.common.exceptions import (
    FieldError,
    FrameNotFoundError,
    JointNotFoundError,
    ShapeError,
)
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space import differences
from hsp_control.null_space.fields import (
    FieldSample,
    InverseCondition,
    LimitBarrier,
    Manipulability,
    Ramp,
    StateWeight,
    Transmission,
)
from hsp_control.null_space.metrics import MetricSample
from hsp_control.trajectories import Hold, Lissajous

pytestmark = pytest.mark.filterwarnings("error")
Array = NDArray[np.float64]

TIME = 0.8  # [s]
ROBOTS: dict[str, tuple[str, str | None]] = {
    "planar3r": ("planar3r", None),  # three continuous joints
    "panda": ("panda", None),
    "kinova": ("kinova", None),  # three continuous joints among six
    "floating ur5": ("ur5", "free_flyer"),
    "rolling ur5": ("ur5", "planar"),
}
FRAMES = {
    "planar3r": ("link2", "link3", "tip"),
    "panda": ("panda_link4", "panda_hand", "panda_tcp"),
    "kinova": ("j2s6s200_link_3", "j2s6s200_link_5", "j2s6s200_end_effector"),
    "ur5": ("forearm_link", "wrist_2_link", "tool0"),
}
JOINTS = {
    "planar3r": ("joint2", "joint3"),
    "panda": ("panda_joint3", "panda_joint1", "panda_joint5"),
    "kinova": ("j2s6s200_joint_1", "j2s6s200_joint_4", "j2s6s200_joint_6"),
    "ur5": ("shoulder_pan_joint", "elbow_joint"),
}
OBSTACLE = Obstacle(
    "ball", Sphere(0.1), Lissajous([1.4, 1.2, 0.9], [0.2, 0.3, 0.1], [1.3, 2.1, 0.7])
)


@cache
def load(name: str) -> Robot:
    """Return a robot, or skip if example-robot-data is asked for and not there."""
    source, root = ROBOTS[name]
    if source not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    return Robot.load(source, root=root)  # type: ignore[arg-type]


def spread(size: int, low: float, high: float) -> Array:
    """Return different numbers, to be weights or targets."""
    return low + (high - low) * (0.5 + 0.5 * np.sin(1.0 + 2.3 * np.arange(size)))


# --- what is known without the package -----------------------------------------------

NODES = np.arange(-4, 5)
EIGHTH_ORDER = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840


def derivative(function: Callable[[float], Any], step: float) -> Any:
    """Return f'(0) by differences of eighth order."""
    values = [np.array(function(s), dtype=float) for s in NODES * step]
    return np.tensordot(EIGHTH_ORDER, values, 1) / step


class Plain:
    """Kinematics and dynamics by plain Pinocchio."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model = robot.model
        self.data = robot.model.createData()

    def position(self, q: Array, frame: str) -> Array:
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.model.getFrameId(frame)].translation.copy()

    def moved(self, q: Array, displacement: Array) -> Array:
        return pin.integrate(self.model, q, displacement)

    def angles(self, q: Array) -> Array:
        """Return joint angles by name of one freedom, nan for a root's."""
        result = np.full(self.model.nv, np.nan)
        for joint in list(self.model.joints)[1:]:
            if joint.nv == 1:
                place = q[joint.idx_q : joint.idx_q + joint.nq]
                result[joint.idx_v] = (
                    place[0] if joint.nq == 1 else np.arctan2(place[1], place[0])
                )
        return result

    def mass_matrix(self, q: Array) -> Array:
        upper = np.triu(pin.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T

    def gradient(
        self,
        f: Callable[[float, Array], float],
        t: float,
        q: Array,
        step: float = 0.005,
    ) -> Array:
        return np.array(
            [
                derivative(lambda s, d=d: f(t, self.moved(q, s * d)), step)
                for d in np.eye(self.model.nv)
            ]
        )


@cache
def plain(name: str) -> Plain:
    return Plain(load(name))


# --- the members ---------------------------------------------------------------------

CostOracle = Callable[[float, Array], float]
VectorOracle = Callable[[float, Array], Array]


@dataclass(frozen=True)
class Member:
    """A field, and the same once more with plain Pinocchio.

    Attributes:
        build: The field on a robot.
        parts: (weight, oracle, whether a cost) of each term; a vector field's is g,
            and a weight may be a function of (t, q).
        rate_accuracy: Largest error of g', relative to its scale: rounding where it is
            known in closed form, 2e-11 by differences, and by differences of a
            differenced gradient 1e-9, the promise of `Cost`.
    """

    build: Callable[[str], NullSpaceField]
    parts: Callable[[str], list[tuple[Any, Any, bool]]]
    rate_accuracy: float = 5e-12
    robots: tuple[str, ...] = tuple(ROBOTS)


def frames_of(name: str) -> tuple[str, ...]:
    return FRAMES[ROBOTS[name][0]]


def centering_oracle(name: str, weights: Any = 1.0) -> CostOracle:
    model = load(name).model
    terms = []
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            low = model.lowerPositionLimit[joint.idx_q]
            high = model.upperPositionLimit[joint.idx_q]
            w = np.broadcast_to(weights, model.nv)[joint.idx_v]
            terms.append((joint.idx_q, 0.5 * (low + high), 0.5 * (high - low), w))
    return lambda t, q: sum(0.5 * w * ((q[i] - m) / r) ** 2 for i, m, r, w in terms)


def target(name: str) -> Array:
    robot = load(name)
    return robot.integrate(robot.neutral(), spread(robot.nv, -0.7, 0.9))


def posture_oracle(name: str, weights: Any = 1.0) -> CostOracle:
    model, goal = load(name).model, plain(name).angles(target(name))

    def f(t: float, q: Array) -> float:
        total = 0.0
        for joint in list(model.joints)[1:]:
            if joint.nv == 1:
                d = plain(name).angles(q)[joint.idx_v] - goal[joint.idx_v]
                w = np.broadcast_to(weights, model.nv)[joint.idx_v]
                total += w * (1.0 - np.cos(d) if joint.nq == 2 else 0.5 * d * d)
        return total

    return f


def equal_oracle(name: str, weight: float) -> CostOracle:
    robot = load(name)
    indices = [robot.velocity_index(j).start for j in JOINTS[ROBOTS[name][0]]]

    def f(t: float, q: Array) -> float:
        d = np.diff(plain(name).angles(q)[indices])
        return float(weight * (np.arctan2(np.sin(d), np.cos(d)) ** 2).sum())

    return f


def distance_oracle(name: str, weight: float) -> CostOracle:
    def f(t: float, q: Array) -> float:
        c = np.array([1.4, 1.2, 0.9]) + np.array([0.2, 0.3, 0.1]) * np.sin(
            np.array([1.3, 2.1, 0.7]) * t
        )
        away = [plain(name).position(q, frame) - c for frame in frames_of(name)[:2]]
        return float(sum(weight / (r @ r) for r in away))

    return f


GOAL = np.array([0.4, -0.3, 0.6])


def reach(t: float, x: Array) -> float:
    """Return a cost that no closed form is written for: nonlinear in x and in t."""
    away = x - GOAL
    growth = np.exp(0.3 * np.sin(t))
    return float(np.sin(2.0 * t + 0.2 * x[0] * x[1]) + 0.5 * growth * away @ away)


def reach_slope(t: float, x: Array) -> Array:
    """Return ∂reach/∂x."""
    c = 0.2 * np.cos(2.0 * t + 0.2 * x[0] * x[1])
    return np.array([c * x[1], c * x[0], 0.0]) + (x - GOAL) * np.exp(0.3 * np.sin(t))


def reach_slope_rate(t: float, x: Array, x_dot: Array) -> Array:
    """Return the total derivative of `reach_slope`."""
    angle = 2.0 * t + 0.2 * x[0] * x[1]
    c, s = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
    angle_dot = 2.0 + 0.2 * (x_dot[0] * x[1] + x[0] * x_dot[1])
    growth = np.exp(0.3 * np.sin(t))
    bent = np.array([c * x_dot[1], c * x_dot[0], 0.0])
    bent -= s * angle_dot * np.array([x[1], x[0], 0.0])
    return bent + growth * (x_dot + 0.3 * np.cos(t) * (x - GOAL))


def reach_value(frame: str) -> Callable[[RobotState], float]:
    return lambda state: reach(state.t, state.position(frame))


def reach_gradient(frame: str) -> Callable[[RobotState], Array]:
    def gradient(state: RobotState) -> Array:
        J = state.frame(frame).jacobian[:3]
        return J.T @ reach_slope(state.t, state.position(frame))

    return gradient


def reach_rate(frame: str) -> Callable[[RobotState], Array]:
    def rate(state: RobotState) -> Array:
        at = state.frame(frame)
        J, J_dot, x_dot = at.jacobian[:3], at.jacobian_dot[:3], at.velocity[:3]
        slope = reach_slope(state.t, at.position)
        return J_dot.T @ slope + J.T @ reach_slope_rate(state.t, at.position, x_dot)

    return rate


def reach_oracle(name: str) -> CostOracle:
    return lambda t, q: reach(t, plain(name).position(q, frames_of(name)[2]))


def reach_cost(
    name: str, *, gradient: bool = False, rate: bool = False
) -> FunctionCost:
    frame = frames_of(name)[2]
    return FunctionCost(
        load(name),
        reach_value(frame),
        gradient=reach_gradient(frame) if gradient else None,
        gradient_rate=reach_rate(frame) if rate else None,
    )


class ValueOnly(Cost):
    """What a user writes first."""

    def __init__(self, robot: Robot, frame: str) -> None:
        super().__init__(robot, "value_only")
        self.frame = frame

    def value(self, state: RobotState) -> float:
        return reach(state.t, state.position(self.frame))


class WithGradient(ValueOnly):
    """What a user writes next."""

    def gradient(self, state: RobotState) -> Array:
        return reach_gradient(self.frame)(state)


class Swirl(VectorField):
    """A user's own vector field, which is no gradient."""

    def __init__(self, robot: Robot, frame: str) -> None:
        super().__init__(robot, "swirl")
        self.frame = frame

    def vector(self, state: RobotState) -> Array:
        return swirl(state.t, state.position(self.frame), self.robot.nv)


class SwirlWithRate(Swirl):
    """The same with its rate in closed form."""

    def rate(self, state: RobotState) -> Array:
        at = state.frame(self.frame)
        return swirl_rate(state.t, at.position, at.velocity[:3], self.robot.nv)


def swirl(t: float, x: Array, nv: int) -> Array:
    i = np.arange(nv) / nv
    return np.sin(t + i * x[1]) + x[0] * np.cos(i - 2.0 * t)


def swirl_rate(t: float, x: Array, x_dot: Array, nv: int) -> Array:
    i = np.arange(nv) / nv
    turned = np.cos(t + i * x[1]) * (1.0 + i * x_dot[1])
    return turned + x_dot[0] * np.cos(i - 2.0 * t) + 2.0 * x[0] * np.sin(i - 2.0 * t)


def swirl_oracle(name: str) -> VectorOracle:
    nv = load(name).nv
    return lambda t, q: swirl(t, plain(name).position(q, frames_of(name)[2]), nv)


def swirl_field(name: str, *, rate: bool) -> FunctionField:
    robot, frame = load(name), frames_of(name)[2]

    def exact(state: RobotState) -> Array:
        at = state.frame(frame)
        return swirl_rate(state.t, at.position, at.velocity[:3], robot.nv)

    return FunctionField(
        robot,
        lambda state: swirl(state.t, state.position(frame), robot.nv),
        rate=exact if rate else None,
    )


def point_distance(name: str, weight: float = 0.4) -> PointDistance:
    return PointDistance(load(name), frames_of(name)[:2], OBSTACLE, weight=weight)


def rows_of(name: str, q: Array, frame: str, rows: list[int]) -> Array:
    """Return rows of a frame's Jacobian, in world axes, linear before angular."""
    model, data = load(name).model, plain(name).data
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return pin.computeFrameJacobian(model, data, q, model.getFrameId(frame), axes)[rows]


def position_axes(name: str) -> str:
    return "xy" if name == "planar3r" else "xyz"


def spectrum_oracle(
    name: str,
    function: Callable[[Array], float],
    rows: list[int] | None = None,
    length: float = 1.0,
    metric: Array | None = None,
) -> CostOracle:
    """Return a function of G = J W⁻¹ Jᵀ + 1e-12 I of the third frame."""
    rows = list(range(len(position_axes(name)))) if rows is None else rows
    scale = np.array([length if row > 2 else 1.0 for row in rows])[:, None]
    inverse = np.eye(load(name).nv) if metric is None else np.linalg.inv(metric)

    def f(t: float, q: Array) -> float:
        J = scale * rows_of(name, q, frames_of(name)[2], rows)
        return float(function(J @ inverse @ J.T + 1e-12 * np.eye(len(rows))))

    return f


def root_of_determinant(G: Array) -> float:
    return -float(np.sqrt(np.linalg.det(G)))


def direction(name: str) -> Array:
    u = np.array([0.6, -0.8, 0.5])[: len(position_axes(name))]
    return u / np.linalg.norm(u)


def coupling(name: str) -> Array:
    """Return a metric that couples all joints."""
    nv = load(name).nv
    A = np.eye(nv) + 0.2 * np.random.default_rng(nv).normal(size=(nv, nv))
    return A.T @ A


def barrier_oracle(name: str, zone: float) -> CostOracle:
    """Return Σ -(1 - s)² ln s of the distances to both limits, in units of the zone."""
    model = load(name).model

    def f(t: float, q: Array) -> float:
        total = 0.0
        for joint in list(model.joints)[1:]:
            if joint.nq == joint.nv == 1:
                low = model.lowerPositionLimit[joint.idx_q]
                high = model.upperPositionLimit[joint.idx_q]
                for away in (q[joint.idx_q] - low, high - q[joint.idx_q]):
                    s = away / (0.5 * zone * (high - low))
                    assert s > 0.02  # the core, which has its own test
                    total += -((1.0 - s) ** 2) * np.log(s) if s < 1.0 else 0.0
        return total

    return f


def ramp(t: float, q: Array) -> float:
    """Return the quintic from 0.5 at 0.3 s to 2 at 1.3 s."""
    s = np.clip(t - 0.3, 0.0, 1.0)
    return 0.5 + 1.5 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def state_weight(name: str) -> Callable[[float, Array], float]:
    frame = frames_of(name)[2]
    return lambda t, q: 1.5 + np.sin(t + plain(name).position(q, frame)[0])


def weighted(name: str) -> NullSpaceField:
    frame = frames_of(name)[2]
    of_state = StateWeight(lambda s: 1.5 + np.sin(s.t + s.position(frame)[0]))
    return Ramp(0.5, 2.0, start=0.3, duration=1.0) * (
        3.0 * TargetPosture(load(name), target(name)) + point_distance(name)
    ) + of_state * swirl_field(name, rate=True)


LIMITED = ("panda", "kinova", "floating ur5", "rolling ur5")
MEMBERS: dict[str, Member] = {
    "rest": Member(lambda n: Rest(load(n)), lambda n: []),
    "uncontrolled": Member(lambda n: Uncontrolled(load(n)), lambda n: []),
    "joint_centering": Member(
        lambda n: JointCentering(load(n)),
        lambda n: [(1.0, centering_oracle(n), True)],
        robots=LIMITED,
    ),
    "joint_centering, weights": Member(
        lambda n: JointCentering(load(n), weights=spread(load(n).nv, 0.0, 3.0)),
        lambda n: [(1.0, centering_oracle(n, spread(load(n).nv, 0.0, 3.0)), True)],
        robots=LIMITED,
    ),
    "target_posture": Member(
        lambda n: TargetPosture(load(n), target(n)),
        lambda n: [(1.0, posture_oracle(n), True)],
    ),
    "target_posture, weights": Member(
        lambda n: TargetPosture(load(n), target(n), weights=spread(load(n).nv, 0, 3)),
        lambda n: [(1.0, posture_oracle(n, spread(load(n).nv, 0, 3)), True)],
    ),
    "equal_joint_angles": Member(
        lambda n: EqualJointAngles(load(n), JOINTS[ROBOTS[n][0]], weight=5.0),
        lambda n: [(1.0, equal_oracle(n, 5.0), True)],
    ),
    "point_distance": Member(
        point_distance, lambda n: [(1.0, distance_oracle(n, 0.4), True)]
    ),
    "limit_barrier": Member(
        lambda n: LimitBarrier(load(n), zone=0.9),
        lambda n: [(1.0, barrier_oracle(n, 0.9), True)],
        robots=LIMITED,
    ),
    "manipulability": Member(
        lambda n: Manipulability(load(n), frames_of(n)[2], axes=position_axes(n)),
        lambda n: [(1.0, spectrum_oracle(n, root_of_determinant), True)],
    ),
    "manipulability, determinant, metric": Member(
        lambda n: Manipulability(
            load(n),
            frames_of(n)[2],
            axes=position_axes(n),
            form="determinant",
            metric=coupling(n),
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(n, lambda G: -np.linalg.det(G), metric=coupling(n)),
                True,
            )
        ],
    ),
    "manipulability, log, pose": Member(
        lambda n: Manipulability(
            load(n), frames_of(n)[2], form="log", rows="pose", length=0.5
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n, lambda G: -0.5 * np.linalg.slogdet(G)[1], list(range(6)), 0.5
                ),
                True,
            )
        ],
        robots=LIMITED,
    ),
    "manipulability, orientation": Member(
        lambda n: Manipulability(load(n), frames_of(n)[2], rows="orientation"),
        lambda n: [(1.0, spectrum_oracle(n, root_of_determinant, [3, 4, 5]), True)],
        robots=LIMITED,
    ),
    "inverse_condition": Member(
        lambda n: InverseCondition(load(n), frames_of(n)[2], axes=position_axes(n)),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n,
                    lambda G: -(len(G) ** 2) / np.trace(G) / np.trace(np.linalg.inv(G)),
                ),
                True,
            )
        ],
    ),
    "transmission, velocity": Member(
        lambda n: Transmission(
            load(n), frames_of(n)[2], 3.0 * direction(n), axes=position_axes(n)
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n,
                    lambda G: (
                        -((direction(n) @ np.linalg.inv(G) @ direction(n)) ** -0.5)
                    ),
                ),
                True,
            )
        ],
    ),
    "transmission, force": Member(
        lambda n: Transmission(
            load(n), frames_of(n)[2], direction(n), kind="force", axes=position_axes(n)
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n, lambda G: -((direction(n) @ G @ direction(n)) ** -0.5)
                ),
                True,
            )
        ],
    ),
    "function_cost": Member(
        reach_cost, lambda n: [(1.0, reach_oracle(n), True)], rate_accuracy=1e-9
    ),
    "function_cost, gradient": Member(
        lambda n: reach_cost(n, gradient=True),
        lambda n: [(1.0, reach_oracle(n), True)],
        rate_accuracy=2e-11,
    ),
    "function_cost, gradient and rate": Member(
        lambda n: reach_cost(n, gradient=True, rate=True),
        lambda n: [(1.0, reach_oracle(n), True)],
    ),
    "own cost, value only": Member(
        lambda n: ValueOnly(load(n), frames_of(n)[2]),
        lambda n: [(1.0, reach_oracle(n), True)],
        rate_accuracy=1e-9,
    ),
    "own cost, gradient": Member(
        lambda n: WithGradient(load(n), frames_of(n)[2]),
        lambda n: [(1.0, reach_oracle(n), True)],
        rate_accuracy=2e-11,
    ),
    "function_field": Member(
        lambda n: swirl_field(n, rate=False),
        lambda n: [(1.0, swirl_oracle(n), False)],
        rate_accuracy=2e-11,
    ),
    "function_field, rate": Member(
        lambda n: swirl_field(n, rate=True), lambda n: [(1.0, swirl_oracle(n), False)]
    ),
    "own vector field": Member(
        lambda n: Swirl(load(n), frames_of(n)[2]),
        lambda n: [(1.0, swirl_oracle(n), False)],
        rate_accuracy=2e-11,
    ),
    "own vector field, rate": Member(
        lambda n: SwirlWithRate(load(n), frames_of(n)[2]),
        lambda n: [(1.0, swirl_oracle(n), False)],
    ),
    "sum": Member(
        lambda n: TargetPosture(load(n), target(n)) + point_distance(n),
        lambda n: [
            (1.0, posture_oracle(n), True),
            (1.0, distance_oracle(n, 0.4), True),
        ],
    ),
    "sum of a sum and a vector field": Member(
        lambda n: (
            0.5 * (3.0 * TargetPosture(load(n), target(n)) + 2 * point_distance(n))
            + 0.7 * swirl_field(n, rate=False)
            + Rest(load(n))
        ),
        lambda n: [
            (1.5, posture_oracle(n), True),
            (1.0, distance_oracle(n, 0.4), True),
            (0.7, swirl_oracle(n), False),
        ],
        rate_accuracy=2e-11,
    ),
    "sum, weights of time and of the state": Member(
        weighted,
        lambda n: [
            (lambda t, q: 3.0 * ramp(t, q), posture_oracle(n), True),
            (ramp, distance_oracle(n, 0.4), True),
            (state_weight(n), swirl_oracle(n), False),
        ],
        rate_accuracy=2e-11,
    ),
}
every_field = pytest.mark.parametrize(
    ("name", "which"),
    [(name, which) for which, m in MEMBERS.items() for name in m.robots],
)


def metrics(robot: Robot) -> dict[str, tuple[Metric, Callable[[Array], Array]]]:
    """Return the three metrics, each with W(q) by plain Pinocchio."""
    rng = np.random.default_rng(5)
    A = np.eye(robot.nv) + 0.3 * rng.normal(size=(robot.nv, robot.nv))
    return {
        "identity": (IdentityMetric(), lambda q: np.eye(robot.nv)),
        "constant": (ConstantMetric(A.T @ A), lambda q: A.T @ A),
        "mass matrix": (MassMatrixMetric(), Plain(robot).mass_matrix),
    }


def evaluate(field: NullSpaceField, metric: Metric, state: RobotState) -> FieldSample:
    """Return g and g' at a state, in memory of their own."""
    nv = state.robot.nv
    sample = metric.evaluate(state, MetricSample.allocate(nv))
    out = FieldSample(np.full(nv, np.nan), np.full(nv, np.nan))
    assert field.evaluate(state, sample, metric.form, out) is out
    return out


def draw(name: str, seed: int) -> tuple[Array, Array]:
    """Return a state off the kink of equal joint angles, obstacle and singularities."""
    robot, rng = load(name), np.random.default_rng(seed)
    indices = [robot.velocity_index(j).start for j in JOINTS[ROBOTS[name][0]]]
    for _ in range(200):
        q = robot.random_configuration(rng)
        d = np.diff(plain(name).angles(q)[indices])
        clear = np.abs(np.arctan2(np.sin(d), np.cos(d))).max() < 2.5
        J = rows_of(name, q, frames_of(name)[2], list(range(6)))
        kept = J[: len(position_axes(name))] if name == "planar3r" else J
        clear = clear and np.linalg.svd(kept)[1][-1] > 0.1
        if clear and distance_oracle(name, 1.0)(TIME, q) < 20.0:
            return q, 0.7 * rng.normal(size=robot.nv)
    raise AssertionError("no such configuration")


@every_field
def test_value(name: str, which: str) -> None:
    """The value is the cost, the sum of costs, or the vector field's norm."""
    member = MEMBERS[which]
    q, v = draw(name, 1)
    field = member.build(name)
    value = field.value(load(name).state(TIME, q, v))
    expected = 0.0
    for weight, oracle, is_cost in member.parts(name):
        part = oracle(TIME, q)
        weight = weight(TIME, q) if callable(weight) else weight
        expected += weight * (part if is_cost else np.linalg.norm(part))
    assert isinstance(value, float)
    assert value == pytest.approx(expected, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("metric_name", ["identity", "constant", "mass matrix"])
@every_field
def test_field_and_its_rate(name: str, which: str, metric_name: str) -> None:
    """g = -W⁻¹∇f (or the vector itself), and g' its total derivative along the flow.

    The gradient is good to 1e-13 of f by differences of eighth order here, to 1e-12
    (`differences.gradient`) there; W⁻¹ of a mass matrix lifts either by 1e2.
    """
    member = MEMBERS[which]
    robot = load(name)
    field = member.build(name)
    metric, W = metrics(robot)[metric_name]
    q, v = draw(name, 2)
    g, g_dot = evaluate(field, metric, robot.state(TIME, q, v))

    expected, lowered = np.zeros(robot.nv), 1.0
    for weight, oracle, is_cost in member.parts(name):
        weight = weight(TIME, q) if callable(weight) else weight
        if is_cost:
            slope = plain(name).gradient(oracle, TIME, q)
            expected -= weight * np.linalg.solve(W(q), slope)
            lowered += weight * (abs(oracle(TIME, q)) + np.abs(slope).max())
        else:
            expected += weight * oracle(TIME, q)
    lift = np.linalg.norm(np.linalg.inv(W(q)), 2)
    scale = lowered * max(1.0, lift)
    np.testing.assert_allclose(g, expected, rtol=0, atol=2e-12 * scale)

    def along(s: float) -> Array:
        state = robot.state(TIME + s, plain(name).moved(q, s * v), v)
        return evaluate(field, metric, state).g

    rate = derivative(along, 0.005)
    scale = scale + np.abs(rate).max()
    np.testing.assert_allclose(g_dot, rate, rtol=0, atol=member.rate_accuracy * scale)
    if member.parts(name) and metric_name != "identity":
        assert np.abs(g_dot).max() > 1e-3  # else nothing was tested


@every_field
def test_the_field_does_not_depend_on_the_velocity(name: str, which: str) -> None:
    robot, field = load(name), MEMBERS[which].build(name)
    q, v = draw(name, 3)
    for metric, _ in metrics(robot).values():
        first = evaluate(field, metric, robot.state(TIME, q, v)).g
        second = evaluate(field, metric, robot.state(TIME, q, -2.0 * v)).g
        np.testing.assert_allclose(first, second, rtol=0, atol=0)


@every_field
def test_fields_have_no_memory(name: str, which: str) -> None:
    """The same state gives the same bits, whatever was evaluated between."""
    robot, field = load(name), MEMBERS[which].build(name)
    here, there = robot.state(TIME, *draw(name, 4)), robot.state(0.1, *draw(name, 5))
    first = evaluate(field, IdentityMetric(), here)
    evaluate(field, MassMatrixMetric(), there)
    again = evaluate(field, IdentityMetric(), here)
    np.testing.assert_array_equal(again.g, first.g)
    np.testing.assert_array_equal(again.g_dot, first.g_dot)


# --- members, one by one -------------------------------------------------------------


def test_rest_and_uncontrolled() -> None:
    robot = load("panda")
    assert Rest(robot).controls
    assert Rest(robot).name == "rest"
    assert not Uncontrolled(robot).controls
    assert Uncontrolled(robot).name == "uncontrolled"
    assert (2.0 * Rest(robot)).controls


def test_joint_centering_is_one_half_at_a_limit() -> None:
    """Each joint at a limit costs ½ w; in the middle nothing, and the slope is 0."""
    robot = load("panda")
    field = JointCentering(robot, weights=2.0)
    low, high = robot.position_limits()
    middle = robot.state(0.0, 0.5 * (low + high), np.zeros(7))
    assert field.value(middle) == pytest.approx(0.0, abs=1e-30)
    np.testing.assert_allclose(field.gradient(middle), 0.0, atol=1e-15)
    for limit in (low, high):
        assert field.value(robot.state(0.0, limit, np.zeros(7))) == pytest.approx(7.0)


def test_joint_centering_leaves_unlimited_joints_alone() -> None:
    robot = load("kinova")
    q, _ = draw("kinova", 6)
    gradient = JointCentering(robot).gradient(robot.state(0.0, q, np.zeros(robot.nv)))
    continuous = [robot.velocity_index(j).start for j in JOINTS["kinova"]]
    np.testing.assert_array_equal(gradient[continuous], 0.0)
    assert (np.delete(gradient, continuous) != 0.0).all()


def test_limit_barrier_is_zero_in_the_middle_and_finite_beyond_a_limit() -> None:
    """And smooth through its core, 2 % of the zone: slope and bend have no jump."""
    robot = load("panda")
    field = LimitBarrier(robot, zone=0.3)
    low, high = robot.position_limits()
    middle = robot.state(0.0, 0.5 * (low + high), np.ones(7))
    assert field.value(middle) == 0.0
    np.testing.assert_array_equal(field.gradient(middle), 0.0)
    zone = 0.15 * (high - low)
    outside = robot.state(0.0, high + 0.1 * zone, np.zeros(7))
    assert np.isfinite(field.value(outside))
    assert (field.gradient(outside) > 0.0).all()

    def at(s: float) -> RobotState:
        return robot.state(0.0, high - s * zone, np.ones(7))

    for edge in (0.02, 1.0):
        inner, outer = (field.gradient(at(edge + d)) for d in (-1e-7, 1e-7))
        np.testing.assert_allclose(inner, outer, rtol=1e-4, atol=1e-5)
        inner, outer = (field.gradient_rate(at(edge + d)) for d in (-1e-7, 1e-7))
        np.testing.assert_allclose(inner, outer, rtol=1e-4, atol=1e-4)


def test_target_posture_is_smooth_all_the_way_round() -> None:
    """Three turns through pi: slope and rate change by no more than their bounds.

    ∇f = w sin d has slope w, (∇f)' = w cos d v has slope w |v|: 1e-3 rad of turning
    changes them by 1e-3 of that; ½d² would jump by 2 pi w.
    """
    robot = load("planar3r")
    field = TargetPosture(robot, target("planar3r"), weights=[2.0, 3.0, 0.0])
    v, step = np.array([1.0, -1.0, 1.0]), 1e-3
    q = target("planar3r")
    slopes, rates, values = [], [], []
    for _ in range(int(6.0 * np.pi / step)):
        state = robot.state(0.0, q, v)
        slopes.append(field.gradient(state))
        rates.append(field.gradient_rate(state))
        values.append(field.value(state))
        q = robot.integrate(q, step * v)
    bound = 3.0 * step * (1 + 1e-9)
    assert np.abs(np.diff(slopes, axis=0)).max() <= bound
    assert np.abs(np.diff(rates, axis=0)).max() <= bound
    assert np.abs(np.diff(values)).max() <= 5.0 * step * (1 + 1e-9)
    assert max(values) == pytest.approx(10.0, abs=1e-5)
    # It winds: a whole turn further all is the same again.
    turn = round(2.0 * np.pi / step)
    np.testing.assert_allclose(slopes[turn], slopes[0], atol=3 * step)


def test_target_posture_agrees_with_the_square_to_fourth_order() -> None:
    robot = load("planar3r")
    field = TargetPosture(robot, robot.neutral())
    for d in (0.1, 0.05):
        q = robot.integrate(robot.neutral(), np.array([d, 0.0, 0.0]))
        value = field.value(robot.state(0.0, q, np.zeros(3)))
        assert 0.5 * d**2 - value == pytest.approx(d**4 / 24.0, rel=1e-3)


def test_target_posture_holds_limited_joints_beyond_pi() -> None:
    """A joint with limits is drawn back the way that it can go, never round."""
    pytest.importorskip("example_robot_data")
    robot = load("rolling ur5")  # joints from -2 pi to 2 pi
    shoulder = robot.velocity_index("shoulder_pan_joint").start
    moved = np.zeros(robot.nv)
    moved[shoulder] = 5.0
    state = robot.state(
        0.0, robot.integrate(robot.neutral(), moved), np.zeros(robot.nv)
    )
    gradient = TargetPosture(robot, robot.neutral()).gradient(state)
    np.testing.assert_allclose(gradient, moved, rtol=0, atol=1e-14)


def test_target_posture_leaves_a_root_alone() -> None:
    robot = load("floating ur5")
    q, v = draw("floating ur5", 7)
    field = TargetPosture(robot, robot.neutral())
    state = robot.state(0.0, q, v)
    for vector in (field.gradient(state), field.gradient_rate(state)):
        np.testing.assert_array_equal(vector[:6], 0.0)
        assert (vector[6:] != 0.0).all()


def test_point_distance_tells_its_least_distance() -> None:
    robot = load("planar3r")
    field = point_distance("planar3r")
    q, v = draw("planar3r", 8)
    c = OBSTACLE.center.sample(TIME).position
    positions = [plain("planar3r").position(q, f) for f in frames_of("planar3r")[:2]]
    least = min(np.linalg.norm(p - c) for p in positions)
    found = field.least_distance(robot.state(TIME, q, v))
    assert found == pytest.approx(least, abs=1e-14)
    assert Rest(robot).least_distance(robot.state(TIME, q, v)) is None


def test_given_derivatives_are_used() -> None:
    """A gradient or rate that is given is not differenced, and its cost not called."""
    robot = load("planar3r")
    state = robot.state(0.0, robot.neutral(), np.ones(3))

    def never(state: RobotState) -> Any:
        raise AssertionError("called")

    cost = FunctionCost(
        robot, never, gradient=lambda s: np.arange(3.0), gradient_rate=lambda s: s.v
    )
    g, g_dot = evaluate(cost, IdentityMetric(), state)
    np.testing.assert_array_equal(g, [0.0, -1.0, -2.0])
    np.testing.assert_array_equal(g_dot, [-1.0, -1.0, -1.0])
    field = FunctionField(robot, lambda s: np.arange(3.0), rate=lambda s: 2.0 * s.v)
    g, g_dot = evaluate(field, MassMatrixMetric(), state)
    np.testing.assert_array_equal(g, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(g_dot, [2.0, 2.0, 2.0])


# --- differences ---------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_accuracy_of_differences(name: str) -> None:
    """gradient: 1e-12 of f's scale; rate_along_flow: 3e-11 at 2 rad/s.

    Truncation is h⁴/30 f⁽⁵⁾ = 3e-14 f⁽⁵⁾, rounding 1.5e-16 f/h = 2e-13 f.
    """
    robot, frame = load(name), frames_of(name)[2]
    for seed in range(5):
        state = robot.state(TIME, *draw(name, 10 + seed))
        exact = reach_gradient(frame)(state)
        found = differences.gradient(reach_value(frame), state)
        scale = 1.0 + np.abs(exact).max() + abs(reach_value(frame)(state))
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12 * scale)
        exact = reach_rate(frame)(state)
        found = differences.rate_along_flow(reach_gradient(frame), state)
        scale = 1.0 + np.abs(exact).max()
        np.testing.assert_allclose(found, exact, rtol=0, atol=3e-11 * scale)


def test_differences_are_of_fourth_order(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, frame = load("panda"), "panda_tcp"
    state = robot.state(TIME, *draw("panda", 20))
    steps = np.array([0.2, 0.1, 0.05, 0.025])
    exact = reach_gradient(frame)(state), reach_rate(frame)(state)
    errors = []
    for step in steps:
        monkeypatch.setattr(differences, "GRADIENT_STEP", step)
        monkeypatch.setattr(differences, "RATE_STEP", step)
        found = (
            differences.gradient(reach_value(frame), state),
            differences.rate_along_flow(reach_gradient(frame), state),
        )
        errors.append([np.abs(a - b).max() for a, b in zip(found, exact, strict=True)])
    orders = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    np.testing.assert_allclose(orders, 4.0, atol=0.15)


def test_rate_along_flow_of_anything() -> None:
    """Numbers, matrices, a state's own arrays; time alone, at rest; fast motion too."""
    robot, frame = load("panda"), "panda_tcp"
    q, v = draw("panda", 21)
    state = robot.state(TIME, q, v)
    at = state.frame(frame)
    found = differences.rate_along_flow(lambda s: s.frame(frame).jacobian, state)
    np.testing.assert_allclose(found, at.jacobian_dot, rtol=0, atol=1e-11)
    found = differences.rate_along_flow(lambda s: s.position(frame), state)
    np.testing.assert_allclose(found, at.velocity[:3], rtol=0, atol=1e-11)
    rest = robot.state(TIME, q, np.zeros(7))
    found = differences.rate_along_flow(lambda s: np.exp(s.t), rest)
    assert found == pytest.approx(np.exp(TIME), rel=1e-11)
    assert found.shape == ()
    fast = robot.state(TIME, q, 1e4 * v)
    found = differences.rate_along_flow(lambda s: s.position(frame), fast)
    expected = fast.frame(frame).velocity[:3]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * 1e4)


def test_differences_leave_the_state_as_it_was() -> None:
    robot, frame = load("panda"), "panda_tcp"
    q, v = draw("panda", 22)
    state = robot.state(TIME, q, v)
    before = state.frame(frame).jacobian.copy(), state.mass_matrix.copy()
    differences.gradient(reach_value(frame), state)
    differences.rate_along_flow(
        lambda s: differences.gradient(reach_value(frame), s), state
    )
    np.testing.assert_array_equal(state.frame(frame).jacobian, before[0])
    np.testing.assert_array_equal(state.mass_matrix, before[1])
    np.testing.assert_array_equal(state.q, q)
    assert state.t == TIME


# --- sums ----------------------------------------------------------------------------

weights = st.floats(0.0, 1e3)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(weights, weights, weights)
def test_sums_are_linear(a: float, b: float, c: float) -> None:
    robot = load("panda")
    terms = [
        JointCentering(robot),
        TargetPosture(robot, target("panda")),
        swirl_field("panda", rate=True),
    ]
    state = robot.state(TIME, *draw("panda", 30))
    metric = metrics(robot)["constant"][0]
    samples = [evaluate(field, metric, state) for field in terms]
    found = evaluate(a * terms[0] + c * (b * terms[1] + terms[2]), metric, state)
    factors = (a, c * b, c)
    for k in range(2):
        parts = [factor * s[k] for factor, s in zip(factors, samples, strict=True)]
        size = 1.0 + sum(np.abs(part).max() for part in parts)
        np.testing.assert_allclose(found[k], sum(parts), rtol=0, atol=1e-14 * size)


def test_operators() -> None:
    robot = load("panda")
    a, b = JointCentering(robot), TargetPosture(robot, target("panda"))
    total = 2.0 * a + np.float64(3.0) * b + Rest(robot, name="still")
    assert isinstance(total, WeightedSum)
    assert [f.name for _, f in total.terms] == [
        "joint_centering",
        "target_posture",
        "still",
    ]
    state = robot.state(0.0, robot.home(), np.zeros(7))
    assert [w.sample(state) for w, _ in total.terms] == [(2, 0), (3, 0), (1, 0)]
    assert total.name == "joint_centering + target_posture + still"
    assert total.robot is robot
    assert total.controls
    twice = [w.sample(state) for w, _ in (2 * total).terms]
    assert twice == [(4, 0), (6, 0), (2, 0)]
    assert [f for _, f in WeightedSum([(0.0, a)]).terms] == [a]
    for wrong in (lambda: a + 1.0, lambda: "2" * a, lambda: None + a):  # type: ignore
        with pytest.raises(TypeError, match=r"unsupported operand|can't multiply"):
            wrong()


# --- errors --------------------------------------------------------------------------


def arm() -> Robot:
    return load("planar3r")


def used(field: NullSpaceField, metric: Metric | None = None) -> FieldSample:
    robot = field.robot
    state = robot.state(0.25, robot.neutral(), np.ones(robot.nv))
    return evaluate(field, metric or IdentityMetric(), state)


def cost(value: Any = 0.0, **options: Any) -> FunctionCost:
    """Return a cost of the planar arm whose functions return constants."""
    options = {
        key: (lambda s, given=given: given) if key != "name" else given
        for key, given in options.items()
    }
    return FunctionCost(arm(), lambda s: value, **options)


class Wrong(ValueOnly):
    """A cost whose value or gradient is what it is told."""

    def __init__(self, value: Any, gradient: Any = None) -> None:
        super().__init__(arm(), "tip")
        self.given, self.slope = value, gradient

    def value(self, state: RobotState) -> float:
        return self.given

    def gradient(self, state: RobotState) -> Array:
        return super().gradient(state) if self.slope is None else self.slope


def at_the_centre() -> PointDistance:
    tip = arm().state(0.0, arm().neutral(), np.zeros(3)).position("tip").copy()
    ball = Obstacle("ball", Sphere(0.1), Hold(tip))
    return PointDistance(arm(), ["link2", "tip"], ball, name="away")


CENTRE = (
    r"^field 'away': frame 'tip' is at the centre of obstacle 'ball', where the cost "
    r"is infinite$"
)
NINE = np.arange(6.0)
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    # construction
    "centering, no limits": (
        lambda: JointCentering(arm()),
        FieldError,
        r"^field 'joint_centering': no joint of planar3r has limits, so none has a "
        r"middle; use a target posture instead$",
    ),
    "centering, negative weight": (
        lambda: JointCentering(load("panda"), weights=-1.0, name="middle"),
        FieldError,
        r"^field 'middle': weights \[-1.0, .*\] must be finite and at least 0$",
    ),
    "centering, infinite weight": (
        lambda: JointCentering(load("panda"), weights=[1, 2, 3, np.inf, 5, 6, 7]),
        FieldError,
        r"must be finite and at least 0$",
    ),
    "centering, number of weights": (
        lambda: JointCentering(load("panda"), weights=[1.0, 2.0]),
        FieldError,
        r"^field 'joint_centering': weights have shape \(2,\); needs one number or 7$",
    ),
    "posture, shape": (
        lambda: TargetPosture(arm(), [0.0, 0.0, 0.0]),
        ShapeError,
        r"^configuration q has shape \(3,\); planar3r needs \(6,\)",
    ),
    "posture, no weight": (
        lambda: TargetPosture(arm(), arm().neutral(), weights=0.0),
        FieldError,
        r"^field 'target_posture': every weight is 0$",
    ),
    "posture, only a root weighted": (
        lambda: TargetPosture(
            load("rolling ur5"),
            load("rolling ur5").neutral(),
            weights=[1.0] * 3 + [0.0] * 6,
        ),
        FieldError,
        r"^field 'target_posture': every weight is 0$",
    ),
    "posture, nan": (
        lambda: TargetPosture(arm(), arm().neutral(), weights=np.nan),
        FieldError,
        r"weights \[nan, nan, nan\] must be finite and at least 0$",
    ),
    "equal angles, one joint": (
        lambda: EqualJointAngles(arm(), ["joint1"]),
        FieldError,
        r"^field 'equal_joint_angles' needs two joints or more: \['joint1'\]$",
    ),
    "equal angles, weight": (
        lambda: EqualJointAngles(arm(), ["joint1", "joint2"], weight=-0.1),
        FieldError,
        r"^field 'equal_joint_angles': weight -0.1 must be at least 0$",
    ),
    "equal angles, joint": (
        lambda: EqualJointAngles(arm(), ["joint1", "joint4"]),
        JointNotFoundError,
        r"^no joint 'joint4'; did you mean 'joint\d'\?",
    ),
    "equal angles, root": (
        lambda: EqualJointAngles(load("rolling ur5"), ["root_joint", "elbow_joint"]),
        FieldError,
        r"^field 'equal_joint_angles': each joint needs exactly one freedom$",
    ),
    "distance, no frame": (
        lambda: PointDistance(arm(), [], OBSTACLE),
        FieldError,
        r"^field 'point_distance' needs at least one frame$",
    ),
    "distance, frame": (
        lambda: PointDistance(arm(), ["link2", "tipp"], OBSTACLE),
        FrameNotFoundError,
        r"^no frame 'tipp'; did you mean 'tip'\?",
    ),
    "distance, weight": (
        lambda: PointDistance(arm(), ["tip"], OBSTACLE, weight=np.inf),
        FieldError,
        r"^field 'point_distance': weight inf must be at least 0$",
    ),
    "sum, empty": (
        lambda: WeightedSum([]),
        FieldError,
        r"^a sum of fields needs at least one term$",
    ),
    "sum, negative": (
        lambda: -2.0 * Rest(arm()),
        FieldError,
        r"^field 'rest': weight is -2.0; must be at least 0$",
    ),
    "sum, nan": (
        lambda: np.nan * Rest(arm()),
        FieldError,
        r"^field 'rest': weight is nan; must be at least 0$",
    ),
    "sum, uncontrolled": (
        lambda: Uncontrolled(arm()) + Rest(arm()),
        FieldError,
        r"^an uncontrolled null space cannot be part of a sum$",
    ),
    "sum, other robot": (
        lambda: Rest(arm()) + Rest(load("panda")),
        FieldError,
        r"^the fields of a sum belong to different robots$",
    ),
    "sum, other robot inside": (
        lambda: Rest(arm()) + (2.0 * Rest(load("panda"))),
        FieldError,
        r"^the fields of a sum belong to different robots$",
    ),
    "barrier, zone": (
        lambda: LimitBarrier(load("panda"), zone=1.5),
        FieldError,
        r"^field 'limit_barrier': zone 1.5 must be within \(0, 1\]$",
    ),
    "barrier, no limits": (
        lambda: LimitBarrier(arm()),
        FieldError,
        r"^field 'limit_barrier': no joint of planar3r has limits$",
    ),
    "barrier, weight": (
        lambda: LimitBarrier(load("panda"), weights=-1.0),
        FieldError,
        r"^field 'limit_barrier': weights .* must be finite and at least 0$",
    ),
    "manipulability, form": (
        lambda: Manipulability(arm(), "tip", axes="xy", form="square"),  # type: ignore
        FieldError,
        r"^field 'manipulability': form 'square'; choose determinant, root or log$",
    ),
    "manipulability, rows": (
        lambda: Manipulability(arm(), "tip", rows="all"),  # type: ignore
        FieldError,
        r"^field 'manipulability': rows 'all'; choose among \['position', ",
    ),
    "manipulability, axes": (
        lambda: Manipulability(arm(), "tip", axes="xx"),
        FieldError,
        r"^field 'manipulability': axes 'xx'; name axes among x, y, z$",
    ),
    "manipulability, length": (
        lambda: Manipulability(arm(), "tip", axes="xy", length=0.0),
        FieldError,
        r"^field 'manipulability': length 0.0 must be positive$",
    ),
    "manipulability, too many rows": (
        lambda: Manipulability(arm(), "link2", axes="xyz"),
        FieldError,
        r"^field 'manipulability': 3 rows of frame 'link2', which only 2 freedoms ",
    ),
    "manipulability, frame": (
        lambda: Manipulability(arm(), "tipp"),
        FrameNotFoundError,
        r"^no frame 'tipp'; did you mean 'tip'\?",
    ),
    "transmission, direction": (
        lambda: Transmission(arm(), "tip", [1.0, 0.0, 0.0], axes="xy"),
        FieldError,
        r"^field 'transmission': direction \[1.0, 0.0, 0.0\] needs 2 numbers, not all ",
    ),
    "transmission, kind": (
        lambda: Transmission(arm(), "tip", [1, 0], axes="xy", kind="x"),  # type: ignore
        FieldError,
        r"^field 'transmission': kind 'x'; choose velocity or force$",
    ),
    "ramp, duration": (
        lambda: Ramp(0.0, 1.0, start=0.0, duration=0.0),
        FieldError,
        r"^a ramp from 0.0 s over 0.0 s; needs a positive duration$",
    ),
    "ramp, weight": (
        lambda: Ramp(0.0, -1.0, start=0.0, duration=1.0),
        FieldError,
        r"^weight is -1.0; must be at least 0$",
    ),
    # evaluation
    "weight of the state, negative": (
        lambda: used(StateWeight(lambda s: -s.t) * Rest(arm())),
        FieldError,
        r"weight is -0.25; must be at least 0$",
    ),
    "value, nan": (
        lambda: used(cost(np.nan, name="mine")),
        FieldError,
        r"^cost 'mine' returned nan at t = 0.25 s; needs one finite number$",
    ),
    "value, infinite": (
        lambda: cost(-np.inf).value(arm().state(1.5, arm().neutral(), np.zeros(3))),
        FieldError,
        r"^cost 'function' returned -inf at t = 1.5 s; needs one finite number$",
    ),
    "value, none": (lambda: used(cost(None)), FieldError, r"returned None at t = 0.25"),
    "value, array": (
        lambda: used(cost(np.zeros(3))),
        FieldError,
        r"returned array\(\[0., 0., 0.\]\) at t = 0.25 s; needs one finite number",
    ),
    "gradient, shape of q": (
        lambda: used(cost(gradient=np.zeros(6))),
        FieldError,
        r"^cost 'function' has a gradient of shape \(6,\); needs \(3,\): the tangent "
        r"space, not the configuration$",
    ),
    "gradient, number": (
        lambda: used(cost(gradient=1.0)),
        FieldError,
        r"^cost 'function' has a gradient of shape \(\); needs \(3,\)",
    ),
    "gradient, words": (
        lambda: used(cost(gradient="steep")),
        FieldError,
        r"^cost 'function' has the gradient 'steep'; needs numbers$",
    ),
    "gradient, nan": (
        lambda: used(cost(gradient=[0.0, np.nan, 0.0])),
        FieldError,
        r"^cost 'function' has the gradient .*nan.* at t = 0.25 s; needs finite num",
    ),
    "gradient, nan, mass matrix": (
        lambda: used(cost(gradient=[0.0, np.nan, 0.0]), MassMatrixMetric()),
        FieldError,
        r"needs finite numbers$",
    ),
    "gradient rate, shape": (
        lambda: used(cost(gradient=np.zeros(3), gradient_rate=np.zeros((3, 1)))),
        FieldError,
        r"^cost 'function' has a gradient rate of shape \(3, 1\); needs \(3,\)",
    ),
    "gradient rate, number": (
        lambda: used(cost(gradient=np.zeros(3), gradient_rate=0.0)),
        FieldError,
        r"^cost 'function' has a gradient rate of shape \(\); needs \(3,\)",
    ),
    "gradient rate, infinite": (
        lambda: used(cost(gradient=np.zeros(3), gradient_rate=[0.0, np.inf, 0.0])),
        FieldError,
        r"the gradient rate .*inf.*; needs finite numbers$",
    ),
    "own cost, nan": (
        lambda: used(Wrong(np.nan)),
        FieldError,
        r"^cost 'value_only' has the gradient .*nan.*; needs finite numbers$",
    ),
    "own cost, gradient": (
        lambda: used(Wrong(0.0, np.zeros(2))),
        FieldError,
        r"^cost 'value_only' has a gradient of shape \(2,\); needs \(3,\)",
    ),
    "vector, shape": (
        lambda: used(FunctionField(arm(), lambda s: np.zeros(6))),
        FieldError,
        r"^field 'function' returned g = array\(\[0., .*\]\) at t = 0.25 s; needs 3 "
        r"finite numbers$",
    ),
    "vector, number": (
        lambda: used(FunctionField(arm(), lambda s: 1.0)),  # type: ignore
        FieldError,
        r"returned g = 1.0 at t",
    ),
    "vector, words": (
        lambda: used(FunctionField(arm(), lambda s: "fast")),  # type: ignore
        FieldError,
        r"returned g = 'fast' at t",
    ),
    "vector, nan": (
        lambda: used(FunctionField(arm(), lambda s: np.full(3, np.nan))),
        FieldError,
        r"returned g = array\(\[nan, nan, nan\]\)",
    ),
    "rate, shape": (
        lambda: used(
            FunctionField(arm(), lambda s: np.zeros(3), rate=lambda s: np.zeros(1))
        ),
        FieldError,
        r"^field 'function' returned g' = array\(\[0.\]\) at t = 0.25 s; needs 3",
    ),
    "rate, infinite": (
        lambda: used(
            FunctionField(
                arm(), lambda s: np.zeros(3), rate=lambda s: np.full(3, np.inf)
            )
        ),
        FieldError,
        r"returned g' = array\(\[inf, inf, inf\]\)",
    ),
    "in a sum": (
        lambda: used(Rest(arm()) + cost(np.nan, name="mine")),
        FieldError,
        r"^cost 'mine' returned nan",
    ),
    "distance, at the centre": (lambda: used(at_the_centre()), FieldError, CENTRE),
    "distance, at the centre, value": (
        lambda: at_the_centre().value(arm().state(0, arm().neutral(), np.zeros(3))),
        FieldError,
        CENTRE,
    ),
}


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=message) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind


def test_a_user_s_own_exception_passes() -> None:
    """What goes wrong in a user's function is told as it is."""

    def fails(state: RobotState) -> float:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match=r"^mine$"):
        used(FunctionCost(arm(), fails))


def test_arguments_are_copied() -> None:
    goal, w = target("planar3r"), np.ones(3)
    field = TargetPosture(arm(), goal, weights=w)
    state = arm().state(0.0, target("planar3r"), np.zeros(3))
    goal[:] = arm().neutral()
    w[:] = 7.0
    np.testing.assert_allclose(field.gradient(state), 0.0, atol=1e-15)
    moved = arm().state(0.0, arm().integrate(state.q, np.full(3, 0.1)), np.zeros(3))
    np.testing.assert_allclose(field.gradient(moved), np.sin(0.1), rtol=1e-12)
