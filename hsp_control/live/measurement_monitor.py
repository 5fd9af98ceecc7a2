"""Check every measurement before the controller uses it."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.live.hardware import Measurement
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot


class MeasurementMonitor:
    """Returns what is wrong with a measurement: a reason to stop, or None.

    Attributes:
        last: The last valid measurement.
    """

    def __init__(
        self, robot: Robot, limits: RobotLimits | None, settings: LiveSettings
    ) -> None:
        """Read the limits.

        Args:
            robot: The model.
            limits: The controller's limits; None: those of the robot's model.
            settings: Margins beyond the limits, greatest age and number of missing
                states.
        """
        self._robot, self._settings = robot, settings
        self._own = own_limits(robot) if limits is None else None
        self.last: Measurement | None = None
        self._read(limits)

    def follow(self, limits: RobotLimits | None) -> None:
        """Check against the controller's limits of now, which may change in a run.

        A controller without limits may receive some: then those of the robot's model
        count as well.
        """
        if limits is not self._limits:
            self._read(limits)

    def _read(self, limits: RobotLimits | None) -> None:
        self._limits, settings = limits, self._settings
        both = [each for each in (limits, self._own) if each is not None]
        lower = np.max([each.lower for each in both], axis=0)
        upper = np.min([each.upper for each in both], axis=0)
        speed = np.min([each.velocity for each in both], axis=0)
        self._lower = lower - settings.position_margin
        self._upper = upper + settings.position_margin
        self._speed = speed * (1.0 + settings.velocity_margin)

    def if_new(self, measurement: Measurement | None) -> Measurement | None:
        """Return the measurement if it is later than the last one, else None."""
        last = self.last
        if measurement is None or last is None:
            return measurement
        old = measurement.sequence <= last.sequence or measurement.t < last.t
        return None if old else measurement

    def invalid(self, measurement: Measurement) -> str | None:
        """Return why a measurement is not a valid state of the robot, or None.

        Checks shapes, finite numbers and unit quaternions.
        """
        robot = self._robot
        for name, value, size in (
            ("q", measurement.q, robot.nq),
            ("v", measurement.v, robot.nv),
        ):
            if value.shape != (size,):
                return f"the state's {name} has shape {value.shape}; needs ({size},)"
            if not np.isfinite(value).all():
                where = int(np.flatnonzero(~np.isfinite(value))[0])
                return f"the state is not finite: {name}[{where}] is {value[where]}"
        if not np.isfinite(measurement.t):
            return f"the state's time is {measurement.t}"
        for start, size in robot.unit_blocks:
            norm = float(np.linalg.norm(measurement.q[start : start + size]))
            if abs(norm - 1.0) > 1e-6:
                return (
                    f"q[{start}:{start + size}] of the state has norm {norm:.6g}; "
                    "needs norm 1"
                )
        return None

    def violation(self, measurement: Measurement) -> str | None:
        """Return why the loop must stop at a valid state, or None.

        Checks what the hardware found, the robot's own stop, state age, skipped states,
        positions and speeds.
        """
        last, allowed = self.last, self._settings
        if measurement.fault:
            return measurement.fault
        if measurement.halted:
            return "the robot has stopped by itself"
        if measurement.age > allowed.age:
            return (
                f"the state is {measurement.age:.3g} s old; {allowed.age:g} s are "
                "allowed"
            )
        if last is not None:
            skipped = measurement.sequence - last.sequence - 1
            if skipped > allowed.missing:
                return (
                    f"{skipped} states in a row were not received; {allowed.missing} "
                    "are allowed"
                )
        positions = self._robot.joint_positions(measurement.q)
        return self._outside(positions, self._lower, self._upper, "is at") or (
            self._outside(measurement.v, -self._speed, self._speed, "moves at")
        )

    def _outside(
        self, values: Array, lower: Array, upper: Array, verb: str
    ) -> str | None:
        outside = (values < lower) | (values > upper)
        if not outside.any():
            return None
        i = int(np.flatnonzero(outside)[0])
        return (
            f"{self._robot.dof_names[i]} {verb} {values[i]:.6g}, outside "
            f"{lower[i]:.6g} to {upper[i]:.6g}"
        )
