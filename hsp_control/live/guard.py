"""Looks at every measurement before the law does."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import Limits
from hsp_control.live.hardware import Measurement
from hsp_control.live.settings import Tolerance
from hsp_control.robot import Robot


class Guard:
    """Says what is wrong with a measurement: a reason to stop, or nothing.

    Attributes:
        last: The last measurement that was a state.
    """

    def __init__(self, robot: Robot, limits: Limits | None, tolerance: Tolerance):
        """Take the limits over: the controller's, or else the robot's own."""
        self._robot, self._tolerance = robot, tolerance
        limits = Limits(robot) if limits is None else limits
        self._lower = limits.lower - tolerance.position_margin
        self._upper = limits.upper + tolerance.position_margin
        self._speed = limits.velocity * (1.0 + tolerance.velocity_margin)
        self.last: Measurement | None = None

    def news(self, found: Measurement | None) -> Measurement | None:
        """Return the measurement if it is one, and later than the last."""
        last = self.last
        if found is None or last is None:
            return found
        late = found.sequence <= last.sequence or found.t < last.t
        return None if late else found

    def no_state(self, found: Measurement) -> str | None:
        """Return why a measurement is no state of the robot, if it is none."""
        robot = self._robot
        for name, value, size in (("q", found.q, robot.nq), ("v", found.v, robot.nv)):
            if value.shape != (size,):
                return f"the state's {name} has shape {value.shape}; needs ({size},)"
            if not np.isfinite(value).all():
                where = int(np.flatnonzero(~np.isfinite(value))[0])
                return f"the state is not finite: {name}[{where}] is {value[where]}"
        if not np.isfinite(found.t):
            return f"the state's time is {found.t}"
        for start, size in robot.unit_blocks:
            norm = float(np.linalg.norm(found.q[start : start + size]))
            if abs(norm - 1.0) > 1e-6:
                return (
                    f"q[{start}:{start + size}] of the state has norm {norm:.6g}; "
                    "needs norm 1"
                )
        return None

    def breach(self, found: Measurement) -> str | None:
        """Return why to stop at a measurement that is a state, if there is a reason."""
        last, allowed = self.last, self._tolerance
        if found.halted:
            return "the robot has stopped by itself"
        if found.age > allowed.age:
            return f"the state is {found.age:.3g} s old; {allowed.age:g} s are allowed"
        if last is not None and found.sequence - last.sequence - 1 > allowed.missing:
            return (
                f"{found.sequence - last.sequence - 1} states in a row were not seen; "
                f"{allowed.missing} are allowed"
            )
        positions = self._robot.joint_positions(found.q)
        return self._outside(positions, self._lower, self._upper, "is at") or (
            self._outside(found.v, -self._speed, self._speed, "moves at")
        )

    def _outside(
        self, values: Array, lower: Array, upper: Array, verb: str
    ) -> str | None:
        outside = (values < lower) | (values > upper)
        if not outside.any():
            return None
        i = int(np.flatnonzero(outside)[0])
        return (
            f"{self._robot.dof_names[i]} {verb} {values[i]:.6g}, beyond "
            f"{lower[i]:.6g} to {upper[i]:.6g}"
        )
