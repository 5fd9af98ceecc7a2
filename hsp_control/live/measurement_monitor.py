"""Whether a measurement is within what the robot, its limits and time permit."""

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.live.hardware import Measurement
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot


class MeasurementMonitor:
    """Checks measurements: returns a reason to stop, or None."""

    def __init__(
        self,
        robot: Robot,
        limits: RobotLimits | None,
        settings: LiveSettings,
        period: float,
    ) -> None:
        self._robot, self._settings, self._period = robot, settings, period
        self._own = own_limits(robot) if limits is None else None
        self.last: Measurement | None = None  # the last valid measurement
        self._read(limits)

    def follow(self, limits: RobotLimits | None) -> None:
        """Check against the controller's present limits, which may change in a run."""
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

    def is_new(self, measurement: Measurement) -> bool:
        """Return whether the measurement is later than the last one."""
        return self.last is None or measurement.sequence > self.last.sequence

    def jumps(
        self, measurement: Measurement, judged: Flags
    ) -> tuple[Flags, str | None]:
        """Return the joints that cannot have moved here from the last state, and why.

        ``judged`` selects the joints, shape (nv,).
        """
        last = self.last
        if last is None:
            return np.zeros(self._robot.nv, dtype=bool), None
        passed = max(measurement.t - last.t, 0.0)
        passed = max(passed, (measurement.sequence - last.sequence) * self._period)
        moved = self._robot.difference(last.q, measurement.q) * judged
        furthest = self._speed * passed + self._settings.position_margin
        why = self._outside(moved, -furthest, furthest, "jumps by")
        return np.abs(moved) > furthest, why

    def violation(self, measurement: Measurement) -> str | None:
        """Return why the loop must stop at a valid state, or None."""
        last, allowed = self.last, self._settings
        if measurement.fault:
            return measurement.fault
        if measurement.halted:
            return "the robot has stopped by itself"
        if not abs(measurement.age) <= allowed.age:
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
