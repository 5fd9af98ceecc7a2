"""Contacts, and the rows of a base that its contacts leave free."""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import ContactError, TrajectoryError
from hsp_control.declaration import Part, within
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import (
    ArrayField,
    Number,
    Positive,
    Vector3,
    read_only,
)
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.trajectories import Hold, Trajectory
from hsp_control.trajectories.schedule import Schedule
from hsp_control.trajectories.streams.streamed import Streamed

NORMAL, FORCE, WRENCH = 1, 3, 6
"""The kind of a command, by the number of its coordinates."""


class CommandedForce(Part, error=ContactError):
    """The commanded force of the environment on the robot at a contact, over time.

    It is given in the axes of the contact: two tangents and the normal, so that a
    positive normal force presses. One number is the normal force alone, three are the
    force; six are force and moment about the middle of a surface. Points share it: the
    forces of least norm that have this sum, so that the middle is the centre of
    pressure if no moment is commanded.

    The command is the reference of the contact forces in every step, see
    `ActiveStack.support`: the other contacts balance its effect on the base.
    """

    value: Annotated[ArrayLike, ArrayField(Number | list[Number], read_only)] | None = (
        None
    )
    """A constant command: the normal force, a number [N]; or shape (3,) [N], or
    (6,) [N, N·m]."""
    _: KW_ONLY
    trajectory: Given[Trajectory | None, ArrayLike] = default(None)
    """Instead of `value`: the command over time, of dimension 1, 3 or 6 [N, N·m]."""

    def __post_init__(self) -> None:
        if (self.value is None) == (self.trajectory is None):
            raise ContactError("give either the value of the force or its trajectory")
        if self.trajectory is None:
            self._check_dimension("value", np.size(np.asarray(self.value)))
            return
        with within("trajectory"):
            if any(True for _ in parts_within(self.trajectory, Streamed)):
                raise ContactError(
                    "a stream cannot command a force; while the controller runs, "
                    "controller.at(t).force(contact, force) does"
                )
            try:
                self.trajectory.anchored(None)
            except TrajectoryError as error:
                raise ContactError(str(error)) from None
        self._check_dimension("trajectory", self.trajectory.dimension)

    @property
    def dimension(self) -> int:
        """The number of coordinates: `NORMAL`, `FORCE` or `WRENCH`."""
        return self.followed.dimension

    @property
    def followed(self) -> Trajectory:
        """The command as a trajectory."""
        if self.trajectory is not None:
            return self.trajectory
        return Hold(np.atleast_1d(np.asarray(self.value)))

    @staticmethod
    def _check_dimension(key: str, n: int) -> None:
        if n not in (NORMAL, FORCE, WRENCH):
            with within(key):
                raise ContactError(
                    f"it has {n} coordinates; needs 1 (the normal force), 3 (the force "
                    "along two tangents and the normal), or 6 (with the moments)"
                )


def shares(dimension: int, arms: Array) -> Array:
    """Return the map (3 k, n) from a command's coordinates to the forces at the points.

    Of all forces with the commanded sum it gives those of least norm. The arms (k, 3)
    [m] are the points from their middle, in the axes of the contact.
    """
    k = len(arms)
    alike = np.tile(np.eye(3) / k, (k, 1))
    if dimension == NORMAL:
        return alike[:, 2:]
    if dimension == FORCE:
        return alike
    total = np.zeros((6, 3 * k))
    for p, (x, y, z) in enumerate(arms):
        own = slice(3 * p, 3 * p + 3)
        total[:3, own] = np.eye(3)
        total[3:, own] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return np.asarray(np.linalg.pinv(total, rcond=1e-9))


def check_points(forces: Array, side: float, wrench: bool) -> None:
    """Check that the forces at a contact's points (k, 3) [N] push and do not slip."""
    rounding = 1e-9 * (1.0 + float(np.abs(forces).max()))
    for k, (first, second, normal) in enumerate(forces):
        where = f" at point {k + 1} of {len(forces)}, its share of the wrench," * wrench
        if normal < -rounding:
            total = normal if wrench else float(forces[:, 2].sum())
            raise ContactError(
                f"the normal force{where} is {total:g} N; a contact pushes and cannot "
                "pull: must not be negative"
            )
        largest = max(abs(first), abs(second))
        if largest > side * normal + rounding:
            scale = 1 if wrench else len(forces)
            raise ContactError(
                f"the tangential force{where} is ({first * scale:g}, "
                f"{second * scale:g}) N beside a normal force of {normal * scale:g} N: "
                "outside the friction pyramid, which allows "
                f"{side * normal * scale:g} N along each tangent"
            )


def _direction(vector: Array) -> Array:
    """Return a vector that has a direction."""
    with np.errstate(over="ignore"):
        length = float(np.linalg.norm(vector))
    if not 0.0 < length < np.inf:
        raise ContactError(f"{vector.tolist()} has no direction; must not be zero")
    return vector


class Contact(Part, ABC, family="contacts", error=ContactError):
    """A part of the robot that rests on a plane of the world.

    Its rows keep it still, J a + J'v = -Kd J v: damping without stiffness, since
    stiffness would oppose the small slip of a real contact. Forces act at its points.
    Forces lie within a friction pyramid inscribed in the Coulomb friction cone, so
    it pushes and never pulls.

    A subclass declares its parameters as fields (see `Part`), sets `rows`, and
    implements `points` and `call`, and `shift` if its points are not where forces
    act.

    Attributes:
        rows: Number of constraint rows.
    """

    rows: ClassVar[int]
    yaml_key: ClassVar[str | None] = "name"

    frame: str
    """Name of the frame that rests on the plane [-]."""
    _: KW_ONLY
    friction: Positive = 0.7
    """Coulomb friction coefficient μ [-]."""
    normal: Annotated[Vector3, AfterValidator(_direction)] = (0.0, 0.0, 1.0)
    """Normal of the plane in the world, of any length but zero, shape (3,) [-]."""
    damping: Positive = 40.0
    """Kd, the rate at which a residual velocity of the contact decays [1/s]."""
    schedule: Schedule | None = None
    """When the contact is active [-]; always by default."""
    force: CommandedForce | None = None
    """The commanded force of the environment on the robot [N]; by default the one that
    balance requires."""
    name: str = ""
    """Name of the contact in the log [-]; that of its frame by default."""

    def _complete(self) -> None:
        if not self.name:
            self._set_default("name", self.frame)

    def changed_fields(self) -> dict[str, Any]:
        """Return the fields that are not their defaults, by name."""
        changed = super().changed_fields()
        if self.name == self.frame:
            changed.pop("name", None)
        return changed

    def placed(self, start: Start) -> Self:
        """Return the contact, checked."""
        with within("frame"):
            start.state.robot.frame_id(self.frame)
        if self.force is not None:
            with within("force"):
                self._check_command(self.force, start.state)
        return self

    def _check_command(self, force: CommandedForce, state: RobotState) -> None:
        """Check that the commanded force is possible, by its value at the start."""
        if force.dimension == WRENCH and len(self.points) < 3:
            raise ContactError(
                f"it has 6 coordinates; a contact of type {self.yaml_type} exerts no "
                "moment: needs 1 or 3"
            )
        command = force.followed.sample(state.t).position
        shared = shares(force.dimension, self.arms_in_axes(state.frame(self.frame)))
        points = (shared @ command).reshape(-1, 3)
        with within("value" if force.trajectory is None else "trajectory"):
            check_points(points, self.side, force.dimension == WRENCH)

    def arms_in_axes(self, frame: FrameKinematics) -> Array:
        """Return the points from their middle, in the contact's axes, (k, 3) [m]."""
        arms = self.arms(frame)
        return np.asarray((arms - arms.mean(axis=0)) @ self.axes)

    @property
    def slides(self) -> bool:
        """Whether the tangential force follows from the motion."""
        return False

    @property
    def side(self) -> float:
        """The largest tangential force along an axis, per normal force.

        It makes a pyramid that is inscribed in the friction cone.
        """
        return self.friction / float(np.sqrt(2.0))

    @property
    def always(self) -> bool:
        """Whether the contact is active at all times."""
        return self.schedule is None or self.schedule.constant

    def active(self, t: float) -> bool:
        """Return whether the contact is active at time t [s]."""
        return self.schedule is None or self.schedule.active(t)

    def weight(self, t: float) -> float:
        """Return the activation at time t [s], in [0, 1]; see `Schedule`."""
        return 1.0 if self.schedule is None else self.schedule.weight(t)

    @cached_property
    def axes(self) -> Array:
        """Two tangents and the normal of the plane, as columns, shape (3, 3) [-]."""
        return read_only(plane_axes(self.normal))

    @property
    @abstractmethod
    def points(self) -> Array:
        """Where forces act, in the frame, shape (k, 3) [m]."""

    @abstractmethod
    def call(self, state: RobotState) -> PartCall:
        """Return a kind of call with its arguments but ``v``, ``damping``, ``out``.

        It writes J and J', shapes (rows, nv), e' = -J v, and the acceleration Kd e'
        that damps it; see `Task.call` for its arguments.
        """

    def calls(self, state: RobotState, out: TaskSample) -> PartCalls:
        """Return the calls that write the rows in a step."""
        return [self.call(state).given(v=state.v, damping=self.damping, out=out)]

    def evaluate(self, state: RobotState, out: TaskSample) -> TaskSample:
        """Write the rows: J, J', and the acceleration that damps the motion."""
        state.run(self.calls(state, out))
        return out

    @property
    def shift(self) -> Array:
        """From `points` to where forces act, in world axes, shape (3,) [m]."""
        return np.zeros(3)

    def arms(self, frame: FrameKinematics) -> Array:
        """Return where forces act, from the frame's origin, world axes, (k, 3) [m]."""
        return np.asarray(self.points @ frame.rotation.T + self.shift)


def plane_axes(normal: ArrayLike) -> Array:
    """Return two tangents and a unit normal as columns, shape (3, 3)."""
    n = np.array(normal, dtype=float)
    n /= np.linalg.norm(n)
    # The tangent nearest to the world's x axis, or y if the normal is along x.
    along = np.eye(3)[0 if abs(n[0]) < 0.9 else 1]
    tangent = along - (along @ n) * n
    tangent /= np.linalg.norm(tangent)
    return np.column_stack([tangent, np.cross(n, tangent), n])


class UnactuatedRows:
    """The rows Uᵀ(M a + N) = 0, with U the base motions that all contacts permit.

    Contacts may leave some base motions free (two point feet: the rotation about the
    line between them; in the air: all six). No force can act along such a motion, so
    the law must not require one. The rows UᵀM are divided by the robot's mass, which
    makes them comparable with those of tasks.
    """

    def __init__(self, robot: Robot, base: Indices, count: int) -> None:
        self.name = "unactuated"  # name of these rows in messages
        self.robot = robot
        self.rows = count  # the number of free base motions
        self._base = base
        self._mass = sum(inertia.mass for inertia in robot.model.inertias)

    def evaluate(
        self, state: RobotState, contacts: TaskSample, out: TaskSample
    ) -> TaskSample:
        """Write the rows, given the stacked rows of the contacts."""
        A = contacts.jacobian[:, self._base]
        A_dot = contacts.jacobian_dot[:, self._base]
        U = np.eye(len(self._base))
        if len(A):
            U = np.linalg.svd(A)[2][len(self._base) - self.rows :].T
        # A U = 0 at all times, so U' = -A⁺A'U, up to a change of basis of the rows.
        U_dot = -np.linalg.pinv(A) @ A_dot @ U if len(A) else np.zeros_like(U)
        M, M_dot = state.mass_matrix[self._base], state.mass_matrix_rate[self._base]
        out.jacobian[:] = U.T @ M / self._mass
        out.jacobian_dot[:] = (U.T @ M_dot + U_dot.T @ M) / self._mass
        effects = U.T @ state.nonlinear_effects[self._base] / self._mass
        out.acceleration[:] = out.jacobian_dot @ state.v - effects
        return out


def unactuated_count(jacobian: Array, base: Indices) -> int:
    """Return the number of base motions permitted by stacked rows (m, nv)."""
    if not len(jacobian):
        return len(base)
    values = np.linalg.svd(jacobian[:, base], compute_uv=False)
    return len(base) - int((values > 1e-6 * max(1.0, float(values[0]))).sum())
