"""Pushes: external wrenches of given size, frame and time, and springs of a hand."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, matrix_view
from hsp_control.common.errors import SimulationError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Number, Positive, Vector3
from hsp_control.robot import Robot


class Push(Part, error=SimulationError):
    """An external wrench on a frame, for a limited time."""

    frame: str
    """Name of the frame; the wrench acts at its origin [-]."""
    force: Vector3 = (0.0, 0.0, 0.0)
    """Force in world axes [N]."""
    moment: Vector3 = (0.0, 0.0, 0.0)
    """Moment in world axes [N·m]."""
    start: Number = 0.0
    """Time at which the push begins [s]."""
    duration: Positive = 0.1
    """Duration of the push [s]."""

    def is_active(self, t: float) -> bool:
        """Return whether it acts at time t [s]."""
        return self.start <= t < self.start + self.duration


class Spring:
    """A spring from a point of a link to a hand that moves: f = k (hand - point)."""

    def __init__(
        self, joint: int, point: Array, hand: Array, stiffness: float, largest: float
    ) -> None:
        # index of the link's joint; the point in its frame, the hand in the world [m]
        self.joint, self.point, self.hand = joint, point, hand
        # k [N/m] and the largest force [N]
        self.stiffness, self.largest = stiffness, largest

    def force(self, point: Array) -> Array:
        """Return the force on the point, shape (3,) [N], from its world position."""
        force = self.stiffness * (self.hand - point)
        size = float(np.linalg.norm(force))
        return force * min(1.0, self.largest / size) if size > 0.0 else force


class Pushes:
    """All pushes on a robot, as a generalised effort."""

    def __init__(self, robot: Robot, pushes: Sequence[Push] = ()) -> None:
        self.robot = robot
        self.pushes = tuple(pushes)  # the pushes that were declared
        # the present pull of a user; None: there is none
        self.spring: Spring | None = None
        # whether a user may pull, so that an integrator must query again
        self.reachable = False
        self._frames = {}
        for k, push in enumerate(pushes):
            with within("pushes", k, "frame"):
                self._frames[push.frame] = robot.frame_id(push.frame)
        self._data = robot.model.createData()

    def any_active(self, t: float, end: float) -> bool:
        """Return whether a push acts at some time from t to ``end`` [s]."""
        return self.spring is not None or any(
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
        if self.spring is not None:
            total += self._pulled(self.spring, q)
        return total

    def _pulled(self, spring: Spring, q: Array) -> Array:
        model, data = self.robot.model, self._data
        pin.computeJointJacobians(model, data, q)
        J = matrix_view(
            pin.getJointJacobian(model, data, spring.joint, pin.ReferenceFrame.LOCAL)
        )
        place = data.oMi[spring.joint]
        force = place.rotation.T @ spring.force(place.act(spring.point))
        return np.asarray(J.T @ np.concatenate([force, np.cross(spring.point, force)]))
