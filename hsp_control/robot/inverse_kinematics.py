"""Inverse kinematics: a configuration at which a frame has a position or a pose."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.robot.robot import Robot
from hsp_control.robot.state import RobotState

_STEPS = 200
_LONGEST = 0.5
"""Longest step of a joint [rad or m]; the linear model does not hold farther."""
_PULL = 0.2
"""Share of the way to the preferred configuration in every step."""
_CONVERGED = 1e-9
"""Error at which the target is reached [m and rad]."""
_STILL = 1e-3
"""Step in the null space at which the search ends [rad or m]."""
_HELD = 10.0
"""Weight of held frames, relative to the target's: at the nearest place it slips by 1 %
of the distance that remains."""


class Target(NamedTuple):
    """Where a frame shall be."""

    frame: str  # name of the frame
    # its placement in the world; only the position is used for three rows
    place: pin.SE3
    # 3 for its position, 6 for its pose, or the rows of its error in world axes
    rows: int | Indices


class Reached(NamedTuple):
    """A configuration that inverse kinematics found."""

    q: Array  # the configuration, shape (nq,)
    error: float  # distance from the target: the norm of e [m and rad]

    @property
    def converged(self) -> bool:
        """Whether the target is reached, to rounding."""
        return self.error <= _CONVERGED


def reach(
    robot: Robot,
    target: Target,
    q: Array,
    preferred: Array,
    lower: Array,
    upper: Array,
    held: Sequence[Target] = (),
) -> Reached:
    """Return a configuration at which a frame is at its target, or the nearest found.

    Levenberg and Marquardt's method: every step solves (Jᵀ J + λ 1) δ = Jᵀ e, with the
    error e of position and rotation vector in world axes, and a λ that falls with e. In
    the null space of J it moves towards the preferred configuration. A joint at a limit
    that would go beyond it is fixed in a step. The result depends on the arguments
    only. ``preferred``, ``lower`` and ``upper`` are displacements from neutral, (nv,).
    Frames that are ``held`` meanwhile, such as feet, have their own targets.
    """
    neutral, state, rest = robot.neutral(), RobotState(robot), np.zeros(robot.nv)
    x = np.clip(robot.difference(neutral, q), lower, upper)
    best, least = Reached(robot.integrate(neutral, x), np.inf), np.inf
    q = best.q
    for step in range(_STEPS):
        state.update(0.0, q, rest)
        e, J = _linear(state, target)
        error = size = float(np.linalg.norm(e))
        if held:
            parts = [_linear(state, each) for each in held]
            e = np.concatenate([e, *(_HELD * part for part, _ in parts)])
            J = np.concatenate([J, *(_HELD * rows for _, rows in parts)])
            size = float(np.linalg.norm(e))
        if size < least or size <= _CONVERGED:  # the last is the nearest preferred
            best, least = Reached(q, error), size
        uphill = J.T @ e
        blocked = (x <= lower) & (uphill < 0.0) | (x >= upper) & (uphill > 0.0)
        J, unit = J * ~blocked, np.eye(len(e))
        damped = J @ J.T + (1e-12 + 0.01 * min(size, 1.0) ** 2) * unit
        pull = _PULL * (1.0 - step / _STEPS) * (preferred - x)
        pull -= J.T @ np.linalg.solve(J @ J.T + 1e-10 * unit, J @ pull)
        if least <= _CONVERGED and np.abs(pull).max() < _STILL:
            break
        delta = J.T @ np.linalg.solve(damped, e) + pull
        delta *= min(1.0, _LONGEST / max(float(np.abs(delta).max()), _LONGEST))
        before, x = x, np.clip(x + delta, lower, upper)
        if robot.unactuated:  # the displacements of a base do not add up
            q = robot.integrate(q, x - before)
            x = robot.difference(neutral, q)
        else:
            q = robot.integrate(neutral, x)
    return best


def _linear(state: RobotState, target: Target) -> tuple[Array, Array]:
    """Return e and J of the selected rows, world axes: to first order J δ = e."""
    frame, rows = state.frame(target.frame), target.rows
    if isinstance(rows, int):
        rows = np.arange(rows)
    e = target.place.translation - frame.position
    if rows[-1] >= 3:
        e = np.concatenate([e, pin.log3(target.place.rotation @ frame.rotation.T)])
    return e[rows], frame.jacobian[rows]
