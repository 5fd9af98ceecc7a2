"""Plans of locomotion: the desired velocity."""

from dataclasses import KW_ONLY, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.errors import PlanError
from hsp_control.companions.walking.footsteps import Velocity
from hsp_control.control.interface import MotionPlan
from hsp_control.declaration import within
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Number
from hsp_control.trajectories import Trajectory


class MovingPlan(MotionPlan):
    """A plan that follows a velocity: three numbers, or a function of time."""

    speed: Number = 0.0
    """Speed forward [m/s]."""
    _: KW_ONLY
    sideways: Number = 0.0
    """Speed to the left [m/s]."""
    turn: Number = 0.0
    """Rate of turning to the left [rad/s]."""
    velocity: Given[Trajectory | None, ArrayLike] = default(None)
    """Instead of these three: all of them as functions of time, for example a stream
    [m/s, m/s, rad/s]."""

    def _complete(self) -> None:
        if self.velocity is None:
            return
        for name in ("speed", "sideways", "turn"):
            if getattr(self, name):
                raise PlanError(f"give either velocity or {name}, not both")
        if not self.velocity.relative:
            self._check(self.velocity)

    def _check(self, velocity: Trajectory) -> None:
        if velocity.dimension != 3:
            raise PlanError(
                f"velocity has dimension {velocity.dimension}; needs 3: forward, to "
                "the left, turning"
            )

    def begun(self) -> Self:
        """Return the plan for a run, which begins without velocity."""
        if self.velocity is None:
            return self
        with within("velocity"):
            velocity = self.velocity.anchored(np.zeros(3))
        self._check(velocity)
        return replace(self, velocity=velocity)

    def velocity_at(self, t: float) -> Velocity:
        """Return the desired velocity at time t [s]."""
        if self.velocity is None:
            return Velocity(self.speed, self.sideways, self.turn)
        return Velocity(*self.velocity.sample(t).position.tolist())
