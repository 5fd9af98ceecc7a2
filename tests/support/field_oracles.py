"""Robots and obstacles for fields, and each field's cost by plain Pinocchio.

A cost is implemented a second time with plain Pinocchio; the field must equal g =
-W⁻¹∇f of that, by differences of eighth order. Fields as users may write them are
between the oracles.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hsp_control import Cost, FunctionCost, Obstacle, Robot, RobotState
from hsp_control.common.arrays import Array
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import FunctionField, PointDistance, VectorField
from hsp_control.trajectories import Lissajous

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
    "ball",
    Sphere(0.1),
    Lissajous([0.2, 0.3, 0.1], [1.3, 2.1, 0.7], center=[1.4, 1.2, 0.9]),
)


def constant(g: Array, state: RobotState) -> Array:
    """Return g, the value of a constant field."""
    return g


@cache
def load(name: str) -> Robot:
    """Return a robot, or skip if it needs example-robot-data and that is missing."""
    source, root = ROBOTS[name]
    if source not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    return Robot.load(source, root=root)  # type: ignore[arg-type]


def spread(size: int, low: float, high: float) -> Array:
    """Return distinct numbers, for weights or targets."""
    return low + (high - low) * (0.5 + 0.5 * np.sin(1.0 + 2.3 * np.arange(size)))


# --- independent of the package ------------------------------------------------------


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


# --- oracles of the costs and vectors ------------------------------------------------


CostOracle = Callable[[float, Array], float]
VectorOracle = Callable[[float, Array], Array]


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


def swaying(name: str) -> Lissajous:
    """A displacement of a posture, different for every degree of freedom."""
    nv = load(name).nv
    k = np.arange(nv)
    return Lissajous(0.2 + 0.05 * k, 1.0 + 0.3 * k, 0.5 * k, np.full(nv, 0.1))


def posture_oracle(name: str, weights: Any = 1.0, *, sways: bool = False) -> CostOracle:
    model, goal = load(name).model, plain(name).angles(target(name))

    def f(t: float, q: Array) -> float:
        total = 0.0
        for joint in list(model.joints)[1:]:
            if joint.nv == 1:
                i = joint.idx_v
                d = plain(name).angles(q)[i] - goal[i]
                if sways:
                    k = float(i)
                    d -= 0.1 + (0.2 + 0.05 * k) * np.sin((1.0 + 0.3 * k) * t + 0.5 * k)
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
    """Return a cost without derivatives in closed form, nonlinear in x and t."""
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
        reach_value(frame),
        gradient_function=reach_gradient(frame) if gradient else None,
        rate_function=reach_rate(frame) if rate else None,
    )


class ValueOnly(Cost):
    """A user's first version."""

    frame: str

    def value(self, state: RobotState) -> float:
        return reach(state.t, state.position(self.frame))


class WithGradient(ValueOnly):
    """A user's second version."""

    def gradient(self, state: RobotState) -> Array:
        return reach_gradient(self.frame)(state)


class Swirl(VectorField):
    """A user's vector field, which is no gradient."""

    frame: str

    def vector(self, state: RobotState) -> Array:
        return swirl(state.t, state.position(self.frame), state.robot.nv)


class SwirlWithRate(Swirl):
    """The same with its rate in closed form."""

    def rate(self, state: RobotState) -> Array:
        at = state.frame(self.frame)
        return swirl_rate(state.t, at.position, at.velocity[:3], state.robot.nv)


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
    frame, nv = frames_of(name)[2], load(name).nv

    def exact(state: RobotState) -> Array:
        at = state.frame(frame)
        return swirl_rate(state.t, at.position, at.velocity[:3], nv)

    return FunctionField(
        lambda state: swirl(state.t, state.position(frame), nv),
        rate_function=exact if rate else None,
    )


def point_distance(name: str, weight: float = 0.4) -> PointDistance:
    return PointDistance(frames_of(name)[:2], OBSTACLE, weight=weight)


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


def coupling(name: str) -> Array:
    """Return a metric that couples all joints."""
    nv = load(name).nv
    A = np.eye(nv) + 0.2 * np.random.default_rng(nv).normal(size=(nv, nv))
    return A.T @ A


def barrier_oracle(name: str, zone: float, weights: Array) -> CostOracle:
    """Return Σ -w (1 - s)² ln s of distances to both limits, in units of the zone."""
    model = load(name).model

    def f(t: float, q: Array) -> float:
        total = 0.0
        for joint in list(model.joints)[1:]:
            if joint.nq == joint.nv == 1:
                low = model.lowerPositionLimit[joint.idx_q]
                high = model.upperPositionLimit[joint.idx_q]
                for away in (q[joint.idx_q] - low, high - q[joint.idx_q]):
                    s = away / (0.5 * zone * (high - low))
                    assert s > 0.02  # the core has its own test
                    if s < 1.0:
                        total -= weights[joint.idx_v] * (1.0 - s) ** 2 * np.log(s)
        return total

    return f


def ramp(t: float, q: Array) -> float:
    """Return the quintic from 0.5 at 0.3 s to 2 at 1.3 s."""
    s = np.clip(t - 0.3, 0.0, 1.0)
    return 0.5 + 1.5 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def state_weight(name: str) -> Callable[[float, Array], float]:
    frame = frames_of(name)[2]
    return lambda t, q: 1.5 + np.sin(t + plain(name).position(q, frame)[0])
