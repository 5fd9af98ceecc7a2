"""Inverse kinematics: a configuration at which a frame has a position or a pose."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot.robot import Robot, RobotState

_STEPS = 200
_LONGEST = 0.5
"""Longest step of a joint [rad or m]; the linear model does not hold farther."""
_PULL = 0.2
"""Share of the way to the preferred configuration that is taken in each step."""
_CONVERGED = 1e-9
"""Error at which the target is reached [m and rad]."""
_STILL = 1e-3
"""Step in the null space at which the search ends [rad or m]."""


class Target(NamedTuple):
    """Where a frame shall be."""

    frame: str  # name of the frame
    # its placement in the world; only the position counts for three rows
    place: pin.SE3
    rows: int  # 3 for its position, 6 for its pose


class Reached(NamedTuple):
    """A configuration that inverse kinematics found."""

    q: Array  # the configuration, shape (nq,)
    error: float  # distance from the target: the norm of e [m and rad]

    @property
    def converged(self) -> bool:
        """Whether the target is reached, to rounding."""
        return self.error <= _CONVERGED


def reach(
    robot: Robot, target: Target, q: Array, preferred: Array, lower: Array, upper: Array
) -> Reached:
    """Return a configuration at which a frame is at its target, or the nearest found.

    Levenberg and Marquardt's method: each step solves (Jᵀ J + λ 1) δ = Jᵀ e, with the
    error e of position and rotation vector in world axes, and a λ that falls with e. In
    the null space of J it goes towards the preferred configuration. A joint at a limit
    that would go beyond it takes no part in a step. The result depends on the arguments
    only. ``preferred``, ``lower`` and ``upper`` are displacements from neutral, (nv,).
    """
    neutral, state = robot.neutral(), RobotState(robot)
    rest, unit = np.zeros(robot.nv), np.eye(target.rows)
    x = np.clip(robot.difference(neutral, q), lower, upper)
    best = Reached(robot.integrate(neutral, x), np.inf)
    for step in range(_STEPS):
        q = robot.integrate(neutral, x)
        frame = state.update(0.0, q, rest).frame(target.frame)
        e = _error(frame.position, frame.rotation, target)
        size = float(np.linalg.norm(e))
        if size < best.error or size <= _CONVERGED:  # the last is the nearest preferred
            best = Reached(q, size)
        J = frame.jacobian[: target.rows]
        uphill = J.T @ e
        blocked = (x <= lower) & (uphill < 0.0) | (x >= upper) & (uphill > 0.0)
        J = J * ~blocked
        damped = J @ J.T + (1e-12 + 0.01 * min(size, 1.0) ** 2) * unit
        pull = _PULL * (1.0 - step / _STEPS) * (preferred - x)
        pull -= J.T @ np.linalg.solve(J @ J.T + 1e-10 * unit, J @ pull)
        if best.converged and np.abs(pull).max() < _STILL:
            break
        delta = J.T @ np.linalg.solve(damped, e) + pull
        delta *= min(1.0, _LONGEST / max(float(np.abs(delta).max()), _LONGEST))
        x = np.clip(x + delta, lower, upper)
    return best


def _error(position: Array, rotation: Array, target: Target) -> Array:
    """Return e in world axes, shape (rows,): to first order J δ = e."""
    offset = target.place.translation - position
    if target.rows == 3:
        return np.asarray(offset)
    turn = pin.log3(target.place.rotation @ rotation.T)
    return np.concatenate([offset, turn])
