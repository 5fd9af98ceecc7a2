"""Checks whether a clock can be that of the loop: origin, unit and direction."""

from hsp_control.common.arrays import Array
from hsp_control.common.warned import warn
from hsp_control.robot import RobotState

_FEW = 5
"""Consecutive steps before a clock is reported: one may be late or repeated. A single
step that is this many periods early suffices."""
_LATE = 1e6
"""A state later than eleven days has the time of a clock, not of a run [s]."""
_STILL = 100
"""The same for steps at equal times: a loop may rehearse its first step."""
_UNITS = 100.0
"""Times of a step over its period from which on they have different units."""
_MILLI = 1.0 / 3000.0, 1.0 / 300.0
"""Displacement over velocity times time [1], where times are in milliseconds."""
_SAME = 0.1, 10.0
"""The same, where the units are right."""
_MOVES = 1e-3
"""Norm of the velocity from which on they are compared [rad/s or m/s]."""
_SURE = 20
"""Moving steps in a row after which the unit is known: noise has any sign."""

_LOOKS = 300
"""Steps that are checked for it, after the first one and after a change or a message of
a stream: later ones cost nothing."""


class ClockWarning(UserWarning):
    """The times that a controller is given are not those of its loop."""


class ClockCheck:
    """Warns once of inconsistent times of the steps of a run."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._period, self._stamp = 0.0, -1
        self._kind, self._count = "", 0
        self._told = False
        self.undecided = True  # whether `moved` has to check another step
        self._before: tuple[float, Array, Array] | None = None
        self._milli = self._same = self._looks = 0

    def begin(self, t: float) -> None:
        """Check the time of the first step [s]."""
        if abs(t) > _LATE:
            self._tell(
                f"the first state has t = {t:.10g} s, but trajectories, schedules and "
                "changes begin at t = 0, so they are over; call compute(t, q, v) "
                "with the time of the clock, which may begin anywhere"
            )

    def change(self, at: float, now: float) -> None:
        """Check the time of a change that is made now [s]."""
        self.look_again()
        if at - now > _LATE:
            self._tell(
                f"a change at t = {at:.10g} s begins in {(at - now) / 86400.0:.0f} "
                "days: times count from the first step; for now it is "
                "at(controller.state.t)"
            )

    def look(self, t: float, period: float, stamp: int) -> None:
        """Check the time of a step [s], and the period for which it is held [s].

        ``stamp`` is that of its state: an effort that is sent instead is no new step.
        """
        if stamp == self._stamp:
            return
        self._stamp = stamp
        last, held = self._last, self._period
        self._last, self._period = t, period
        if self._told or last is None:
            return
        passed = t - last
        kind = ""
        if passed < 0.0:
            kind = "back"
        elif passed == 0.0:
            kind = "still"
        elif passed > _UNITS * held:
            kind = "fast"
        elif passed * _UNITS < held:
            kind = "slow"
        if kind == "":
            self._count = 0
            return
        self._count = self._count + 1 if kind == self._kind else 1
        self._kind = kind
        enough = _STILL if kind == "still" else 1 if passed < -_FEW * held else _FEW
        if self._count >= enough:
            self._tell(_MESSAGES[kind].format(t=t, passed=passed, period=held))

    def look_again(self) -> None:
        """Check the next steps, if the unit of times is not known yet."""
        self._looks = 0
        self.undecided = max(self._same, self._milli) < _SURE

    def moved(self, state: RobotState) -> None:
        """Compare the displacement since the last step with velocity times time.

        They show the unit of times where no period is given, and are compared until
        it is known, in some first steps of the motion.
        """
        self._looks += 1
        self.undecided = self._looks < _LOOKS
        v = state.v
        if v.dot(v) < _MOVES**2:
            self._before = None
            return
        before, self._before = self._before, (state.t, state.q.copy(), v.copy())
        if before is None or not state.t > before[0]:
            return
        way = 0.5 * (state.t - before[0]) * (before[2] + v)
        difference = state.robot.difference(before[1], state.q)
        ratio = way.dot(difference) / max(way.dot(way), 1e-300)
        self._same = self._same + 1 if _SAME[0] < ratio < _SAME[1] else 0
        self._milli = self._milli + 1 if _MILLI[0] < ratio < _MILLI[1] else 0
        self.undecided &= max(self._same, self._milli) < _SURE
        if self._milli >= _SURE and not self._told:
            self._tell(
                f"positions change by {ratio:.2g} times velocity times time, the last "
                f"step {state.t - before[0]:.3g} s: milliseconds? Times are in s"
            )

    def _tell(self, message: str) -> None:
        self._told = True
        warn(message, ClockWarning)


_UNIT = (
    "the clock advances by {passed:.3g} s in a period that was given as "
    "{period:.3g} s; are both in seconds?"
)
_MESSAGES = {
    "back": "the clock runs back: t = {t:.10g} s came {passed:.3g} s after the step "
    "before",
    "still": "the clock stands still at t = {t:.10g} s, while efforts are held for "
    "{period:.3g} s each",
    "fast": _UNIT,
    "slow": _UNIT,
}
