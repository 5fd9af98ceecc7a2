"""The robot and its state: kinematic and dynamic terms, each computed once per state.

The controller gets its kinematics and dynamics from `RobotState`, which calls Pinocchio
here, in `kinematics` and in `centroidal`. Other modules call Pinocchio directly only
for what a state does not offer: loading and checks of models, integration, collision
geometry, derivatives of gravity, plants with models of their own, and the viewer.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar, cast

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    NonFiniteError,
)
from hsp_control.common.kernels import is_compiled, kernel
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within
from hsp_control.robot.centroidal import CentroidalMotion
from hsp_control.robot.configuration_space import ConfigurationSpace, as_numbers
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.combining import Part, combine, placement
from hsp_control.robot.description.loading import (
    end_effector_frame,
    load_model,
    reference_posture,
)
from hsp_control.robot.description.mujoco.selection import select
from hsp_control.robot.description.mujoco.source import load_mjcf, load_selection
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource, Root, find_robot
from hsp_control.robot.kinematics import (
    FrameKinematics,
    joint_placements,
    mass_matrix_difference,
)
from hsp_control.robot.matrix_view import matrix_view

Made = TypeVar("Made")

_LIMB = 4
"""Fewest joints of an arm or a leg; heads and fingers have fewer."""
_DOUBLE = np.dtype(np.float64)
_PACKED = (8,)
"""Strides of a vector of doubles one after another."""

_MADE_LIMIT = 1000
"""Number of parts whose memory a state keeps; then it starts anew."""


class Robot(ConfigurationSpace):
    """A robot's model: its joints, frames, limits and dynamics.

    Configurations q have shape (nq,). Velocities, accelerations, efforts, gradients
    and errors are tangent vectors of shape (nv,). Nothing assumes nq = nv. A robot does
    not change after it has been built, and it contains no meshes.

    Attributes:
        source: Where it was loaded from.
        description: What `load` was given; None for a robot made otherwise.
        parts: The robots that it consists of: itself only, unless it was combined.
        frame_names: Names of all frames.
    """

    def __init__(
        self,
        model: pin.Model,
        source: RobotSource,
        parts: Sequence[Part] = (),
        description: RobotDescription | None = None,
    ) -> None:
        """Wrap a Pinocchio model; `Robot.load` is the usual way to create a robot."""
        super().__init__(
            model, source.name, source.home or reference_posture(model, source)
        )
        self.source = source
        self.description = description
        self.parts = tuple(parts) or (Part("", source, pin.SE3.Identity()),)
        self.frame_names: tuple[str, ...] = tuple(f.name for f in model.frames)
        # If a joint and a link have the same name, it means the link's frame.
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
        name: str | Path | RobotDescription,
        *,
        root: Root | None = None,
        locked: Mapping[str, float] | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
        gravity: ArrayLike | None = None,
        mimic: bool = True,
        access: Access = ANYWHERE,
    ) -> Self:
        """Load a bundled robot, one of example-robot-data, or a URDF file.

        Args:
            name: For example ``"panda"``, ``"talos_arm"`` or ``"my_arm/arm.urdf"``; or
                a whole description, and then nothing else.
            root: How its base is attached to the world: ``fixed``, ``planar``
                (x, y, yaw) or ``free_flyer``. None: as its source says; ``fixed`` for a
                file.
            locked: Joints to lock, name to value [rad or m]. None: as its source says
                (the bundled Panda locks its fingers); ``{}``: none.
            tool_frames: Frames to add, by name.
            gravity: Acceleration of gravity in the world [m/s²], shape (3,). None:
                -9.81 along z.
            mimic: Whether ``<mimic>`` joints follow their leader. False: they are
                independent joints.
            access: Which files may be read: a URDF given by path, and the meshes that
                it names. Use `access.only_within` for untrusted files.

        Raises:
            RobotNotFoundError: If there is no such robot.
            AccessError: If a file is not allowed.
            ModelError: If an option is wrong or does not fit the model, the URDF is
                invalid, or the mass matrix is singular.
            JointNotFoundError: If a joint to lock does not exist.
            FrameNotFoundError: If a tool frame's parent does not exist.
        """
        if not isinstance(name, RobotDescription):
            name = RobotDescription(
                name,
                root=root,
                locked=locked,
                tool_frames=tool_frames or {},
                gravity=gravity,
                mimic=mimic,
            )
        elif not mimic or any(
            option is not None for option in (root, locked, tool_frames, gravity)
        ):
            raise ModelError(
                "a RobotDescription says all about the robot: give root, locked, "
                "tool_frames, gravity and mimic in it"
            )
        return cls._described(name, access)

    @classmethod
    def from_mujoco(
        cls,
        model: Any,
        root: str | None = None,
        joints: Sequence[str] | None = None,
        *,
        qpos: ArrayLike | None = None,
        keyframe: str | None = None,
        locked: Mapping[str, float] | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
    ) -> Self:
        """Return a robot in a compiled MuJoCo model: with the numbers MuJoCo uses.

        Bodies and sites are its frames, under their names. Bodies that are not below
        the root are no part of it; those above the root stand still. What MuJoCo has
        and the robot lacks, such as a closed loop, is in `source.omitted`, and logged
        as a warning. `MujocoCoordinates` converts states.

        Args:
            model: The scene, a ``mujoco.MjModel``.
            root: Name of the body whose subtree is the robot, with the body's own
                joints; None: the whole scene.
            joints: Names of its joints that move; None: all. The others are locked.
                q and v have MuJoCo's order, whatever the order here.
            qpos: The scene's configuration, shape (model.nq,), in which the other
                joints are locked and the robot is at home; None: ``model.qpos0``, but
                then the home of a joint that is not within its limits there is in
                their middle.
            keyframe: The name of that configuration in the model, instead.
            locked: Hinges and slides to lock elsewhere, name to value [rad or m].
            tool_frames: Frames to add, by name.

        Raises:
            ModelError: If MuJoCo is not installed, the configuration is not one of the
                scene, no joint moves, or the mass matrix is singular.
            FrameNotFoundError: If the root or a tool frame's parent does not exist.
            JointNotFoundError: If a joint does not exist or is not below the root.
        """
        selection = select(model, root, joints, qpos, keyframe, locked)
        return cls(*load_selection(selection, tool_frames or {}))

    @classmethod
    def _described(cls, description: RobotDescription, access: Access) -> Self:
        """Return the robot of a description."""
        gravity = description.gravity
        if description.mjcf is not None:
            return cls(*load_mjcf(description, access), description=description)
        if description.parts is None:
            assert description.name is not None
            source = find_robot(description.name, access)
            model = load_model(source, description, gravity)
            return cls(model, source, description=description)
        robots = {}
        for name, part in description.parts.items():
            with within("parts", name, "name"):
                source = find_robot(part.name, access)
                robot = cls(load_model(source, part, gravity), source)
            robots[name] = robot, placement(part.position, part.rotation)
        with within("parts"):
            whole = cls.combine(robots)
        whole.description = description
        return whole

    @classmethod
    def combine(cls, robots: Mapping[str, tuple["Robot", pin.SE3]]) -> Self:
        """Return one robot that consists of several robots in one workspace.

        Args:
            robots: For each name a robot and the placement of its root in the world.
                Joints and frames are renamed to ``<name>_<own name>``.

        Raises:
            ModelError: If there are fewer than two robots, one is already combined,
                their gravity differs, or one has mimic joints.
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
            # A restored model would crash the process: Pinocchio's archives omit what
            # mimic joints refer to (seen with 4.1).
            raise ModelError(
                f"{self.name}: a robot with mimic joints cannot be pickled; "
                "load it in each process, or with mimic=False"
            )
        own = self.model, self.source, self.parts, self.description
        return (type(self), own)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return type(self)(self.model.copy(), self.source, self.parts, self.description)

    @property
    def joint_coordinates(self) -> Array | None:
        """The matrix A of the coordinates theta = A q in the literature, or None.

        Shape (nv, nv). For the planar arm, theta are the absolute angles of its links,
        measured from the horizontal.
        """
        if self.source.joint_coordinates != "absolute":
            return None
        return np.tril(np.ones((self.nv, self.nv)))

    @property
    def end_effector(self) -> str:
        """The frame of the hand: as the source says, or else `end_effector_frame`."""
        named = self.source.end_effector
        if named is not None and named in self._frame_ids:
            return named
        return end_effector_frame(self.model)

    # -- names ------------------------------------------------------------------------

    def frame_id(self, name: str) -> int:
        """Return the index of a frame in the Pinocchio model.

        Raises:
            FrameNotFoundError: If there is no such frame; the message suggests one.
        """
        try:
            return self._frame_ids[name]
        except KeyError:
            raise FrameNotFoundError(
                f"no frame {name!r}{did_you_mean(name, self.frame_names)} "
                f"(the model has {listing(self.frame_names)})"
            ) from None

    def velocity_index(self, joint: str) -> slice:
        """Return the indices of a joint's degrees of freedom in v.

        Raises:
            JointNotFoundError: If there is no moving joint with this name.
        """
        if joint not in self.joints:
            raise JointNotFoundError(
                f"no joint {joint!r}{did_you_mean(joint, self.joint_names)} "
                f"(the model has {listing(self.joint_names)})"
            )
        model = self.joints[joint]
        return slice(model.idx_v, model.idx_v + model.nv)

    def is_on_trunk(self, frame: str) -> bool:
        """Return whether a frame belongs to the trunk of a robot with a floating base.

        The trunk is the base, and every body that carries two limbs or more: chains of
        at least four joints, such as arms and legs.

        Raises:
            FrameNotFoundError: If there is no such frame.
        """
        joint = self.model.frames[self.frame_id(frame)].parentJoint
        return bool(self.unactuated) and (joint == 1 or self._limbs(joint)[0] >= 2)

    def _limbs(self, joint: int) -> tuple[int, int]:
        """Return the number of limbs beyond a joint, and the joints of the longest."""
        limbs = longest = 0
        for child in range(joint + 1, self.model.njoints):
            if self.model.parents[child] == joint:
                beyond, length = self._limbs(child)
                longest = max(longest, 1 + length)
                limbs += max(beyond, int(1 + length >= _LIMB))
        return limbs, longest

    # -- dynamics ---------------------------------------------------------------------

    def state(self, t: float, q: Any, v: Any) -> "RobotState":
        """Return a new `RobotState` at time t [s], q (nq,) and v (nv,).

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        return RobotState(self).update(
            t, self.check_configuration(q), self.check_tangent(v, "velocity v")
        )

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Return the effort M(q) a + N(q, v), shape (nv,) (RNEA)."""
        return np.array(pin.rnea(self.model, self._data, q, v, a))

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration M(q)⁻¹ (tau - N(q, v)), shape (nv,).

        Computed by ABA; with mimic joints, which ABA does not support, by CRBA and a
        linear solve.

        Raises:
            ModelError: If M is singular (only detected with mimic joints).
        """
        if not self.mimics:
            return np.array(pin.aba(self.model, self._data, q, v, tau))
        return self._forward_dynamics_of_mimics(q, v, tau)

    def bind_forward_dynamics(
        self, q: Array, v: Array, tau: Array
    ) -> Callable[[], Array]:
        """Return `forward_dynamics` for what these arrays hold when it is called.

        The result is overwritten by the next call.
        """
        if not self.mimics:
            return partial(pin.aba, self.model, self._data, q, v, tau)
        return partial(self._forward_dynamics_of_mimics, q, v, tau)

    def _forward_dynamics_of_mimics(self, q: Array, v: Array, tau: Array) -> Array:
        mass_matrix = pin.crba(self.model, self._data, q)
        effects = pin.nonLinearEffects(self.model, self._data, q, v)
        try:
            return np.asarray(np.linalg.solve(mass_matrix, tau - effects))
        except np.linalg.LinAlgError:
            raise ModelError(
                f"{self.name}: the mass matrix is singular at this configuration"
            ) from None


class RobotState:
    """The robot at one time, with all its kinematic and dynamic terms.

    A term is computed at its first use and kept until the next `update`. The returned
    arrays belong to the state and change with it: copy an array to keep its values. Use
    a state in one thread only.

    Attributes:
        robot: The robot.
        t: Time [s].
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        stamp_array: `stamp` as an array of shape (1,), for kernels.
        data: Pinocchio's data at (q, v), for terms that this class does not offer.
    """

    def __init__(self, robot: Robot) -> None:
        """Allocate the memory; call `update` before using any term."""
        self.robot = robot
        self.t = 0.0
        self.q: Array = robot.neutral()
        self.v: Array = np.zeros(robot.nv)
        self.data: pin.Data = robot.model.createData()
        self._compute_jacobians = partial(
            pin.computeJointJacobiansTimeVariation,
            robot.model,
            self.data,
            self.q,
            self.v,
        )
        self._inverse_dynamics = partial(
            pin.rnea, robot.model, self.data, self.q, self.v
        )
        self._compute_mass_matrix = partial(pin.crba, robot.model, self.data, self.q)
        self._mass_matrix = matrix_view(self.data.M)
        self._world: WorldKinematics | None = None
        self._unit_blocks = np.array(robot.unit_blocks, dtype=np.int64).reshape(-1, 2)
        self._frames: dict[str, FrameKinematics] = {}
        self.stamp_array: Indices = np.zeros(1, dtype=np.int64)
        self._mass_matrix_stamp = self._mass_matrix_rate_stamp = -1
        self._coriolis_stamp = self._effects_stamp = self._centroidal_stamp = -1
        self._centroidal: CentroidalMotion | None = None
        self._mass_matrix_rate: Array = np.zeros((robot.nv, robot.nv))
        self._displaced: RobotState | None = None
        self._made: dict[tuple[int, str], tuple[object, Any]] = {}
        _compile_once()

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Move to time t [s], configuration q (nq,) and velocity v (nv,), in place.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        q_in: Any = q
        v_in: Any = v
        try:
            packed = (
                q_in.dtype is v_in.dtype is _DOUBLE
                and q_in.strides == v_in.strides == _PACKED
            )
        except AttributeError:  # a list, for example
            packed = False
        if not packed:  # a kernel would be compiled anew for each kind of array
            q_in = as_numbers(q, self.robot.nq, "configuration q", self.robot)
            v_in = as_numbers(v, self.robot.nv, "velocity v", self.robot)
        try:
            accepted = _copy_valid(
                t, q_in, v_in, self.q, self.v, self._unit_blocks, self.stamp_array
            )
        except TypeError:  # t is no number
            accepted = False
        if not accepted:
            self._refuse(t, q, v)
        self.t = t
        self._compute_jacobians()
        return self

    def _refuse(self, t: float, q: ArrayLike, v: ArrayLike) -> None:
        """Raise the error that says what is wrong with t, q and v."""
        if not isinstance(t, float | int | np.number) or not np.isfinite(t):
            raise NonFiniteError(f"time t is {t!r}; needs a finite number of seconds")
        self.robot.check_configuration(q)
        self.robot.check_tangent(v, "velocity v")
        raise NonFiniteError(f"t = {t!r}, q = {q!r}, v = {v!r}: their sum overflows")

    def frame(self, name: str) -> FrameKinematics:
        """Return the placement, the Jacobian and the motion of a frame.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        frame = self._frames.get(name)
        if frame is None:
            index = self.robot.frame_id(name)
            frame = FrameKinematics(
                self.robot.model, self.data, self.v, self.stamp_array, index
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
        stamp = self.stamp
        if self._mass_matrix_stamp != stamp:
            self._compute_mass_matrix()
            self._mass_matrix_stamp = stamp
        return self._mass_matrix

    @property
    def coriolis_matrix(self) -> Array:
        """C(q, v), where C v are Coriolis and centrifugal efforts, shape (nv, nv)."""
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
        """Return the effort M a + N, shape (nv,), for an acceleration (nv,) (RNEA)."""
        return self._inverse_dynamics(acceleration)  # type: ignore[no-any-return]

    @property
    def stamp(self) -> int:
        """A number that changes with every `update`: use it to invalidate caches."""
        return int(self.stamp_array[0])

    @property
    def world(self) -> "WorldKinematics":
        """Placements and Jacobians of all joints at the world's origin, as views."""
        if self._world is None:
            self._world = WorldKinematics(
                joint_placements(self.data),
                matrix_view(self.data.J),
                matrix_view(self.data.dJ),
                self.v,
            )
        return self._world

    def made(self, part: object, what: str, make: Callable[[], Made]) -> Made:
        """Return what ``make`` returned for a part and this state; it is called once.

        ``what`` tells apart what a class and its subclasses keep.

        Parts are values and have no memory. What they compute with at a state, such as
        buffers and compiled calls, is kept here, so that one part may serve many
        states, in many threads.
        """
        key = id(part), what
        found = self._made.get(key)
        if found is None:
            if len(self._made) >= _MADE_LIMIT:
                self._made.clear()
            self._made[key] = found = part, make()  # keeps the part, and its id
        made: Made = found[1]
        return made

    def __getstate__(self) -> dict[str, Any]:
        return {"robot": self.robot, "t": self.t, "q": self.q, "v": self.v}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["robot"])  # type: ignore[misc]
        self.update(state["t"], state["q"], state["v"])

    def displaced(self, dt: float, displacement: Array) -> "RobotState":
        """Return the state at (t + dt, q ⊕ displacement) with the same velocity.

        For finite differences. Each call overwrites and returns the same object, the
        companion of this state.

        Args:
            dt: Time difference [s].
            displacement: Shape (nv,) [rad or m].
        """
        if self._displaced is None:
            self._displaced = RobotState(self.robot)
        q = pin.integrate(self.robot.model, self.q, displacement)
        return self._displaced.update(self.t + dt, q, self.v)

    def ahead(self, dt: float) -> "RobotState":
        """Return the companion state at (t + dt, q ⊕ v dt), see `displaced`; dt [s]."""
        return self.displaced(dt, self.v * dt)


class WorldKinematics(NamedTuple):
    """Placements and Jacobians of all joints, from which distances are computed.

    Attributes:
        placements: Placements of the joints, shape (njoints, 12): see
            `joint_placements`.
        jacobian: Pinocchio's J, in world axes at the world's origin, shape
            (6, nvExtended): see `joint_support`.
        jacobian_dot: Its time derivative, shape (6, nvExtended).
        v: The velocity, shape (nv,).
    """

    placements: Array
    jacobian: Array
    jacobian_dot: Array
    v: Array


@cache
def _compile_once() -> None:
    """Compile `_copy_valid` for packed doubles, and for nothing else, ever.

    Numba takes an array that may be written for one that may not, but looks it up for
    longer; so there is a version for both.
    """
    if is_compiled(_copy_valid):
        from numba import types

        own, kernel = types.float64[::1], cast("Any", _copy_valid)
        given = own, types.Array(types.float64, 1, "C", readonly=True)
        rest = own, own, types.int64[:, ::1], types.int64[::1]
        for each in given:
            kernel.compile((types.float64, each, each, *rest))
        kernel.disable_compile()


@kernel
def _copy_valid(
    t: float,
    q_in: Array,
    v_in: Array,
    q: Array,
    v: Array,
    unit_blocks: Indices,
    stamp: Indices,
) -> bool:
    """Copy q and v if they are valid; return whether they are.

    Valid means of the right size, finite, and of norm 1 in the unit blocks.
    """
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
        stamp[0] += 1
    return bool(ok)
