"""The reaction of a biped to a push: another step, or none.

An error that the sole of the stance foot cannot correct adjusts the next step, in place
and in time (`step_adjustment.py`). No leg can step across the stance foot: a divergent
component that is still within the soles is corrected without a step.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.biped import BipedPlan
from hsp_control.companions.walking.foot import Foot
from hsp_control.companions.walking.footsteps import Footstep, Stance
from hsp_control.companions.walking.pendulum import DcmPhase, error_after
from hsp_control.companions.walking.polygon import nearest_inside
from hsp_control.companions.walking.step_adjustment import (
    Adjustment,
    adjust,
    shift_gain,
)
from hsp_control.companions.walking.swing import Swing

_DEADBAND = 0.005
"""Error of the divergent component at touchdown that needs no adjustment [m]."""
_COMMITTED = 0.12
"""Time before touchdown in which a step is not adjusted [s]."""
_SHORTEST = 0.55
"""The shortest swing that an adjustment may choose, in swings [-]."""
_LONGEST = 1.25
"""The longest one, in swings [-]."""


class PlannedSwing(NamedTuple):
    """A planned swing, and the present divergent component ξ.

    Attributes:
        side: 1 if the left foot swings, -1 for the right one.
        standing: The stance foot.
        swinging: The swing foot.
        target: Its planned footstep.
        phase: The phase of the pendulum.
        first: ξ at its start, shape (2,) [m].
        since: The present time, from its start [s].
        wanted: The planned ξ at present, shape (2,) [m].
        dcm: The present ξ, shape (2,) [m].
    """

    side: float
    standing: Foot
    swinging: Foot
    target: Footstep
    phase: DcmPhase
    first: Array
    since: float
    wanted: Array
    dcm: Array


class PushRecovery:
    """Decides from ξ whether and where to step."""

    def __init__(self, walk: BipedPlan, stance: Stance, frequency: float) -> None:
        """Set the walk, the stance, and ω [1/s]."""
        self._walk, self._stance, self._frequency = walk, stance, frequency
        self._shift = shift_gain(frequency, walk.double_support)

    def holds(self, plan: PlannedSwing, soles: Array) -> bool:
        """Return whether two soles withstand a push, and one with a step does not."""
        swing = self._walk.swing
        window = _SHORTEST * swing, _LONGEST * swing
        left = self._best_step(plan, swing, window).left
        return self._is_too_far(plan, left) and _is_within(soles, plan.dcm)

    def step(self, plan: PlannedSwing, swing: Swing, t: float) -> Adjustment | None:
        """Return place and time at which a foot is to land; None if unchanged."""
        remaining = swing.end - t
        if remaining < _COMMITTED:
            return None
        duration = self._walk.swing
        planned = swing.start + duration - t
        now = plan.swinging.place_of(swing.target)
        landing = plan.phase.dcm(plan.first, plan.since + planned, self._frequency)
        needed = landing + self._shift * (now.point - plan.target.point)
        if float(np.abs(self._dcm_after(plan, remaining) - needed).max()) < _DEADBAND:
            return None
        earliest = max(swing.start + _SHORTEST * duration - t, _COMMITTED)
        latest = swing.start + _LONGEST * duration - t
        return self._best_step(plan, planned, (earliest, max(latest, earliest)))

    def is_better_put_down(self, plan: PlannedSwing, step: Adjustment) -> bool:
        """Return whether the stance sole withstands a push, but the step would not."""
        held = _is_within(plan.standing.corners(1.0), plan.dcm)
        return held and self._is_too_far(plan, step.left)

    def _is_too_far(self, plan: PlannedSwing, left: Array) -> bool:
        """Return whether the next step's sole cannot correct an error, (2,) [m]."""
        standing = plan.standing.place
        reach = self._walk.margin * plan.swinging.reach
        return bool((np.abs(standing.local(standing.point + left)) > reach).any())

    def _best_step(
        self, plan: PlannedSwing, planned: float, window: tuple[float, float]
    ) -> Adjustment:
        """Return the place and time at which the swing foot is to land."""
        standing = plan.standing.place
        return adjust(
            plan.target,
            planned,
            window,
            partial(self._dcm_after, plan),
            plan.phase.dcm(plan.first, plan.since + planned, self._frequency),
            self._shift,
            lambda place: self._stance.kept(standing, plan.side, place),
        )

    def _dcm_after(self, plan: PlannedSwing, T: float) -> Array:
        """Return the future ξ, with feedback within the sole, shape (2,) [m]."""
        walk, frequency, place = self._walk, self._frequency, plan.standing.place
        error = place.local(place.point + plan.dcm - plan.wanted)
        left = [
            error_after(float(e), T, frequency, walk.feedback, walk.margin * r)
            for e, r in zip(error, plan.standing.reach, strict=True)
        ]
        axes = place.world(np.array(left)) - place.point
        return np.asarray(plan.phase.dcm(plan.first, plan.since + T, frequency) + axes)


def _is_within(corners: Array, point: Array) -> bool:
    """Return whether a point is in a polygon, shapes (m, 2) and (2,) [m]."""
    return bool((nearest_inside(corners, point) == point).all())
