"""The robot, and its state: every kinematic and dynamic quantity, computed once.

This is the only module that asks Pinocchio for kinematics and dynamics.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    NonFiniteError,
)
from hsp_control.common.kernels import kernel
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.robot.centroidal import CentroidalMotion
from hsp_control.robot.configuration_space import ConfigurationSpace
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.combining import Part, combine
from hsp_control.robot.description.loading import (
    ToolFrame,
    end_effector_frame,
    load_model,
    standing,
)
from hsp_control.robot.description.sources import RobotSource, Root, find_robot
from hsp_control.robot.kinematics import (
    FrameKinematics,
    joint_placements,
    mass_matrix_difference,
)
from hsp_control.robot.matrix_view import matrix_view


class Robot(ConfigurationSpace):
    """A robot's model: its joints, frames, limits and dynamics.

    Configurations q have shape (nq,); velocities, accelerations, efforts, gradients
    and errors live in the tangent space and have shape (nv,). Nothing assumes nq = nv.
    A robot is never changed after it has been built and holds no meshes.

    Attributes:
        source: Where it was loaded from.
        parts: The robots that it consists of, itself alone unless it was combined.
        frame_names: Names of all frames.
    """

    def __init__(
        self, model: pin.Model, source: RobotSource, parts: Sequence[Part] = ()
    ) -> None:
        """Wrap a Pinocchio model; most callers want `Robot.load`."""
        super().__init__(model, source.name, source.home or standing(model, source))
        self.source = source
        self.parts = tuple(parts) or (Part("", source, pin.SE3.Identity()),)
        self.frame_names: tuple[str, ...] = tuple(f.name for f in model.frames)
        # Where a joint and a link have one name, the link's frame is meant.
        links = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
        self._frame_ids = {
            frame.name: i
            for i, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.BODY or frame.name not in links
        }
        self._data = model.createData()

    @classmethod
    def load(
        cls,
        name: str | Path,
        *,
        root: Root | None = None,
        locked: Mapping[str, float] | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
        gravity: Sequence[float] | None = None,
        mimic: bool = True,
        access: Access = ANYWHERE,
    ) -> Self:
        """Load a bundled robot, one of example-robot-data, or a URDF file.

        Args:
            name: For example ``"panda"``, ``"talos_arm"`` or ``"my_arm/arm.urdf"``.
            root: How it stands in the world: ``fixed``, ``planar`` (x, y, yaw) or
                ``free_flyer``. None: as its source says, ``fixed`` for a file.
            locked: Joints to lock, name to value [rad or m]. None: as its source says
                (the bundled Panda locks its fingers); ``{}``: none.
            tool_frames: Frames to add, by name.
            gravity: Acceleration of gravity [m/s²], shape (3,). None: -9.81 along z.
            mimic: Honour ``<mimic>`` joints, or load them as free ones.
            access: Where a URDF given by path, and the meshes that it names, may lie:
                `access.only_within` for files of strangers.

        Raises:
            RobotNotFoundError: If there is no such robot.
            AccessError: If a file is not allowed.
            ModelError: If the URDF does not parse or moves no mass somewhere.
            JointNotFoundError: If a joint to lock does not exist.
            FrameNotFoundError: If a tool frame's parent does not exist.
        """
        source = find_robot(name, access)
        model = load_model(
            source,
            root=root,
            locked=locked,
            tool_frames=tool_frames,
            gravity=gravity,
            mimic=mimic,
        )
        return cls(model, source)

    @classmethod
    def combine(cls, robots: Mapping[str, tuple["Robot", pin.SE3]]) -> Self:
        """Return several robots in one workspace as one.

        Args:
            robots: Name to (robot, placement of its root in the world). Joints and
                frames are called ``<name>_<own name>``.

        Raises:
            ModelError: If there are fewer than two, or a joint mimics another.
        """
        parts = [
            (Part(f"{name}_", robot.source, place), robot.model)
            for name, (robot, place) in robots.items()
        ]
        model = combine(parts)
        homes = [robot.joint_positions(robot.home()) for robot, _ in robots.values()]
        source = RobotSource(
            name="+".join(part.source.name for part, _ in parts),
            urdf=parts[0][0].source.urdf,
            origin="combined",
            home=tuple(float(x) for home in homes for x in home),
        )
        return cls(model, source, [part for part, _ in parts])

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, nq={self.nq}, nv={self.nv})"

    def __reduce__(self) -> tuple[Any, ...]:
        if self.mimics:
            # A restored model would end the process: Pinocchio's archives leave out
            # what its mimic joints refer to (seen with 4.1).
            raise ModelError(
                f"{self.name}: a robot with mimic joints cannot be pickled; "
                "load it in each process, or with mimic=False"
            )
        return (type(self), (self.model, self.source, self.parts))

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return type(self)(self.model.copy(), self.source, self.parts)

    @property
    def joint_coordinates(self) -> Array | None:
        """The matrix A of the coordinates theta = A q that the literature uses, if any.

        For the planar arm theta are the absolute angles, measured from the horizontal.
        """
        if self.source.joint_coordinates != "absolute":
            return None
        return np.tril(np.ones((self.nv, self.nv)))

    @property
    def end_effector(self) -> str:
        """The frame of its hand: as its source says, or the likeliest by its joints."""
        named = self.source.end_effector
        if named is not None and named in self._frame_ids:
            return named
        return end_effector_frame(self.model)

    # -- names ------------------------------------------------------------------------

    def frame_id(self, name: str) -> int:
        """Return the index of a frame in the Pinocchio model.

        Raises:
            FrameNotFoundError: If there is none; the message names the nearest.
        """
        try:
            return self._frame_ids[name]
        except KeyError:
            raise FrameNotFoundError(
                f"no frame {name!r}{did_you_mean(name, self.frame_names)} "
                f"(the model has {listing(self.frame_names)})"
            ) from None

    def velocity_index(self, joint: str) -> slice:
        """Return the place of a joint's freedoms in a velocity.

        Raises:
            JointNotFoundError: If there is no such joint, or it has no freedom.
        """
        if joint not in self.joints:
            raise JointNotFoundError(
                f"no joint {joint!r}{did_you_mean(joint, self.joint_names)} "
                f"(the model has {listing(self.joint_names)})"
            )
        model = self.joints[joint]
        return slice(model.idx_v, model.idx_v + model.nv)

    # -- dynamics ---------------------------------------------------------------------

    def state(self, t: float, q: Any, v: Any) -> "RobotState":
        """Return the state at time t [s]: see `RobotState`. Its memory is its own."""
        return RobotState(self).update(
            t, self.check_configuration(q), self.check_tangent(v, "velocity v")
        )

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Return the effort M(q) a + N(q, v), shape (nv,) (RNEA)."""
        return np.array(pin.rnea(self.model, self._data, q, v, a))

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration M(q)⁻¹ (tau - N(q, v)), shape (nv,).

        By ABA; by CRBA and a Cholesky solve where joints mimic others, which ABA does
        not know.
        """
        if not self.mimics:
            return np.array(pin.aba(self.model, self._data, q, v, tau))
        mass_matrix = pin.crba(self.model, self._data, q)
        effects = pin.nonLinearEffects(self.model, self._data, q, v)
        try:
            return np.asarray(np.linalg.solve(mass_matrix, tau - effects))
        except np.linalg.LinAlgError:
            raise ModelError(
                f"{self.name}: the mass matrix is singular at this configuration"
            ) from None


class RobotState:
    """The robot at one instant: if you hold one, its terms exist and agree.

    Each quantity is computed once, when it is first asked for, and kept until the next
    `update`. Arrays handed out belong to the state and change with it: copy what must
    outlive it. A state is for one thread.

    Attributes:
        robot: The robot.
        t: Time [s].
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        instant: A number that changes with every `update`, shape (1,): what is computed
            may be kept until then.
        data: Pinocchio's data at (q, v), for terms that are not offered here.
    """

    def __init__(self, robot: Robot) -> None:
        """Allocate everything; `update` makes it a state."""
        self.robot = robot
        self.t = 0.0
        self.q: Array = robot.neutral()
        self.v: Array = np.zeros(robot.nv)
        self.data: pin.Data = robot.model.createData()
        self._move = partial(
            pin.computeJointJacobiansTimeVariation,
            robot.model,
            self.data,
            self.q,
            self.v,
        )
        self._inverse_dynamics = partial(
            pin.rnea, robot.model, self.data, self.q, self.v
        )
        self._world: WorldKinematics | None = None
        self._unit_blocks = np.array(robot.unit_blocks, dtype=np.int64).reshape(-1, 2)
        self._frames: dict[str, FrameKinematics] = {}
        self.instant: Indices = np.zeros(1, dtype=np.int64)
        self._mass_matrix_stamp = self._mass_matrix_rate_stamp = -1
        self._coriolis_stamp = self._effects_stamp = self._centroidal_stamp = -1
        self._centroidal: CentroidalMotion | None = None
        self._mass_matrix_rate: Array = np.zeros((robot.nv, robot.nv))
        self._displaced: RobotState | None = None

    def update(self, t: float, q: Array, v: Array) -> Self:
        """Move to time t [s], configuration q (nq,) and velocity v (nv,), in place.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v holds a NaN or an infinity.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        robot, own_q, own_v = self.robot, self.q, self.v
        t = float(t)
        try:
            taken = q.ndim == v.ndim == 1 and _take(
                t, q, v, own_q, own_v, self._unit_blocks, self.instant
            )
        except AttributeError:  # lists are welcome, too
            taken = False
        if not taken:
            # Off the hot path: find out what is wrong, and say it.
            q = robot.check_configuration(q)
            v = robot.check_tangent(v, "velocity v")
            if not np.isfinite(t):
                raise NonFiniteError(f"time t is {t}; needs a finite number of seconds")
            own_q[:], own_v[:] = q, v
            self.instant[0] += 1
        self.t = t
        self._move()
        return self

    def frame(self, name: str) -> FrameKinematics:
        """Return the frame's placement, Jacobian, its time derivative and its motion.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        frame = self._frames.get(name)
        if frame is None:
            index = self.robot.frame_id(name)
            frame = FrameKinematics(
                self.robot.model, self.data, self.v, self.instant, index
            )
            self._frames[name] = frame
        frame.compute()
        return frame

    def position(self, frame: str) -> Array:
        """Return the origin of a frame in the world [m], shape (3,)."""
        return self.frame(frame).position

    @property
    def centroidal(self) -> CentroidalMotion:
        """The centre of mass, the angular momentum about it, and their Jacobians."""
        if self._centroidal is None:
            self._centroidal = CentroidalMotion(
                self.robot.model, self.data, self.q, self.v
            )
        if self._centroidal_stamp != self.stamp:
            self._centroidal.update()
            self._centroidal_stamp = self.stamp
        return self._centroidal

    @property
    def mass_matrix(self) -> Array:
        """M(q), shape (nv, nv) (CRBA)."""
        if self._mass_matrix_stamp != self.stamp:
            pin.crba(self.robot.model, self.data, self.q)
            self._mass_matrix_stamp = self.stamp
        return matrix_view(self.data.M)

    @property
    def coriolis_matrix(self) -> Array:
        """C(q, v), with C v the Coriolis and centrifugal efforts, shape (nv, nv)."""
        if self._coriolis_stamp != self.stamp:
            pin.computeCoriolisMatrix(self.robot.model, self.data, self.q, self.v)
            self._coriolis_stamp = self.stamp
        return matrix_view(self.data.C)

    @property
    def mass_matrix_rate(self) -> Array:
        """M' = C + Cᵀ along v, shape (nv, nv)."""
        if self._mass_matrix_rate_stamp != self.stamp:
            model = self.robot.model
            if self.robot.mimics:
                self._mass_matrix_rate[:] = mass_matrix_difference(
                    model, self.q, self.v
                )
            else:
                C = self.coriolis_matrix
                np.add(C, C.T, out=self._mass_matrix_rate)
            self._mass_matrix_rate_stamp = self.stamp
        return self._mass_matrix_rate

    @property
    def nonlinear_effects(self) -> Array:
        """N(q, v): Coriolis, centrifugal and gravity efforts, shape (nv,) (RNEA)."""
        if self._effects_stamp != self.stamp:
            pin.nonLinearEffects(self.robot.model, self.data, self.q, self.v)
            self._effects_stamp = self.stamp
        return self.data.nle  # type: ignore[no-any-return]

    def inverse_dynamics(self, acceleration: Array) -> Array:
        """Return the effort M a + N for an acceleration of shape (nv,) (RNEA)."""
        return self._inverse_dynamics(acceleration)  # type: ignore[no-any-return]

    @property
    def stamp(self) -> int:
        """A number that changes with every `update`: what is computed may be kept."""
        return int(self.instant[0])

    @property
    def world(self) -> "WorldKinematics":
        """All joints seen from the world's origin; the arrays follow the state."""
        if self._world is None:
            self._world = WorldKinematics(
                joint_placements(self.data),
                matrix_view(self.data.J),
                matrix_view(self.data.dJ),
                self.v,
            )
        return self._world

    def displaced(self, dt: float, displacement: Array) -> "RobotState":
        """Return the state at (t + dt, q ⊕ displacement) with the same velocity.

        It is the companion of this state: one place in memory, moved by every call.
        Finite differences use it.
        """
        if self._displaced is None:
            self._displaced = RobotState(self.robot)
        q = pin.integrate(self.robot.model, self.q, displacement)
        return self._displaced.update(self.t + dt, q, self.v)

    def ahead(self, dt: float) -> "RobotState":
        """Return the companion state at (t + dt, q ⊕ v dt), the flow of v."""
        return self.displaced(dt, self.v * dt)


class WorldKinematics(NamedTuple):
    """All joints seen from the world's origin: what distances are computed from.

    Attributes:
        placements: Where they are, shape (njoints, 12), see `joint_placements`.
        jacobian: Their columns at the world's origin, shape (6, nv_extended), see
            `joint_support`.
        jacobian_dot: Its time derivative, of the same shape.
        v: The velocity, shape (nv,).
    """

    placements: Array
    jacobian: Array
    jacobian_dot: Array
    v: Array


@kernel
def _take(
    t: float,
    q_in: Array,
    v_in: Array,
    q: Array,
    v: Array,
    unit_blocks: Indices,
    instant: Indices,
) -> bool:
    """Copy q and v if they fit, are finite and of norm 1 in unit blocks; were they?"""
    if q_in.shape[0] != q.shape[0] or v_in.shape[0] != v.shape[0]:
        return False
    total = t
    for i in range(q.shape[0]):
        total += q_in[i]
    for i in range(v.shape[0]):
        total += v_in[i]
    ok = np.isfinite(total)
    for k in range(unit_blocks.shape[0]):
        square = 0.0
        for i in range(unit_blocks[k, 0], unit_blocks[k, 0] + unit_blocks[k, 1]):
            square += q_in[i] * q_in[i]
        ok = ok and abs(square - 1.0) < 2e-6
    if ok:
        for i in range(q.shape[0]):
            q[i] = q_in[i]
        for i in range(v.shape[0]):
            v[i] = v_in[i]
        instant[0] += 1
    return bool(ok)
