"""Checks whether a clock can be that of the loop, by the motion of the robot.

Velocity times time is the way. Nothing has to be told: `compute` alone shows it.
"""

from math import inf

from hsp_control.common.arrays import Array
from hsp_control.control.clock_check import BACK
from hsp_control.robot import RobotState

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
"""Steps in a row after which it is known: noise has any sign."""
_ASIDE = 0.3
"""Largest part of a way that is not along the velocity, of a robot that moves on."""
_FAR = 5.0
"""Step back, in usual steps, that a late or repeated state does not make."""
_LONGEST = 0.2
"""Longest step [s], where the usual one is not known."""
_LOOKS = 300
"""Steps that are checked, after the first one and after a change, a message of a stream
or a step back: others cost nothing. And the most steps back after which they are."""


class ClockMotion:
    """Compares the clock of a run with the robot's motion, until it is understood.

    Attributes:
        latest: The time of the last step [s].
        undecided: Whether `compare` has to look at another step.
    """

    def __init__(self) -> None:
        self.latest = -inf
        self.undecided = True
        self._looks = self._returns = 0
        self._before: tuple[float, Array, Array] | None = None  # t, q and v
        self._unit, self._alike = "", 0  # of times, and steps in a row that show it
        self._usual = 0.0  # time that the last step's way needed [s]
        self._returned_to = -inf
        self._jump: tuple[float, float] | None = None  # back: where to, and how far [s]
        self._since = 0  # steps forward after it
        self._kind, self._count = "", 0  # steps in which the robot alone moves on

    def look_again(self) -> None:
        """Check the next steps, if the unit of times is not known yet."""
        self._looks, self._before = 0, None
        self.undecided = self._alike < _SURE

    def returned(self, t: float) -> None:
        """Check the next steps, as this one's time [s] is not after the last one's.

        An analysis may compute at any times, as often as it likes, and is not looked at
        for long. In a loop the robot moves on.
        """
        if t == self._returned_to or self._returns > _LOOKS:
            return
        self._returned_to = t
        back = self.latest - t
        if back > 0.0:
            self._returns += 1
            if back > _FAR * self._usual > 0.0:
                self._jump = self._jump or (t, -back)
                self._before = None
        if not self.undecided:
            self._before = None
        self._looks, self.undecided = 0, True

    def compare(self, state: RobotState) -> str:
        """Compare a step's displacement with velocity times time.

        Returns:
            What is wrong with the clock; empty: nothing so far.
        """
        self._looks += 1
        self.undecided = self._looks < _LOOKS
        v = state.v
        if v.dot(v) < _MOVES**2:
            self._before = None
            return ""
        before, self._before = self._before, (state.t, state.q.copy(), v.copy())
        if before is None:
            return ""
        passed = state.t - before[0]
        way = state.robot.difference(before[1], state.q)
        if passed == 0.0 and not way.any():  # a repeated state
            return ""
        mean = 0.5 * (before[2] + v)
        needed = mean.dot(way) / max(mean.dot(mean), 1e-300)  # for this way [s]
        if passed > 0.0:
            return self._forward(passed, needed)
        aside = way - needed * mean
        goes_on = aside.dot(aside) < _ASIDE**2 * way.dot(way)
        return self._not_forward(passed, needed if goes_on else 0.0)

    def _forward(self, passed: float, needed: float) -> str:
        """Compare the time of a step with the time that its way needs [s]."""
        if self._kind == "still":  # two states of one time, as of an analysis
            self._count = 0
        self._usual = max(needed, 0.0)
        ratio = needed / passed
        shown = [unit for unit, (a, b) in _RATIOS.items() if a < ratio < b]
        unit = shown[0] if shown else ""
        self._alike = self._alike + 1 if unit == self._unit else 1
        self._unit = unit
        if unit == "" or self._alike < _SURE:
            return ""
        if self._jump is not None:
            t, back = self._jump
            self._since += 1
            if self.latest > t - back:  # an analysis, such as an integrator's stages
                self._jump, self._since = None, 0
            elif self._since < _SURE:
                return ""
            else:
                return BACK.format(t=t, passed=back)
        self.undecided = False
        if unit == _SECONDS:
            return ""
        return (
            f"positions change by {ratio:.2g} times velocity times time, the last "
            f"step {passed:.3g} s: {unit}? Times are in s"
        )

    def _not_forward(self, passed: float, needed: float) -> str:
        """Count steps of a robot that moves on; ``needed`` is zero if it does not [s].

        It does not where a state is repeated, or a log is read backwards.
        """
        self._jump, self._since = None, 0
        low, high = (factor * self._usual for factor in _SAME)
        kind = "back" if passed < 0.0 else "still"
        goes_on = low < needed < (high or _LONGEST)
        before = self._count if kind == self._kind else 0
        self._kind, self._count = kind, before + 1 if goes_on else 0
        if self._count < _SURE:
            return ""
        t = self.latest
        if kind == "back":
            return BACK.format(t=t, passed=passed)
        return f"the clock stands still at t = {t:.10g} s, while the robot moves on"
