"""The robot and its state: kinematic and dynamic terms, each computed once per state.

The controller gets its kinematics and dynamics from `RobotState`, which calls Pinocchio
here and in `kinematics`. Other modules call Pinocchio directly only for what a state
does not offer: loading and checks of models, integration, collision geometry,
derivatives of gravity, plants with models of their own, and the viewer.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices, kept_view, matrix_view
from hsp_control.common.entry_points import entry_points
from hsp_control.common.exceptions import (
    ImmutableError,
    ModelError,
    NonFiniteError,
    ShapeError,
)
from hsp_control.compiled.kernels import KernelCalls
from hsp_control.compiled.native import NativeCall, StepPlan, once, planned
from hsp_control.compiled.pinocchio_calls import bind_pinocchio
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Vector
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.from_pinocchio import take_model
from hsp_control.robot.description.loading import (
    RobotPart,
    combine,
    end_effector_frame,
    load_model,
    placement,
    reference_posture,
)
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource, Root
from hsp_control.robot.kinematics import (
    CentroidalMotion,
    FrameKinematics,
    WorldKinematics,
    inertia_terms,
    joint_placements,
)
from hsp_control.robot.model import RobotModel
from hsp_control.robot.motion import REFUSED, copy_valid

Made = TypeVar("Made")

Move = Callable[[float, Array, Array], float]
"""(t, q, v) ↦ what the last of its calls returned, or `REFUSED`."""

_DOUBLE = np.dtype(np.float64)

_MADE_LIMIT = 1000
"""Number of parts whose memory a state keeps; then it starts anew."""


class Robot(RobotModel):
    """A robot: its `RobotModel`, where that comes from, and states of it.

    Attributes:
        source: Where it was loaded from.
        description: What `load` was given; None for a robot made otherwise.
        parts: The robots that it consists of: itself only, unless it was combined.
    """

    def __init__(
        self,
        model: pin.Model,
        source: RobotSource,
        parts: Sequence[RobotPart] = (),
        description: RobotDescription | None = None,
    ) -> None:
        """Wrap a Pinocchio model; `Robot.load` is the usual way to create a robot."""
        home = source.home or reference_posture(model, source)
        super().__init__(model, source.name, home)
        self.source = source
        self.description = description
        self.parts = tuple(parts) or (RobotPart("", source, pin.SE3.Identity()),)

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
        project_inertias: bool = False,
        xacro_args: Mapping[str, str | bool | float] | None = None,
        access: Access = ANYWHERE,
    ) -> Self:
        """Load a bundled robot, one of an installed package, or a URDF or xacro file.

        Args:
            name: For example ``"panda"``, ``"talos_arm"``, ``"gen3_description"`` or
                ``"my_arm/arm.urdf"``; or a whole description, and then nothing else.
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
            project_inertias: Whether inertias that no body can have are replaced by the
                nearest that one can have; mass and centre of mass stay.
            xacro_args: Arguments of a xacro file, by name.
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
        if isinstance(name, pin.Model):
            raise ModelError("a pinocchio.Model; needs Robot.from_pinocchio(model)")
        given: dict[str, Any] = {
            "root": root,
            "locked": locked,
            "tool_frames": tool_frames,
            "gravity": gravity,
            "mimic": None if mimic else False,
            "project_inertias": project_inertias or None,
            "xacro_args": xacro_args,
        }
        given = {key: value for key, value in given.items() if value is not None}
        if not isinstance(name, RobotDescription):
            name = RobotDescription(name, **given)
        elif given:
            raise ModelError(
                "a RobotDescription says all about the robot: give "
                f"{' and '.join(given)} in it"
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
        once as a warning. `MujocoCoordinates` converts states.

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
        read = _reader("mujoco")
        return cls(*read(model, root, joints, qpos, keyframe, locked, tool_frames))

    @classmethod
    def from_pinocchio(
        cls,
        model: pin.Model,
        collision: pin.GeometryModel | None = None,
        visual: pin.GeometryModel | None = None,
        *,
        home: ArrayLike | None = None,
        end_effector: str | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
    ) -> Self:
        """Return the robot of a Pinocchio model, of which it keeps a copy.

        ``hsp.Robot.from_pinocchio(*pin.buildModelsFromUrdf(urdf, folders))`` is the
        robot with its shapes. Without ``collision``, distances see capsules between its
        joints; without ``visual``, the viewer draws its joints and links. YAML can only
        name a robot that `Robot.load` reads.

        Args:
            model: The model; gravity, friction and limits are its own. Lock joints with
                ``pin.buildReducedModel``.
            collision: What distances see. If it has collision pairs, only their links
                can collide with one another.
            visual: What is drawn.
            home: The home posture, a configuration of shape (nq,); None: see `home`.
            end_effector: The frame of the hand; None: see `end_effector`.
            tool_frames: Frames to add, by name.

        Raises:
            ModelError: If an argument is of another type, a geometry model is of
                another model, or the mass matrix is singular.
            FrameNotFoundError: If the hand, or a tool frame's parent, does not exist.
        """
        given = collision, visual, home, end_effector, tool_frames or {}
        robot = cls(*take_model(model, *given))
        if end_effector is not None:
            robot.frame_id(end_effector)
        return robot

    @classmethod
    def _described(cls, description: RobotDescription, access: Access) -> Self:
        """Return the robot of a description."""
        gravity = description.gravity
        if description.mjcf is not None:
            return cls(*_reader("mjcf")(description, access), description=description)
        if description.parts is None:
            source = description.find(access)
            model = load_model(source, description, gravity)
            return cls(model, source, description=description)
        robots = {}
        for name, part in description.parts.items():
            with within("parts", name, "name" if part.name else "description"):
                source = part.find(access)
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
            (RobotPart(f"{name}_", robot.source, place), robot.model)
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


def _reader(kind: str) -> Callable[..., tuple[pin.Model, RobotSource]]:
    """Return what reads a kind of model that a companion knows."""
    entry = entry_points("robots").get(kind)
    if entry is None:
        raise ModelError(f"the companion that reads {kind} models is not here")
    reader: Callable[..., tuple[pin.Model, RobotSource]] = entry.load()
    return reader


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
        inertia: M(q) as an argument of kernels; see `mass_matrix`.
        inertia_rate: M' as an argument of kernels; see `mass_matrix_rate`.
        effort: What `inverse_dynamics` wrote last, shape (nv,) [N·m or N].
        data: Pinocchio's data at (q, v), for terms that this class does not offer.
    """

    def __init__(self, robot: Robot) -> None:
        """Allocate the memory; call `update` before using any term."""
        self.robot = robot
        self.t = 0.0
        self.q: Array = robot.neutral()
        self.v: Array = np.zeros(robot.nv)
        self._memory = self.q, self.v  # writable, also where `seen` binds calls
        self._seen: RobotState | None = None
        self.data: pin.Data = robot.model.createData()
        self.effort: Array = kept_view(self.data.tau, self.data)
        self._compute_jacobians = bind_pinocchio(
            "jacobians", robot.model, self.data, self.q, self.v
        )
        self._acceleration: Array = np.zeros(robot.nv)
        self._inverse_dynamics = self.bind_inverse_dynamics(self._acceleration)
        self._world: WorldKinematics | None = None
        self._unit_blocks = np.array(robot.unit_blocks, dtype=np.int64).reshape(-1, 2)
        self._frames: dict[str, FrameKinematics] = {}
        self.stamp_array: Indices = np.zeros(1, dtype=np.int64)
        model, stamp = robot.model, self.stamp_array
        self.inertia, self.inertia_rate = inertia_terms(
            model, self.data, *self._memory, stamp
        )
        effects = partial(pin.nonLinearEffects, model, self.data, *self._memory)
        self._compute_effects = once([effects], stamp)
        self._centroidal: CentroidalMotion | None = None
        self._displaced: RobotState | None = None
        self._made: dict[tuple[int, str], tuple[object, Any]] = {}
        self._move = self.bind_move()

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Move to time t [s], configuration q (nq,) and velocity v (nv,), in place.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        self.advance(self._move, t, q, v)
        return self

    def advance(self, move: Move, t: float, q: ArrayLike, v: ArrayLike) -> float:
        """`update`, with the calls of `bind_move`; return what the last one returns."""
        q_in: Any = q
        v_in: Any = v
        try:
            known = q_in.dtype is v_in.dtype is _DOUBLE and q_in.ndim == v_in.ndim == 1
        except AttributeError:  # a list, for example
            known = False
        if not known:
            q_in = self.robot.check_configuration(q)
            v_in = self.robot.check_tangent(v, "velocity v")
        before, self.t = self.t, t  # calls in Python read it
        try:
            value = move(t, q_in, v_in)
        except TypeError:
            if isinstance(t, float | int | np.number):
                raise
            value = REFUSED
        if value == REFUSED:
            self.t = before
            self._refuse(t, q, v)
        return value

    def bind_move(self, calls: Sequence[Callable[[float], Any]] = ()) -> Move:
        """Return how `advance` moves this state, with calls of the time that follow."""
        first, rest = self._compute_jacobians, tuple(calls)
        memory = *self._memory, self._unit_blocks, self.stamp_array
        move: Move = partial(_move, memory, first)
        if isinstance(first, NativeCall):
            from hsp_control.robot.native_move import NativeMove

            native = [first]
            while rest and isinstance(rest[0], NativeCall):
                native.append(rest[0])
                rest = rest[1:]
            move = NativeMove.of(native, *memory)
        return partial(_and_then, move, rest) if rest else move

    def _refuse(self, t: float, q: ArrayLike, v: ArrayLike) -> None:
        """Raise the error that says what is wrong with t, q and v."""
        if not isinstance(t, float | int | np.number) or not np.isfinite(t):
            raise NonFiniteError(f"time t is {t!r}; needs a finite number of seconds")
        self.robot.check_configuration(q)
        self.robot.check_tangent(v, "velocity v")
        raise NonFiniteError(f"t = {t!r}, q = {q!r}, v = {v!r}: their sum overflows")

    @property
    def seen(self) -> "RobotState":
        """This state, as users may have it: t, q and v change only by `update`."""
        if self._seen is None:
            self._seen = SeenState(self)
        return self._seen

    def frame(self, name: str) -> FrameKinematics:
        """Return the placement, the Jacobian and the motion of a frame.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        frame = self._frames.get(name)
        if frame is None:
            index = self.robot.frame_id(name)
            _, v = self._memory
            frame = FrameKinematics(
                self.robot.model, self.data, v, self.stamp_array, index
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
                self.robot.model, self.data, *self._memory, self.stamp_array
            )
        self._centroidal.compute()
        return self._centroidal

    @property
    def mass_matrix(self) -> Array:
        """M(q), shape (nv, nv) (CRBA)."""
        self.inertia.compute()
        return self.inertia.value

    @property
    def mass_matrix_rate(self) -> Array:
        """M' along v, shape (nv, nv)."""
        self.inertia_rate.compute()
        return self.inertia_rate.value

    @property
    def nonlinear_effects(self) -> Array:
        """N(q, v): Coriolis, centrifugal and gravity efforts, shape (nv,) (RNEA)."""
        self._compute_effects()
        return kept_view(self.data.nle, self.data)

    def inverse_dynamics(self, acceleration: Array) -> Array:
        """Return the effort M a + N, shape (nv,), for an acceleration (nv,) (RNEA)."""
        self._acceleration[:] = acceleration
        self._inverse_dynamics()
        return self.effort

    def bind_inverse_dynamics(self, acceleration: Array) -> Callable[[], object]:
        """Return a call that writes `effort` for what this array (nv,) then holds."""
        return bind_pinocchio(
            "rnea", self.robot.model, self.data, *self._memory, acceleration
        )

    @property
    def stamp(self) -> int:
        """A number that changes with every `update`: use it to invalidate caches."""
        return int(self.stamp_array[0])

    @property
    def world(self) -> WorldKinematics:
        """Placements and Jacobians of all joints at the world's origin, as views."""
        if self._world is None:
            self._world = WorldKinematics(
                joint_placements(self.data),
                matrix_view(self.data.J),
                matrix_view(self.data.dJ),
                self._memory[1],
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

    def run(self, calls: KernelCalls) -> Any:
        """Make calls now, once; return what the last one returns."""
        return self.plan(calls).run(self.t)

    def plan(self, calls: KernelCalls) -> StepPlan:
        """Return calls as they are made at any time: `StepPlan.run`."""
        return planned(calls)

    def prepared(
        self, part: object, what: str, make: Callable[[], tuple[Made, KernelCalls]]
    ) -> tuple[Made, Callable[[], Any]]:
        """Return what `made` does, and a call that makes the calls of ``make`` now."""

        def plan() -> tuple[Made, StepPlan]:
            memory, calls = make()
            return memory, self.plan(calls)

        memory, calls = self.made(part, what, plan)
        return memory, lambda: calls.run(self.t)

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


class SeenState(RobotState):
    """A state whose t, q and v change only together, by `update`.

    It shares all memory with the state that it shows: the arrays at whose addresses
    native calls read q and v stay writable there, and are read-only here.
    """

    __slots__ = ("_own", "_shown")
    _own: RobotState
    _shown: tuple[Array, Array]

    def __init__(self, own: RobotState) -> None:
        self.__dict__ = own.__dict__
        self._own, self._shown = own, (own.q.view(), own.v.view())
        for view in self._shown:
            view.flags.writeable = False

    t = property(lambda self: self._own.t)
    q = property(lambda self: self._shown[0])
    v = property(lambda self: self._shown[1])

    def __setattr__(self, name: str, value: object) -> None:
        if name in ("t", "q", "v"):
            raise ImmutableError(
                f"state.{name} cannot be assigned, as all terms belong to one t, q and "
                "v: call state.update(t, q, v)"
            )
        super().__setattr__(name, value)

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Move the state that it shows; see `RobotState.update`."""
        self._own.update(t, q, v)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _copy, (self.robot, self.t, np.array(self.q), np.array(self.v))


def _copy(robot: Robot, t: float, q: Array, v: Array) -> RobotState:
    """Return a state of its own: what a copy, or a pickle, is."""
    return RobotState(robot).update(t, q, v)


def _move(
    memory: tuple[Array, Array, Indices, Indices],
    first: Callable[[], object],
    t: float,
    q: Array,
    v: Array,
) -> float:
    """`NativeMove`, where calls are made one by one."""
    if not copy_valid(t, q, v, *memory):
        return REFUSED
    first()
    return 0.0


def _and_then(
    move: Move, calls: tuple[Callable[[float], Any], ...], t: float, q: Array, v: Array
) -> float:
    """Move, then make calls."""
    value = move(t, q, v)
    if value != REFUSED:
        for call in calls:
            value = call(t)
    return value


Posture = Annotated[Literal["start", "home"] | Vector, "posture"]
"""``start``, ``home``, the positions of the joints, shape (nv,) [rad or m], or a
configuration, shape (nq,); see `configuration`."""


def configuration(posture: ArrayLike | str, start: RobotState) -> Array:
    """Return the configuration of a `Posture`, shape (nq,)."""
    robot = start.robot
    if isinstance(posture, str):
        return start.q.copy() if posture == "start" else robot.home()
    given = np.asarray(posture, dtype=float)
    if given.shape == (robot.nq,):
        return np.array(robot.check_configuration(given))
    if given.shape == (robot.nv,):
        return robot.integrate(robot.neutral(), robot.check_tangent(given, "posture"))
    numbers = f"{robot.nv}" if robot.nv == robot.nq else f"{robot.nv} or {robot.nq}"
    raise ShapeError(f"a posture has shape {given.shape}; needs {numbers} numbers")
