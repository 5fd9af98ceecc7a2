"""Gains that a period bears: those of a running loop must not make it unstable.

`check_rate` looks at a loop with its delays and compensators before it runs. Where a
change is made while it runs, the period is known, and the robot's present state; the
error of a task, x'' = -Kp x - Kv x', held for the period h, then has the transition

    x(h) = x + h x' + ½ h² x'',     x'(h) = x' + h x''.
"""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import UnstableRateError
from hsp_control.control.setup import PlannedTask, Setup
from hsp_control.declaration import within
from hsp_control.robot import RobotState
from hsp_control.tasks.compliant_task import impedance_of


def check_held(old: Setup, new: Setup, state: RobotState, period: float) -> None:
    """Check what a change of the setup makes of gains, where the robot is now."""
    before = {each.key: each.gains.target for each in old.tasks}
    for each in new.tasks:
        if not np.array_equal(each.gains.target, before.get(each.key, ())):
            _check_task(each, state, period)
    if not np.array_equal(new.gain.target, old.gain.target):
        rate = float(np.abs(np.linalg.eigvals(new.gain.target)).max())
        if rate * period >= 2.0:
            with within("gain"):
                raise UnstableRateError(
                    f"K_N = {rate:.4g} 1/s held for {period:g} s makes the loop "
                    f"unstable; needs less than {rounded_down(2.0 / period)} 1/s"
                )


def _check_task(planned: PlannedTask, state: RobotState, period: float) -> None:
    task, in_force = planned.task, planned.task.in_force()
    in_force.numbers[:] = planned.gains.target
    Kp, Kv, *_ = task.linear_feedback(state, in_force)
    compliant = impedance_of(task) is not None
    if task.order == 1:  # e' + K e = 0, with K in the place of Kp
        Kp, Kv = np.zeros_like(Kp), Kp
    if held_radius(Kp, Kv, period) < 1.0 + _ROUNDING:
        return
    least, most = _SMALLEST, 1.0
    for _ in range(50):
        scale = float(np.sqrt(least * most))
        stable = held_radius(scale**2 * Kp, scale * Kv, period) < 1.0 + _ROUNDING
        least, most = (scale, most) if stable else (least, scale)
    what = "this impedance" if compliant else "these gains"
    square, factor = rounded_down(least**2), rounded_down(least)
    advice = (
        f"at most {square} times this stiffness and {factor} times this damping"
        if compliant
        else f"at most {factor} times these rates"
    )
    with within("impedance" if compliant else "gains"):
        raise UnstableRateError(
            f"{what} of task {task.name!r}, held for {period:g} s, would make the loop "
            f"unstable where the robot is; needs {advice}"
        )


def held_radius(Kp: Array, Kv: Array, period: float) -> float:
    """Return the spectral radius of x'' = -Kp x - Kv x', held for a period."""
    one, h = np.eye(len(Kp)), period
    transition = np.block(
        [[one - 0.5 * h * h * Kp, h * one - 0.5 * h * h * Kv], [-h * Kp, one - h * Kv]]
    )
    return float(np.abs(np.linalg.eigvals(transition)).max())


def rounded_down(value: float) -> str:
    """Return a number rounded down to three digits, so that advice is safe."""
    exponent = int(np.floor(np.log10(value))) - 2
    unit = 10.0**exponent
    return f"{np.floor(value / unit + 1e-6) * unit:.10g}"


_SMALLEST = 1e-15
"""Smallest scale of gains that is tried."""
_ROUNDING = 1e-7
"""Of the radius: a double eigenvalue of 1 has an error of the root of its rounding."""
