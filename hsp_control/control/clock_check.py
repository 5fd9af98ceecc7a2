"""Checks whether a clock can be that of the loop: origin, unit and direction."""

from hsp_control.common.arrays import Array
from hsp_control.common.warned import warn
from hsp_control.robot import RobotState

_FEW = 5
"""Consecutive steps, or steps back with others in between, before a clock is reported:
one may be late or repeated. A single step that is this many periods early suffices."""
_LATE = 1e6
"""A state later than eleven days has the time of a clock, not of a run [s]."""
_STILL = 100
"""The same for steps at equal times: a loop may rehearse its first step."""
_UNITS = 100.0
"""Times of a step over its period from which on they have different units."""
_SECONDS, _SAME = "seconds", (0.1, 10.0)
_RATIOS = {
    _SECONDS: _SAME,
    "milliseconds": (1.0 / 3e3, 1.0 / 3e2),
    "microseconds": (1.0 / 3e6, 1.0 / 3e5),
    "nanoseconds": (1.0 / 3e9, 1.0 / 3e8),
}
"""Displacement over velocity times time [1], by the unit of times."""
_MOVES = 1e-3
"""Norm of the velocity from which on they are compared [rad/s or m/s]."""
_SURE = 20
"""Moving steps in a row after which the unit is known: noise has any sign."""

_SLOWEST = 0.2
"""Longest time between outputs [s]: with K_N = 10 1/s no loop is stable beyond it."""
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
        self._unit, self._alike = "", 0  # of times, and steps in a row that show it
        self._looks = self._backwards = 0
        self._outputs, self._latest = 0, 0.0  # that are recorded, and their latest time
        self._stuck = 0  # outputs in a row whose times do not advance

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
        if kind == "":  # steps back in between still count: a clock has none
            self._count = self._count if self._kind == "back" else 0
            return
        self._count = self._count + 1 if kind == self._kind else 1
        self._kind = kind
        enough = _STILL if kind == "still" else 1 if passed < -_FEW * held else _FEW
        if self._count >= enough:
            self._tell(_MESSAGES[kind].format(t=t, passed=passed, period=held))

    def look_again(self) -> None:
        """Check the next steps, if the unit of times is not known yet."""
        self._looks = 0
        self.undecided = self._alike < _SURE

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
        if before is None:
            return
        passed = state.t - before[0]
        way = 0.5 * passed * (before[2] + v)
        difference = state.robot.difference(before[1], state.q)
        ratio = way.dot(difference) / max(way.dot(way), 1e-300)
        # The robot moves on while its clock runs back: no log that is read backwards.
        opposed = passed < 0.0 and _SAME[0] < -ratio < _SAME[1]
        self._backwards = self._backwards + 1 if opposed else 0
        if self._backwards >= _SURE and not self._told:
            self._tell(_MESSAGES["back"].format(t=state.t, passed=passed))
        if not passed > 0.0:
            return
        shown = [unit for unit, (a, b) in _RATIOS.items() if a < ratio < b]
        unit = shown[0] if shown else ""
        self._alike = self._alike + 1 if unit == self._unit else 1
        self._unit = unit
        if unit == "" or self._alike < _SURE:
            return
        self.undecided = False
        if unit != _SECONDS and not self._told:
            self._tell(
                f"positions change by {ratio:.2g} times velocity times time, the last "
                f"step {passed:.3g} s: {unit}? Times are in s"
            )

    def recorded(self, t: float) -> None:
        """Check the time of an output that is recorded [s]: its period is not known."""
        self._outputs += 1
        passed = t - self._latest
        if self._outputs == 1 or passed > 0.0:
            self._latest = t
        if self._outputs == 1 or self._told:
            return
        if self._outputs == 2 and passed > _SLOWEST:
            self._tell(
                f"the first two outputs are {passed:g} s apart: milliseconds? Times "
                "are in s"
            )
        self._stuck = 0 if passed > 0.0 else self._stuck + 1
        if self._stuck >= _FEW and not self._told:
            self._tell(
                f"the clock runs back, or stands still, at t = {t:.10g} s: outputs are "
                "recorded at later times only"
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
