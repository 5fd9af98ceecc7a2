"""The robot, and its state: every kinematic and dynamic quantity, computed once.

This is the only module that asks Pinocchio for kinematics and dynamics.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array, Indices
from hsp_control.exceptions import (
    ConfigurationError,
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    NonFiniteError,
    ShapeError,
)
from hsp_control.kernels import kernel
from hsp_control.loading import (
    RobotSource,
    Root,
    ToolFrame,
    find_robot,
    load_model,
    moving_joints,
)
from hsp_control.suggest import did_you_mean, listing


class Robot:
    """A robot's model: its joints, frames, limits and dynamics.

    Configurations q have shape (nq,); velocities, accelerations, efforts, gradients
    and errors live in the tangent space and have shape (nv,). Nothing assumes nq = nv.
    A robot is never changed after it has been built and holds no meshes.

    Attributes:
        model: The Pinocchio model.
        source: Where it was loaded from.
        nq: Numbers in a configuration.
        nv: Freedoms.
        joints: The joints that have freedoms, by name, in the order of velocities.
        joint_names: Their names.
        freedom_names: A name for each freedom, ``root_joint.x`` where a joint has many.
        frame_names: Names of all frames.
        unit_blocks: (start, size) of every quaternion and (cos, sin) pair in q.
        flat: Whether every joint has one freedom, so that δ' = v holds globally.
        mimics: Whether some joints follow others.
    """

    def __init__(self, model: pin.Model, source: RobotSource) -> None:
        """Wrap a Pinocchio model; most callers want `Robot.load`."""
        self.model = model
        self.source = source
        self.nq: int = model.nq
        self.nv: int = model.nv
        self.frame_names: tuple[str, ...] = tuple(f.name for f in model.frames)
        self._frame_ids = {name: i for i, name in enumerate(self.frame_names)}
        self.joints = moving_joints(model)
        self.joint_names: tuple[str, ...] = tuple(self.joints)
        self.freedom_names: tuple[str, ...] = _freedom_names(self.joints)
        self.unit_blocks: tuple[tuple[int, int], ...] = _unit_blocks(self.joints)
        self.flat: bool = all(joint.nv == 1 for joint in self.joints.values())
        self.mimics: bool = model.nvExtended != model.nv
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

        Raises:
            RobotNotFoundError: If there is no such robot.
            ModelError: If the URDF does not parse or moves no mass somewhere.
            JointNotFoundError: If a joint to lock does not exist.
            FrameNotFoundError: If a tool frame's parent does not exist.
        """
        source = find_robot(name)
        model = load_model(
            source,
            root=root,
            locked=locked,
            tool_frames=tool_frames,
            gravity=gravity,
            mimic=mimic,
        )
        return cls(model, source)

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
        return (type(self), (self.model, self.source))

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return type(self)(self.model.copy(), self.source)

    @property
    def name(self) -> str:
        """The name that the robot was loaded by."""
        return self.source.name

    @property
    def joint_coordinates(self) -> Array | None:
        """The matrix A of the coordinates theta = A q that the literature uses, if any.

        For the planar arm theta are the absolute angles, measured from the horizontal.
        """
        if self.source.joint_coordinates != "absolute":
            return None
        return np.tril(np.ones((self.nv, self.nv)))

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

    # -- configuration space ----------------------------------------------------------

    def neutral(self) -> Array:
        """Return the configuration with every joint at zero, shape (nq,)."""
        return np.asarray(pin.neutral(self.model))

    def home(self) -> Array:
        """Return the posture that the robot's source recommends, or the neutral one.

        Where neutral lies outside the limits, the joint is put in their middle.
        """
        if self.source.home is not None and len(self.source.home) == self.nv:
            return self.integrate(self.neutral(), np.asarray(self.source.home))
        lower, upper = self.position_limits()
        bounded = np.isfinite(lower) & np.isfinite(upper)
        middle = np.zeros(self.nv)
        middle[bounded] = 0.5 * (lower[bounded] + upper[bounded])
        inside = (lower < 0.0) & (upper > 0.0)
        middle[inside] = 0.0
        return self.integrate(self.neutral(), middle)

    def random_configuration(self, rng: np.random.Generator) -> Array:
        """Draw a configuration: uniform within limits, any angle where there are none.

        A floating root is drawn within a unit box, with a uniform orientation.
        """
        lower, upper = self.position_limits()
        bounded = np.isfinite(lower) & np.isfinite(upper)
        low = np.where(bounded, lower, -np.pi)
        high = np.where(bounded, upper, np.pi)
        q = self.integrate(self.neutral(), rng.uniform(low, high))
        for joint in self.joints.values():
            if joint.shortname() == "JointModelFreeFlyer":
                quaternion = rng.standard_normal(4)
                q[joint.idx_q : joint.idx_q + 3] = rng.uniform(-1.0, 1.0, 3)
                q[joint.idx_q + 3 : joint.idx_q + 7] = quaternion / np.linalg.norm(
                    quaternion
                )
        return q

    def integrate(self, q: Array, displacement: Array) -> Array:
        """Return q ⊕ displacement, shape (nq,)."""
        return np.asarray(pin.integrate(self.model, q, displacement))

    def difference(self, start: Array, end: Array) -> Array:
        """Return end ⊖ start: the displacement that leads from start to end, (nv,)."""
        return np.asarray(pin.difference(self.model, start, end))

    def joint_positions(self, q: Array) -> Array:
        """Return every joint's position [rad or m], shape (nv,): the log from neutral.

        Continuous joints come as angles in (-pi, pi].
        """
        return self.difference(self.neutral(), q)

    def position_limits(self) -> tuple[Array, Array]:
        """Return lower and upper joint positions, shape (nv,); ±inf where unlimited.

        Continuous joints and the root have no limits, whatever the model's numbers.
        """
        lower = np.full(self.nv, -np.inf)
        upper = np.full(self.nv, np.inf)
        for joint in self.joints.values():
            if joint.nq == 1 and joint.nv == 1:
                lower[joint.idx_v] = self.model.lowerPositionLimit[joint.idx_q]
                upper[joint.idx_v] = self.model.upperPositionLimit[joint.idx_q]
        largest = np.finfo(float).max  # Pinocchio's word for unlimited
        lower[lower <= -largest] = -np.inf
        upper[upper >= largest] = np.inf
        return lower, upper

    def check_configuration(self, q: Any) -> Array:
        """Return q as a float array of shape (nq,) that is a configuration.

        Raises:
            ShapeError: If its shape is not (nq,).
            NonFiniteError: If it holds a NaN or an infinity.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        configuration = _check_vector(q, self.nq, "configuration q", self)
        for start, size in self.unit_blocks:
            block = configuration[start : start + size]
            norm = float(np.linalg.norm(block))
            if abs(norm - 1.0) > 1e-6:
                kind = "(cos, sin) pair" if size == 2 else "quaternion"
                raise ConfigurationError(
                    f"q[{start}:{start + size}] = {block.tolist()} is a {kind} "
                    f"of norm {norm:.6g}; needs norm 1"
                )
        return configuration

    def check_tangent(self, vector: Any, what: str) -> Array:
        """Return a velocity, acceleration or effort as a float array of shape (nv,).

        Raises:
            ShapeError: If its shape is not (nv,).
            NonFiniteError: If it holds a NaN or an infinity.
        """
        return _check_vector(vector, self.nv, what, self)

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
        return np.asarray(np.linalg.solve(mass_matrix, tau - effects))


class FrameKinematics:
    """Where a frame is and how it moves, in world axes, linear before angular.

    Attributes:
        rotation: World ← frame, shape (3, 3).
        position: Its origin in the world [m], shape (3,).
        jacobian: J with (velocity of the origin, angular velocity) = J v, (6, nv).
        jacobian_dot: J' = dJ/dt along v, exact, shape (6, nv).
        velocity: J v, shape (6,) [m/s, rad/s].
        drift: J' v, shape (6,): the classical acceleration when v' = 0.
    """

    __slots__ = (
        "_columns",
        "_freedoms",
        "_id",
        "_stamp",
        "drift",
        "jacobian",
        "jacobian_dot",
        "position",
        "rotation",
        "velocity",
    )

    def __init__(self, robot: Robot, data: pin.Data, index: int) -> None:
        """Allocate; `RobotState.frame` fills it."""
        nv = robot.nv
        self.rotation: Array = data.oMf[index].rotation  # views: they follow the data
        self.position: Array = data.oMf[index].translation
        self.jacobian: Array = np.zeros((6, nv))
        self.jacobian_dot: Array = np.zeros((6, nv))
        self.velocity: Array = np.zeros(6)
        self.drift: Array = np.zeros(6)
        self._id = index
        self._stamp = -1
        self._columns, self._freedoms = joint_support(
            robot.model, robot.model.frames[index].parentJoint
        )


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
        data: Pinocchio's data at (q, v), for terms that are not offered here.
    """

    def __init__(self, robot: Robot) -> None:
        """Allocate everything; `update` makes it a state."""
        self.robot = robot
        self.t = 0.0
        self.q: Array = robot.neutral()
        self.v: Array = np.zeros(robot.nv)
        self.data: pin.Data = robot.model.createData()
        self._J: Array = self.data.J  # views: they follow the data
        self._J_dot: Array = self.data.dJ
        self._unit_blocks = np.array(robot.unit_blocks, dtype=np.int64).reshape(-1, 2)
        self._frames: dict[str, FrameKinematics] = {}
        self._stamp = 0
        self._mass_matrix_stamp = self._mass_matrix_rate_stamp = -1
        self._effects_stamp = -1
        self._mass_matrix_rate: Array = np.zeros((robot.nv, robot.nv))
        self._displaced: RobotState | None = None

    def update(self, t: float, q: Array, v: Array) -> Self:
        """Move to time t [s], configuration q (nq,) and velocity v (nv,), in place.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v holds a NaN or an infinity.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        robot = self.robot
        if (
            getattr(q, "shape", None) != (robot.nq,)
            or getattr(v, "shape", None) != (robot.nv,)
            or not _take(float(t), q, v, self.q, self.v, self._unit_blocks)
        ):
            # Off the hot path: find out what is wrong, and say it.
            q = robot.check_configuration(q)
            v = robot.check_tangent(v, "velocity v")
            if not np.isfinite(t):
                raise NonFiniteError(f"time t is {t}; needs a finite number of seconds")
            self.q[:], self.v[:] = q, v
        self.t = float(t)
        self._stamp += 1
        pin.computeJointJacobiansTimeVariation(robot.model, self.data, self.q, self.v)
        return self

    def frame(self, name: str) -> FrameKinematics:
        """Return the frame's placement, Jacobian, its time derivative and its motion.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        frame = self._frames.get(name)
        if frame is None:
            index = self.robot.frame_id(name)
            frame = FrameKinematics(self.robot, self.data, index)
            self._frames[name] = frame
        if frame._stamp != self._stamp:
            pin.updateFramePlacement(self.robot.model, self.data, frame._id)
            _frame_kinematics(
                self._J,
                self._J_dot,
                frame.position,
                self.v,
                frame._columns,
                frame._freedoms,
                frame.jacobian,
                frame.jacobian_dot,
                frame.velocity,
                frame.drift,
            )
            frame._stamp = self._stamp
        return frame

    def position(self, frame: str) -> Array:
        """Return the origin of a frame in the world [m], shape (3,)."""
        return self.frame(frame).position

    @property
    def mass_matrix(self) -> Array:
        """M(q), shape (nv, nv) (CRBA)."""
        if self._mass_matrix_stamp != self._stamp:
            pin.crba(self.robot.model, self.data, self.q)
            self._mass_matrix_stamp = self._stamp
        return self.data.M  # type: ignore[no-any-return]

    @property
    def mass_matrix_rate(self) -> Array:
        """M' = C + Cᵀ along v, shape (nv, nv)."""
        if self._mass_matrix_rate_stamp != self._stamp:
            model = self.robot.model
            if self.robot.mimics:
                self._mass_matrix_rate[:] = _mass_matrix_difference(
                    model, self.q, self.v
                )
            else:
                C = pin.computeCoriolisMatrix(model, self.data, self.q, self.v)
                np.add(C, C.T, out=self._mass_matrix_rate)
            self._mass_matrix_rate_stamp = self._stamp
        return self._mass_matrix_rate

    @property
    def nonlinear_effects(self) -> Array:
        """N(q, v): Coriolis, centrifugal and gravity efforts, shape (nv,) (RNEA)."""
        if self._effects_stamp != self._stamp:
            pin.nonLinearEffects(self.robot.model, self.data, self.q, self.v)
            self._effects_stamp = self._stamp
        return self.data.nle  # type: ignore[no-any-return]

    def inverse_dynamics(self, acceleration: Array) -> Array:
        """Return the effort M a + N for an acceleration of shape (nv,) (RNEA)."""
        return pin.rnea(  # type: ignore[no-any-return]
            self.robot.model, self.data, self.q, self.v, acceleration
        )

    @property
    def stamp(self) -> int:
        """A number that changes with every `update`: what is computed may be kept."""
        return self._stamp

    @property
    def world_jacobian(self) -> Array:
        """Pinocchio's joint Jacobian at the world's origin, see `joint_support`."""
        return self._J

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


@kernel
def _take(
    t: float, q_in: Array, v_in: Array, q: Array, v: Array, unit_blocks: Indices
) -> bool:
    """Copy q and v if all is finite and each unit block is of norm 1; were they?"""
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
    return bool(ok)


@kernel
def _frame_kinematics(
    J_world: Array,
    J_world_dot: Array,
    p: Array,
    v: Array,
    columns: Indices,
    freedoms: Indices,
    J: Array,
    J_dot: Array,
    velocity: Array,
    drift: Array,
) -> None:
    """Move the joints' Jacobian and its rate from the world's origin to a point.

    A column (l, w) at the origin reads (l + w × p, w) at the point p, and its rate
    (l' + w' × p + w × p', w'). Only joints that carry the frame have columns; those of
    joints that mimic add to their leader's.
    """
    for k in range(columns.shape[0]):
        j = freedoms[k]
        for i in range(6):
            J[i, j] = 0.0
            J_dot[i, j] = 0.0
    for i in range(6):
        velocity[i] = 0.0
        drift[i] = 0.0
    for k in range(columns.shape[0]):
        c, j = columns[k], freedoms[k]
        wx, wy, wz = J_world[3, c], J_world[4, c], J_world[5, c]
        J[0, j] += J_world[0, c] + wy * p[2] - wz * p[1]
        J[1, j] += J_world[1, c] + wz * p[0] - wx * p[2]
        J[2, j] += J_world[2, c] + wx * p[1] - wy * p[0]
        J[3, j] += wx
        J[4, j] += wy
        J[5, j] += wz
    for j in range(v.shape[0]):
        for i in range(6):
            velocity[i] += J[i, j] * v[j]
    ux, uy, uz = velocity[0], velocity[1], velocity[2]
    for k in range(columns.shape[0]):
        c, j = columns[k], freedoms[k]
        wx, wy, wz = J_world[3, c], J_world[4, c], J_world[5, c]
        ax, ay, az = J_world_dot[3, c], J_world_dot[4, c], J_world_dot[5, c]
        J_dot[0, j] += J_world_dot[0, c] + ay * p[2] - az * p[1] + wy * uz - wz * uy
        J_dot[1, j] += J_world_dot[1, c] + az * p[0] - ax * p[2] + wz * ux - wx * uz
        J_dot[2, j] += J_world_dot[2, c] + ax * p[1] - ay * p[0] + wx * uy - wy * ux
        J_dot[3, j] += ax
        J_dot[4, j] += ay
        J_dot[5, j] += az
    for j in range(v.shape[0]):
        for i in range(6):
            drift[i] += J_dot[i, j] * v[j]


def _mass_matrix_difference(model: pin.Model, q: Array, v: Array) -> Array:
    """Return M' by fourth-order differences along v, good to 1e-11 of M.

    For robots with mimic joints, which Pinocchio's Coriolis matrix does not know.
    """
    data, h = model.createData(), 1e-3 / max(1.0, float(np.abs(v).max()))

    def M(s: float) -> Array:
        return np.array(pin.crba(model, data, pin.integrate(model, q, s * v)))

    return (8.0 * (M(h) - M(-h)) - (M(2.0 * h) - M(-2.0 * h))) / (12.0 * h)


def joint_support(model: pin.Model, joint: int) -> tuple[Indices, Indices]:
    """Return the columns of Pinocchio's J that move a joint, and their freedoms.

    The two differ where joints mimic others: such a joint has a column of its own,
    already scaled, and its leader's freedom.
    """
    columns: list[int] = []
    freedoms: list[int] = []
    for index in list(model.supports[joint])[1:]:  # not the universe
        part = model.joints[index]
        width = part.nvExtended
        columns.extend(range(part.idx_vExtended, part.idx_vExtended + width))
        freedoms.extend(range(part.idx_v, part.idx_v + width))
    return np.array(columns, dtype=np.int64), np.array(freedoms, dtype=np.int64)


def _unit_blocks(joints: Mapping[str, Any]) -> tuple[tuple[int, int], ...]:
    blocks = []
    for joint in joints.values():
        if joint.nq == joint.nv + 1:
            size = 2 if joint.nv in {1, 3} else 4
            if joint.shortname() == "JointModelSpherical":
                size = 4
            blocks.append((joint.idx_q + joint.nq - size, size))
    return tuple(blocks)


def _freedom_names(joints: Mapping[str, Any]) -> tuple[str, ...]:
    suffixes = {
        3: ("x", "y", "yaw"),
        6: ("x", "y", "z", "roll", "pitch", "yaw"),
    }
    names: list[str] = []
    for name, joint in joints.items():
        if joint.nv == 1:
            names.append(name)
        else:
            labels = suffixes.get(joint.nv, tuple(str(k) for k in range(joint.nv)))
            names.extend(f"{name}.{label}" for label in labels)
    return tuple(names)


def _check_vector(vector: Any, size: int, what: str, robot: Robot) -> Array:
    try:
        array = np.asarray(vector, dtype=float)
    except (TypeError, ValueError):
        raise ShapeError(f"{what} is not an array of {size} numbers") from None
    if array.shape != (size,):
        raise ShapeError(
            f"{what} has shape {array.shape}; {robot.name} needs ({size},)"
            + (f" (nq = {robot.nq}, nv = {robot.nv})" if robot.nq != robot.nv else "")
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise NonFiniteError(
            f"{what}[{bad[0]}] is {array[bad[0]]}; needs finite numbers"
        )
    return array
