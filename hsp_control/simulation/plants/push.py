"""Pushes: external wrenches of given size, frame and time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.robot.matrix_view import matrix_view


@dataclass(frozen=True)
class Push:
    """A constant external wrench on a frame during an interval.

    Attributes:
        frame: The frame whose origin it acts on.
        force: In the world's axes [N], shape (3,).
        moment: In the world's axes [N·m], shape (3,).
        start: When it begins [s].
        duration: How long it lasts [s].
    """

    frame: str
    force: Sequence[float] = (0.0, 0.0, 0.0)
    moment: Sequence[float] = (0.0, 0.0, 0.0)
    start: float = 0.0
    duration: float = 0.1

    def __post_init__(self) -> None:
        """Check that the wrench is finite and the duration positive."""
        for name, vector in (("force", self.force), ("moment", self.moment)):
            if np.shape(vector) != (3,) or not np.isfinite(vector).all():
                raise SimulationError(
                    f"push on {self.frame!r}: {name} is {vector}; needs 3 numbers"
                )
        if not (np.isfinite(self.start) and 0.0 < self.duration < np.inf):
            raise SimulationError(
                f"push on {self.frame!r}: lasts {self.duration} s from {self.start} s; "
                "the duration must be positive"
            )

    def is_active(self, t: float) -> bool:
        """Return whether it acts at time t [s]."""
        return self.start <= t < self.start + self.duration


class Pushes:
    """All pushes on a robot, as a generalised effort."""

    def __init__(self, robot: Robot, pushes: Sequence[Push] = ()) -> None:
        """Set the robot and the pushes.

        Raises:
            FrameNotFoundError: If the robot lacks a frame.
        """
        self.robot = robot
        self.pushes = tuple(pushes)
        self._frames = {push.frame: robot.frame_id(push.frame) for push in pushes}
        self._data = robot.model.createData() if pushes else None

    def any_active(self, t: float, end: float) -> bool:
        """Return whether a push acts at some time from t to ``end`` [s]."""
        return any(
            push.start <= end and t < push.start + push.duration for push in self.pushes
        )

    def effort(self, t: float, q: Array) -> Array:
        """Return Σ Jᵀ wrench of the pushes that act at time t [s], shape (nv,)."""
        total = np.zeros(self.robot.nv)
        for push in self.pushes:
            if push.is_active(t):
                J = pin.computeFrameJacobian(
                    self.robot.model,
                    self._data,
                    q,
                    self._frames[push.frame],
                    pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
                )
                total += matrix_view(J).T @ np.concatenate([push.force, push.moment])
        return total
