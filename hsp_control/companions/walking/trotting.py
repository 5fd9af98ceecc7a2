"""The trot of a quadruped, and its run from swing to swing."""

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.footsteps import Footstep
from hsp_control.companions.walking.four_feet import PointFoot, RunningQuadruped
from hsp_control.companions.walking.pendulum import GRAVITY
from hsp_control.companions.walking.quadruped import QuadrupedPlan
from hsp_control.control.interface import Controller, Measurement
from hsp_control.robot import RobotState
from hsp_control.tasks import Gains

READY = 0.2
"""Time on four feet before the first swing; the body waits for it [s]."""
LEASH = 0.1
"""Maximum distance of the reference from the centre of mass [m]."""
RETURN = 1.0
"""Rate at which it returns to its line [1/s]."""
RETURN_SPEED = 0.1
"""Maximum speed of its return [m/s]."""
CLOSING = 2
"""Swings without velocity before it stands, which bring the feet below the hips."""
_COMMITTED = 0.05
"""Time before touchdown in which a step is not moved [s]."""


class Trot(QuadrupedPlan, type="trot"):
    """A trot of a quadruped: two diagonal feet swing while two stand.

    It stands, trots with the given velocity, and stands again when that is zero. A foot
    lands at the future place of the body, shifted in proportion to its excess velocity
    (the capture point; Raibert 1986, Pratt et al. 2006). It becomes a contact at
    touchdown, early or late, higher or lower.
    """

    gait: ClassVar[str] = "trot"
    center_priority: ClassVar[int] = 2
    center_gains: ClassVar[Gains] = Gains(6.0, 5.0)

    def begin(self, controller: Controller) -> "RunningTrot":
        """Return the trot of a run; see `MotionPlan.begin`."""
        return RunningTrot(self.begun(), controller)


class RunningTrot(RunningQuadruped):
    """A `Trot` in one run."""

    _mode: Literal["standing", "ready", "four", "two"]

    def _start_gait(self, state: RobotState) -> None:
        """Begin standing; see `RunningQuadruped`."""
        mass = state.centroidal.position
        front_left, front_right, hind_left, hind_right = self._corners()
        self._pairs = [front_left, hind_right], [front_right, hind_left]
        lowest = min(foot.height for foot in self._feet)
        self._time_constant = float(np.sqrt((mass[2] - lowest) / GRAVITY))
        self._check_stride(state, 0.5 * (self.gait.swing + 2.0 * self.gait.stance))
        self._reference: Array = mass[:2].copy()
        self._line: Array = mass[:2].copy()

    def _combinations(self) -> Sequence[Sequence[PointFoot]]:
        """Return the pairs, and each of their feet: one may land before the other."""
        return [aloft for pair in self._pairs for aloft in (pair, pair[:1], pair[1:])]

    def _phase(self) -> tuple[float, str]:
        """Return the logged phase; see `RunningQuadruped`."""
        phase = {"standing": 0.0, "ready": 1.0, "four": 1.0, "two": 2.0}[self._mode]
        if self._mode == "two" and self._swings % 2:
            phase = 3.0
        return phase, "0 stands; 1 on four feet; 2, 3 a diagonal pair swings"

    # -- from swing to swing ----------------------------------------------------------

    def _step(self, t: float, measured: Measurement) -> None:
        """Advance the gait; see `RunningQuadruped`."""
        acceleration = self._drive(t)
        self._go_on(measured)
        self._place(t)
        self._body.write(t, self._reference, self._reference_velocity(), acceleration)

    def _drive(self, t: float) -> Array:
        """Advance velocity and reference; return the acceleration [m/s²]."""
        h = t - self._last
        if h <= 0.0 or self._mode in {"standing", "ready"}:
            return np.zeros(2)
        before = self._world_velocity()
        self._accelerate(t)
        now = self._world_velocity()
        self._reference = self._reference + 0.5 * h * (before + now) + h * self._back()
        self._line = self._line + 0.5 * h * (before + now)
        away = self._state.centroidal.position[:2] - self._reference
        far = float(np.hypot(*away))
        if far > LEASH:  # it is pushed: the reference follows
            pulled = away * (1.0 - LEASH / far)
            self._reference = self._reference + pulled
            speed = float(np.hypot(*now))
            if speed > 0.0:  # a delay along its line is not corrected
                pulled = now * float(now @ pulled) / speed**2
            self._line = self._line + pulled
        return (now - before) / h

    def _back(self) -> Array:
        """Return the velocity back to the line from which it was pushed (2,) [m/s]."""
        off = self._line - self._reference
        return np.asarray(off * min(RETURN, RETURN_SPEED / max(np.hypot(*off), 1e-12)))

    def _reference_velocity(self) -> Array:
        """Return the velocity of the reference, shape (2,) [m/s]."""
        if self._mode in {"standing", "ready"}:
            return self._world_velocity()
        return np.asarray(self._world_velocity() + self._back())

    def _go_on(self, measured: Measurement) -> None:
        t, trot = measured.t, self.gait
        wanted = self._wanted(t)
        if self._mode == "standing":
            if not wanted.is_zero:
                self._mode, self._idle = "ready", 0
                self._since = t + READY - trot.stance
                self._unload(self._since)
        elif self._mode in {"ready", "four"}:
            if t >= self._since + trot.stance - 1e-9:
                self._mode = "two"
                for foot in self._pair:
                    self._lift_off(foot, t)
        else:  # one foot may stand while the other is still in the air
            landed = [self._has_landed(foot, measured) for foot in self._pair]
            if not all(landed):
                return
            self._swings += 1
            self._idle = self._idle + 1 if self._velocity.is_zero else 0
            if wanted.is_zero and self._idle >= CLOSING:
                self._mode = "standing"
                return
            self._mode, self._since = "four", t
            self._unload(t)

    @property
    def _pair(self) -> list[PointFoot]:
        """The feet that swing, or swing next."""
        return self._pairs[self._swings % 2]

    def _unload(self, t: float) -> None:
        """Fade the forces of the next pair while all feet stand."""
        for foot in self._pair:
            foot.unload(t, self.gait.stance)

    def _place(self, t: float) -> None:
        """Aim the swing feet at the future place of the body."""
        mass, trot = self._state.centroidal, self.gait
        velocity, wanted = mass.velocity[:2], self._reference_velocity()
        axes = Footstep(0.0, 0.0, self._yaw)
        for foot in self._pair:
            swing = foot.swing
            if swing is None or swing.end - t <= _COMMITTED:
                continue
            target = (
                mass.position[:2]
                + velocity * (swing.end - t)
                + axes.world(foot.offset)
                + 0.5 * (trot.swing + trot.stance) * wanted
                + self._time_constant * (velocity - wanted)
            )
            place = Footstep(float(target[0]), float(target[1]), 0.0)
            swing.redirect(t, place, swing.end)
