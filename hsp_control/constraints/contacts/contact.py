"""The base class of contacts: constraint rows, and points where forces may act."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.common.kernels import kernel
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks import TaskSample
from hsp_control.trajectories.schedule import Schedule


class Contact(ABC):
    """A part of the robot that rests on a plane of the world.

    Its rows keep it still, J a + J'v = -Kd J v: damping without stiffness, since
    stiffness would fight the small slip of a real contact. Forces act at its points.
    Each force lies within a friction pyramid inscribed in the Coulomb friction cone, so
    it pushes and never pulls.

    To implement one: call ``super().__init__``, set `rows`, write `constrain` and
    `arms`.

    Attributes:
        robot: The robot.
        frame: Name of the frame that rests on the plane.
        name: The contact's name in the log.
        rows: Number of constraint rows.
        points: Where forces act, shape (k, 3), in the frame of the subclass [m].
        axes: Two tangents and the normal of the plane as columns, world axes, shape
            (3, 3).
        friction: Friction coefficient μ.
        damping: Kd [1/s].
        schedule: When the contact is active.
    """

    rows: int

    def __init__(
        self,
        robot: Robot,
        frame: str,
        points: Array,
        *,
        friction: float = 0.7,
        normal: Sequence[float] = (0.0, 0.0, 1.0),
        damping: float = 40.0,
        schedule: Schedule | None = None,
        name: str | None = None,
    ) -> None:
        """Check and store what all contacts have in common.

        Args:
            robot: The robot.
            frame: Name of the frame that rests on the plane.
            points: Where forces act, shape (k, 3) [m].
            friction: Friction coefficient μ > 0.
            normal: Normal of the plane, world axes, shape (3,), of any length > 0.
            damping: Kd > 0 [1/s].
            schedule: When the contact is active; None: always.
            name: The contact's name; None: the frame's.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            ContactError: If friction or damping is not positive, or the normal is not a
                non-zero vector of three finite numbers.
        """
        robot.frame_id(frame)
        self.robot = robot
        self.frame = frame
        self.name = frame if name is None else name
        self.points = points
        self.axes = plane_axes(normal, self.name)
        self.friction = _positive(friction, "friction", self.name)
        self.damping = _positive(damping, "damping", self.name)
        self.schedule = Schedule.always() if schedule is None else schedule

    def compile(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return the step plan that evaluates this state into this sample."""
        return StepPlan(write=(partial(self.evaluate, state, out),))

    def evaluate(self, state: RobotState, out: TaskSample) -> TaskSample:
        """Write the rows: J, J', and the acceleration that damps the motion."""
        self.constrain(state.frame(self.frame), out)
        damp_velocity(
            out.jacobian, state.v, self.damping, out.error_rate, out.acceleration
        )
        return out

    @abstractmethod
    def constrain(self, frame: FrameKinematics, out: TaskSample) -> None:
        """Write J and J' of the constraint, shape (rows, nv) each."""

    @abstractmethod
    def arms(self, frame: FrameKinematics) -> Array:
        """Return where forces act, from the frame's origin, world axes, (k, 3) [m]."""


@kernel
def damp_velocity(J: Array, v: Array, damping: float, e_dot: Array, a: Array) -> None:
    """Write e' = -J v and the acceleration Kd e', which damps the contact's motion."""
    for k in range(J.shape[0]):
        total = 0.0
        for i in range(J.shape[1]):
            total += J[k, i] * v[i]
        e_dot[k] = -total
        a[k] = -damping * total


def plane_axes(normal: Sequence[float], name: str) -> Array:
    """Return two tangents and a unit normal as columns, shape (3, 3).

    Raises:
        ContactError: If the normal is not a non-zero vector of three finite numbers.
    """
    n = np.array(normal, dtype=float)
    length = float(np.linalg.norm(n)) if n.shape == (3,) else 0.0
    if not 0.0 < length < np.inf:
        raise ContactError(
            f"contact {name!r}: normal must be a non-zero vector of three numbers, "
            f"got {list(normal)}"
        )
    n /= length
    # The tangent nearest to the world's x axis, or y if the normal is along x.
    along = np.eye(3)[0 if abs(n[0]) < 0.9 else 1]
    tangent = along - (along @ n) * n
    tangent /= np.linalg.norm(tangent)
    return np.column_stack([tangent, np.cross(n, tangent), n])


def _positive(value: Any, what: str, name: str) -> float:
    if not 0.0 < float(value) < np.inf:
        raise ContactError(f"contact {name!r}: {what} is {value}; must be positive")
    return float(value)
