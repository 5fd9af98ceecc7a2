"""Check the robot's clock: trajectories follow it, so it may neither jump nor stop."""

from hsp_control.live.hardware import Measurement


class RobotClock:
    """Converts the robot's time to the controller's, and judges its steps.

    Between two measurements the robot's clock may advance by the periods that their
    sequence numbers tell, or by the tolerated number of missing states. It may stand
    before the robot starts, and for the tolerated number of states later.

    After a jump the controller's time goes on by one period: the safe stop that follows
    needs no other.
    """

    def __init__(
        self, start_time: float, period: float, tolerated: int, start_periods: float
    ) -> None:
        """Begin with the next measurement."""
        self._start_time, self._period = start_time, period
        self._tolerated, self._start_periods = tolerated, start_periods
        self.restart()

    def restart(self) -> None:
        """Begin again with the next measurement."""
        self._last: Measurement | None = None
        self._offset, self._standing, self._moved = 0.0, 0, False

    def time(self, measurement: Measurement) -> float:
        """Return the controller's time of the last measurement [s]."""
        return measurement.t + self._offset

    def fault(self, measurement: Measurement) -> str | None:
        """Return why the clock cannot be right at a new measurement, or None."""
        last, self._last = self._last, measurement
        if last is None:
            self._offset = self._start_time - measurement.t
            return None
        passed, period = measurement.t - last.t, self._period
        states = measurement.sequence - last.sequence
        longest = (max(states, self._tolerated + 1) + 1) * period
        if not 0.0 <= passed <= longest:
            self._offset -= passed - period
            return (
                f"the robot's clock jumps by {passed:.6g} s from one state to the "
                f"next; {longest:.3g} s are allowed"
            )
        self._moved |= passed > 0.0
        self._standing = 0 if passed > 0.0 else self._standing + 1
        allowed = self._tolerated if self._moved else self._start_periods
        if self._standing > allowed:
            return f"the robot's clock stands still for {self._standing} states"
        return None
