"""Checks whether a clock can be that of the loop, by the periods that it is told."""

from hsp_control.common.warned import warn

_FEW = 5
"""Consecutive steps, or steps back with others in between, before a clock is reported:
one may be late or repeated. A single step that is this many periods early suffices."""
_LATE = 1e6
"""A state later than eleven days has the time of a clock, not of a run [s]."""
_STILL = 100
"""The same for steps at equal times: a loop may rehearse its first step."""
_UNITS = 100.0
"""Times of a step over its period from which on they have different units."""
_SLOWEST = 0.2
"""Longest time between outputs [s]: with K_N = 10 1/s no loop is stable beyond it."""


class ClockWarning(UserWarning):
    """The times that a controller is given are not those of its loop."""


class ClockCheck:
    """Warns once of inconsistent times of the steps of a run."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._period, self._stamp = 0.0, -1
        self._kind, self._count = "", 0
        self._told = False
        self._outputs, self._latest = 0, 0.0  # that are recorded, and their latest time
        self._stuck = 0  # outputs in a row whose times do not advance

    def begin(self, t: float) -> None:
        """Check the time of the first step [s]."""
        if abs(t) > _LATE:
            self.tell(
                f"the first state has t = {t:.10g} s, but trajectories, schedules and "
                "changes begin at t = 0, so they are over; call compute(t, q, v) "
                "with the time of the clock, which may begin anywhere"
            )

    def change(self, at: float, now: float) -> None:
        """Check the time of a change that is made now [s]."""
        if at - now > _LATE:
            self.tell(
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
            self.tell(_MESSAGES[kind].format(t=t, passed=passed, period=held))

    def recorded(self, t: float) -> None:
        """Check the time of an output that is recorded [s]: its period is not known."""
        self._outputs += 1
        passed = t - self._latest
        if self._outputs == 1 or passed > 0.0:
            self._latest = t
        if self._outputs == 1 or self._told:
            return
        if self._outputs == 2 and passed > _SLOWEST:
            self.tell(
                f"the first two outputs are {passed:g} s apart: milliseconds? Times "
                "are in s"
            )
        self._stuck = 0 if passed > 0.0 else self._stuck + 1
        if self._stuck >= _FEW:
            self.tell(
                f"the clock runs back, or stands still, at t = {t:.10g} s: outputs are "
                "recorded at later times only"
            )

    def tell(self, message: str) -> None:
        """Warn of it, unless something was reported before."""
        if not self._told:
            self._told = True
            warn(message, ClockWarning)


_UNIT = (
    "the clock advances by {passed:.3g} s in a period that was given as "
    "{period:.3g} s; are both in seconds?"
)
BACK = (
    "the clock runs back: t = {t:.10g} s came {passed:.3g} s after the step before; "
    "controller.restart() begins another run"
)
_MESSAGES = {
    "back": BACK,
    "still": "the clock stands still at t = {t:.10g} s, while efforts are held for "
    "{period:.3g} s each",
    "fast": _UNIT,
    "slow": _UNIT,
}
