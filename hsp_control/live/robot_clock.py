"""The robot's clock: the controller's time, and whether it can be right."""

from math import exp, inf

from hsp_control.live.hardware import Measurement

_CLOCK_STATES = 100
"""Number of states after which the gain of the robot's clock is weighted less."""
_CLOCK_WINDOW = 2.0
"""Duration of a comparison of a robot's clock with ours [s]."""
_LARGEST_LEAD = 0.1
"""Maximum gain from one such window to the next [s]."""


class RobotClock:
    """Converts the robot's time to the controller's, and checks its steps.

    Between two measurements the robot's clock may advance by the periods given by their
    sequence numbers, or by the tolerated number of missing states. It may stand still
    before the robot starts, and for the tolerated number of states later. In some
    hundred states it must not gain or lose more than that either. The clock of a robot
    in real time must not run faster than ours; a slower one shows in the numbers of
    states, or belongs to a robot that was delayed.

    After a jump the controller's time advances by one period, which is sufficient for
    the safe stop.
    """

    def __init__(
        self,
        start_time: float,
        period: float,
        tolerated: int,
        start_periods: float,
        *,
        real_time: bool = False,
    ) -> None:
        self._start_time, self._period = start_time, period
        self._tolerated, self._start_periods = tolerated, start_periods
        self._real_time = real_time
        self.restart()

    def restart(self) -> None:
        """Begin again with the next measurement."""
        self._last: Measurement | None = None
        self._offset, self._standing, self._moved = 0.0, 0, False
        self._gained = 0.0  # by the clock, relative to the number of states [s]
        self._lead = self._lead_before = -inf  # the greatest lead relative to ours [s]
        self._window_end = -inf
        self.right = True  # whether it has always been right

    def time(self, measurement: Measurement) -> float:
        """Return the controller's time of the last measurement [s]."""
        return measurement.t + self._offset

    def fault(self, measurement: Measurement, arrival: float) -> str | None:
        """Return why the clock cannot be right at a new measurement, or None.

        ``arrival`` is its time of arrival, by our clock [s].
        """
        last, self._last = self._last, measurement
        if last is None:
            self._offset = self._start_time - measurement.t
            return None
        fault = self._step_fault(measurement, last) or self._runs_fast(
            measurement.t, arrival
        )
        self.right &= fault is None
        return fault

    def passed(self, measurement: Measurement, last: Measurement) -> float:
        """Return the time between two states [s], by their numbers if it was wrong."""
        states = measurement.sequence - last.sequence
        return measurement.t - last.t if self.right else states * self._period

    def _runs_fast(self, t: float, arrival: float) -> str | None:
        """Compare the clock with ours: delays make it late, never early."""
        if not (self._real_time and self._moved):
            return None
        lead = t - arrival
        if arrival > self._window_end:
            self._lead_before, self._lead = self._lead, -inf
            self._window_end = arrival + _CLOCK_WINDOW
        self._lead = max(self._lead, lead)
        gained = lead - self._lead_before
        if self._lead_before == -inf or gained <= _LARGEST_LEAD:
            return None
        return (
            f"the robot's clock runs faster than this computer's: it has gained "
            f"{gained:.3g} s within {_CLOCK_WINDOW:g} s"
        )

    def _step_fault(self, measurement: Measurement, last: Measurement) -> str | None:
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
        if not self._moved:
            return None
        leak = exp(-states / _CLOCK_STATES)
        self._gained = leak * self._gained + passed - states * period
        if abs(self._gained) <= (self._tolerated + 1) * period:
            return None
        gained, self._gained = self._gained, 0.0
        return (
            f"the robot's clock does not fit the number of its states: it has gained "
            f"{gained:.3g} s within some {_CLOCK_STATES} periods of {period:g} s"
        )
