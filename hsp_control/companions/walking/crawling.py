"""The crawl of a quadruped, and its run from foot to foot."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import ClassVar, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.footsteps import Footstep
from hsp_control.companions.walking.four_feet import PointFoot, RunningQuadruped
from hsp_control.companions.walking.polygon import convex_hull, nearest_inside
from hsp_control.companions.walking.quadruped import QuadrupedPlan
from hsp_control.companions.walking.quintic import at_rest, to_rest
from hsp_control.control.interface import Controller, Measurement
from hsp_control.declaration.quantities import Positive, ProperFraction
from hsp_control.robot import RobotState
from hsp_control.tasks import Gains

CLOSING = 4
"""Swings without velocity before it stands, which bring the feet below the hips."""
FADE = 0.3
"""Share of the time on four feet in which the force of the next foot fades."""


class Crawl(QuadrupedPlan, type="crawl"):
    """A crawl of a quadruped: one foot swings while three stand; it can always stop.

    On four feet the centre of mass moves above the triangle of the next three stance
    feet; there it rests while the fourth swings. The feet follow each other on each
    side, the hind one first (McGhee and Frank 1968). A foot lands half a stride ahead
    of its place; it becomes a contact at touchdown, early or late, higher or lower.
    """

    gait: ClassVar[str] = "crawl"
    center_priority: ClassVar[int] = 1
    center_gains: ClassVar[Gains] = Gains(natural_frequency=8.0)

    _: KW_ONLY
    swing: Positive = 0.35
    """Duration of a swing [s]."""
    stance: Positive = 0.45
    """Duration of the time on four feet between two swings, in which the body moves
    [s]."""
    margin: ProperFraction = 0.3
    """Share by which the support triangle is shrunk for the centre of mass
    [-]."""

    def begin(self, controller: Controller) -> "RunningCrawl":
        """Return the crawl of a run; see `MotionPlan.begin`."""
        return RunningCrawl(self.begun(), controller, self.margin)


class RunningCrawl(RunningQuadruped):
    """A `Crawl` in one run."""

    _mode: Literal["standing", "four", "three"]

    def __init__(self, crawl: Crawl, controller: Controller, margin: float) -> None:
        """Find the references and the switches; see `RunningQuadruped`.

        Args:
            crawl: The plan.
            controller: A controller built from its parts.
            margin: Share by which the support triangle is shrunk [-].
        """
        super().__init__(crawl, controller)
        self._margin = margin

    def _start_gait(self, state: RobotState) -> None:
        """Begin standing; see `RunningQuadruped`."""
        front_left, front_right, hind_left, hind_right = self._corners()
        self._order = (hind_left, front_left, hind_right, front_right)
        self._cycle = 4.0 * (self.gait.swing + self.gait.stance)
        self._check_stride(state, 0.5 * self._cycle)
        mass = state.centroidal.position[:2]
        self._middle: Array = mass.copy()
        self._shift = to_rest(at_rest(mass), mass, state.t, 1.0)

    def _combinations(self) -> Sequence[Sequence[PointFoot]]:
        """Return the single feet."""
        return [[foot] for foot in self._feet]

    def _phase(self) -> tuple[float, str]:
        """Return the logged phase; see `RunningQuadruped`."""
        phase = {"standing": 0.0, "four": 1.0, "three": 2.0}[self._mode]
        if self._mode == "three":
            phase += self._swings % 4
        return phase, "0 stands; 1 on four feet; 2 to 5 a foot swings, in order"

    # -- from swing to swing ----------------------------------------------------------

    @property
    def _foot(self) -> PointFoot:
        """The foot that swings, or swings next."""
        return self._order[self._swings % 4]

    def _step(self, t: float, measured: Measurement) -> None:
        """Advance the gait; see `RunningQuadruped`."""
        if self._mode != "standing":
            before = self._world_velocity()
            self._accelerate(t)
            mean = 0.5 * (before + self._world_velocity())
            self._middle = self._middle + (t - self._last) * mean
        self._go_on(t, measured)
        self._body.write(t, *self._shift.sample(t))

    def _go_on(self, t: float, measured: Measurement) -> None:
        if self._mode == "standing":
            if not self._wanted(t).is_zero:
                self._middle = self._state.centroidal.position[:2].copy()
                self._idle = 0
                self._move_over(t)
        elif self._mode == "four":
            if t >= self._since + self.gait.stance - 1e-9:
                self._mode = "three"
                self._lift_off(self._foot, t)
                self._place(t)
        elif self._has_landed(self._foot, measured):
            self._swings += 1
            self._idle = self._idle + 1 if self._velocity.is_zero else 0
            if self._wanted(t).is_zero and self._idle >= CLOSING:
                self._mode = "standing"
                places = [self._state.position(foot.frame)[:2] for foot in self._feet]
                self._shift_to(np.mean(places, axis=0), t)
            else:
                self._move_over(t)

    def _move_over(self, t: float) -> None:
        """Move the centre of mass above the next stance feet."""
        stance, swing = self.gait.stance, self.gait.swing
        self._mode, self._since = "four", t
        self._foot.unload(t + (1.0 - FADE) * stance, FADE * stance)
        others = [foot for foot in self._feet if foot is not self._foot]
        places = np.array([self._state.position(foot.frame)[:2] for foot in others])
        center = places.mean(axis=0)
        smaller = convex_hull(center + (1.0 - self._margin) * (places - center))
        wanted = self._middle + (stance + 0.5 * swing) * self._world_velocity()
        self._shift_to(nearest_inside(smaller, wanted), t)

    def _shift_to(self, point: Array, t: float) -> None:
        before_fade = (1.0 - 0.5 * FADE) * self.gait.stance
        self._shift = to_rest(self._shift.sample(t), point, t, before_fade)

    def _place(self, t: float) -> None:
        """Aim the foot half a stride ahead of its place below the body."""
        foot, swing = self._foot, self._foot.swing
        assert swing is not None
        axes = Footstep(0.0, 0.0, self._yaw + self._velocity.turn * self.gait.swing)
        ahead = (self.gait.swing + 0.5 * self._cycle) * self._world_velocity()
        place = self._middle + axes.world(foot.offset) + ahead
        target = Footstep(float(place[0]), float(place[1]), 0.0)
        swing.redirect(t, target, swing.end)
