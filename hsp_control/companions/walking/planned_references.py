"""References that a plan writes while the robot moves: points and orientations."""

from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.companions.walking.written_part import Written
from hsp_control.declaration.quantities import PositiveCount
from hsp_control.engine.plans import PartCall
from hsp_control.trajectories.orientation import OrientationTrajectory
from hsp_control.trajectories.trajectory import Trajectory


class Fed(Written, Trajectory):
    """x(t) in Rⁿ that a plan writes, once a control period.

    Between two writes it is x + x' (t - t0) + ½ x'' (t - t0)², so that its derivatives
    are consistent. Before the first it rests at the start of the robot.
    """

    size: PositiveCount
    """The number n of coordinates [-]."""

    points: ClassVar[tuple[str, ...]] = ()

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.size

    @property
    def relative(self) -> bool:
        """Whether nothing was written, so that it depends on the start of the robot."""
        return bool(np.isnan(self.memory[0]))

    def _unwritten(self) -> Array:
        memory = np.zeros(1 + 3 * self.size)
        memory[0] = np.nan
        return memory

    def anchored(self, start: ArrayLike | None) -> Self:
        """Return the reference itself, at rest where the robot starts."""
        if start is None:
            raise TrajectoryError("the reference of a plan needs a start")
        where = np.asarray(start, dtype=float)
        if where.shape != (self.size,):
            raise TrajectoryError(
                f"the reference of the plan has {self.size} coordinates; needs "
                f"{where.size}"
            )
        if self.relative:
            self.write(0.0, where)
        return self

    def write(
        self,
        t: float,
        position: ArrayLike,
        velocity: ArrayLike = 0.0,
        acceleration: ArrayLike = 0.0,
    ) -> None:
        """Write x, x' and x'' at time t [s], shapes (n,)."""
        rows = self.memory[1:].reshape(3, self.size)
        rows[0], rows[1], rows[2] = position, velocity, acceleration
        self.memory[0] = t

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        motion = self.memory[1:].reshape(3, self.size)
        return PartCall(engine.Extrapolation, start_time=self.memory[:1], motion=motion)


class FedOrientation(Written, OrientationTrajectory):
    """R(t) that a plan writes; between two writes R rotates with ω + ½ ω' (t - t0)."""

    @property
    def relative(self) -> bool:
        """Whether nothing was written, so that it depends on the start of the robot."""
        return bool(np.isnan(self.memory[0]))

    def _unwritten(self) -> Array:
        memory = np.zeros(16)
        memory[0] = np.nan
        return memory

    def anchored(self, start: ArrayLike) -> Self:
        """Return the reference itself, at rest as the robot starts."""
        if self.relative:
            self.write(0.0, start)
        return self

    def write(
        self,
        t: float,
        rotation: ArrayLike,
        velocity: ArrayLike = 0.0,
        acceleration: ArrayLike = 0.0,
    ) -> None:
        """Write R, ω and ω' at time t [s], shapes (3, 3), (3,) and (3,)."""
        rows = self.memory[1:].reshape(5, 3)
        rows[:3], rows[3], rows[4] = rotation, velocity, acceleration
        self.memory[0] = t

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        motion = self.memory[1:].reshape(5, 3)
        return PartCall(
            engine.ExtrapolatedOrientation, start_time=self.memory[:1], motion=motion
        )
