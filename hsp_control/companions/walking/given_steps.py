"""Footsteps that are given, one after the other."""

from collections.abc import Mapping

import numpy as np

from hsp_control.common.errors import PlanError
from hsp_control.companions.walking.biped import BipedPlan
from hsp_control.companions.walking.footsteps import Footstep, Stance, Velocity, between
from hsp_control.companions.walking.step_planner import Next, StepPlanner

REST = Velocity(0.0, 0.0, 0.0)
_REACHED = 1e-6
"""Tolerance of a step beyond the reach of the legs [m]."""


class GivenSteps(StepPlanner):
    """Plans the listed steps of a walk; it stands when they are done.

    They are relative to the robot's start: to the middle between its feet, x forward.
    """

    def __init__(
        self,
        walk: BipedPlan,
        stance: Stance,
        robot: str,
        places: Mapping[float, Footstep],
    ) -> None:
        """Set the steps."""
        super().__init__(walk, stance, robot)
        assert walk.footsteps is not None
        self._side = 1.0 if walk.first == "left" else -1.0
        origin = between(places[1.0], places[-1.0])
        rows = np.asarray(walk.footsteps).tolist()
        self._steps = [origin.ahead(x, y, yaw) for x, y, yaw in rows]
        places, side = dict(places), self._side
        for k, step in enumerate(self._steps):
            kept = stance.kept(places[-side], side, step)
            if float(np.hypot(*(kept.point - step.point))) > _REACHED:
                x, y = places[-side].local(step.point)
                raise PlanError(
                    f"footsteps[{k}] is {x:.3g} m ahead and {side * y:.3g} m beside "
                    f"the standing foot; {robot} reaches {stance.longest:.3g} m ahead, "
                    f"and {stance.narrowest:.3g} to {stance.widest:.3g} m beside it"
                )
            places[side], side = step, -side

    def sets_out(self, t: float, taken: int) -> bool:
        """Return whether steps remain."""
        return taken < len(self._steps) and not self.stopping

    def first_side(self, t: float, taken: int) -> float:
        """Return the foot that swings first; they alternate after that."""
        return self._side if taken % 2 == 0 else -self._side

    def _next(
        self,
        velocity: Velocity,
        t: float,
        taken: int,
        side: float,
        places: Mapping[float, Footstep],
    ) -> Next:
        if self.stopping:  # the feet are placed beside each other
            return super()._next(velocity, t, taken, side, places)
        if taken >= len(self._steps):
            return Next(REST, None)
        # A push may have moved the stance foot.
        kept = self._stance.kept(places[-side], side, self._steps[taken])
        return Next(REST, kept)
