"""Robots at rest, their links' shapes, and differences, for tests of clearances."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pinocchio as pin
from oracles import slope
from states import moved

from hsp_control import Cost, Robot, engine
from hsp_control.common.arrays import Array
from hsp_control.geometry import LinkShape
from hsp_control.trajectories import Lissajous


def still(robot: Robot) -> Any:
    """Return the robot's state at home, at rest."""
    return robot.state(0.0, robot.home(), np.zeros(robot.nv))


def turned(*rpy: float) -> Array:
    """Return a rotation from roll, pitch and yaw."""
    return np.asarray(pin.rpy.rpyToMatrix(*rpy))


def barrier_at(d: float, influence: float) -> tuple[float, float, float]:
    """Return b, b' and b'' at one distance."""
    slopes, curvatures = np.full(1, np.nan), np.full(1, np.nan)
    value = engine.Barrier(
        distances=np.array([d]),
        influence=influence,
        slopes=slopes,
        curvatures=curvatures,
    )()
    return float(value), float(slopes[0]), float(curvatures[0])


def outside(points: Array, first: Array, second: Array, radius: float) -> float:
    """Return the distance of the farthest point outside of a capsule."""
    along = second - first
    square = float(along @ along)
    s = (points - first) @ along / square if square > 0.0 else np.zeros(len(points))
    on_axis = first + np.clip(s, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(points - on_axis, axis=1).max()) - radius


def placed(robot: Robot, shapes: Iterable[LinkShape], q: Array) -> list[pin.SE3]:
    """Return the world placements of shapes, by plain Pinocchio."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    return [data.oMi[shape.joint] * shape.placement for shape in shapes]


def ends(shape: LinkShape) -> tuple[Array, Array, float]:
    """Return a capsule's or a ball's ends in the joint's frame, and its radius."""
    half = getattr(shape.geometry, "halfLength", 0.0) * shape.placement.rotation[:, 2]
    center = shape.placement.translation
    return center - half, center + half, float(shape.geometry.radius)


AIR = Lissajous([0.1, 0.15, 0.05], [1.0, 2.0, 1.5], center=[0.5, 0.3, 0.5])


def flowing(field: Cost, state: Any, step: float) -> Array:
    """Return the rate of a gradient by differences of sixth order along the flow."""
    robot, q, v = state.robot, state.q.copy(), state.v.copy()
    return slope(
        lambda s: field.gradient(
            moved(robot, state.t + s, robot.integrate(q, s * v), v)
        ).copy(),
        step,
    )


def agree(one: Array, other: Array) -> bool:
    """Return whether differences with two step sizes agree."""
    return bool(np.abs(one - other).max() <= 1e-8 * np.abs(other).max())
