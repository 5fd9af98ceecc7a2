"""The robot at one time: kinematic and dynamic terms, computed once per state.

The controller gets its kinematics and dynamics from `RobotState`, by calls of the
engine, which has Pinocchio's algorithms. Other modules call Pinocchio's bindings only
for tasks that a state does not cover: loading and checks of models, integration,
collision geometry, and the viewer.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices, read_only_view
from hsp_control.common.errors import ImmutableError, NonFiniteError, ShapeError
from hsp_control.declaration.quantities import Vector
from hsp_control.engine import Dynamics, Move, Plan
from hsp_control.engine.plans import (
    AnyCall,
    Once,
    PartCall,
    PartCalls,
    Step,
    StepPlan,
    implemented_by,
    planned,
)
from hsp_control.robot.inertia import CentroidalMotion, inertia_terms
from hsp_control.robot.kinematics import (
    FrameKinematics,
    LocalMotion,
    ShownFrame,
    Term,
    WorldKinematics,
)

if TYPE_CHECKING:  # circular reference: a robot makes its states
    from hsp_control.robot.robot import Robot

Made = TypeVar("Made")

_MADE_LIMIT = 1000
"""Number of parts whose memory a state keeps; then it starts anew."""


class RobotState:
    """The robot at one time, with all its kinematic and dynamic terms.

    A term is computed at its first use and kept until the next `update`. The returned
    arrays belong to the state and change with it: copy an array to keep its values. Use
    a state in one thread only.

    Attributes:
        robot: The robot.
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        time: `t` as an array of shape (1,), for calls.
        stamp_array: `stamp` as an array of shape (1,), for calls.
        dynamics: The dynamics that compute the terms, as an argument of calls.
        world: Placements and Jacobians of all joints, as an argument of calls.
        inertia: M(q) as an argument of calls; see `mass_matrix`.
        inertia_rate: M' as an argument of calls; see `mass_matrix_rate`.
        effects: N as an argument of calls; see `nonlinear_effects`.
        effort: The last result of `inverse_dynamics`, shape (nv,) [N·m or N].
    """

    def __init__(
        self,
        robot: "Robot",
        dynamics: Dynamics | None = None,
        local: dict[str, LocalMotion] | None = None,
    ) -> None:
        """Allocate the memory; call `update` before using any term.

        Args:
            robot: The robot.
            dynamics: Those of another state, which may have a payload; None: the
                robot's own.
            local: Frames of another state that changes have moved in their joints;
                None: all are where the model has them.
        """
        self.robot = robot
        self.time: Array = np.zeros(1)
        self.q: Array = robot.neutral()
        self.v: Array = np.zeros(robot.nv)
        self.stamp_array: Indices = np.zeros(1, dtype=np.int64)
        blocks = np.array(robot.unit_blocks, dtype=np.int64).reshape(-1, 2)
        # writable, also for calls that `seen` binds
        self._memory: dict[str, Array | Indices] = {
            "origin": np.zeros(1),
            "time": self.time,
            "q": self.q,
            "v": self.v,
            "unit_blocks": blocks,
            "stamp": self.stamp_array,
        }
        self._seen: RobotState | None = None
        self._read_only: RobotState | None = None
        self.dynamics: Dynamics = dynamics or robot.dynamics()
        self._local: dict[str, LocalMotion] = {} if local is None else local
        self._shown_data: tuple[pin.Data, int] | None = None
        self._at: dict[str, Any] = {"dynamics": self.dynamics, "q": self.q, "v": self.v}
        self.world = WorldKinematics.allocate(robot.model, self.v)
        self.effort: Array = np.zeros(robot.nv)
        self._acceleration: Array = np.zeros(robot.nv)
        self._inverse_dynamics = self._bound(self.rnea(self._acceleration))
        self._frames: dict[str, tuple[FrameKinematics, Callable[[], object]]] = {}
        stamp = self.stamp_array
        self.inertia, self.inertia_rate = inertia_terms(**self._at, stamp=stamp)
        self._compute_inertia = self._bound(*self.inertia.calls)
        self._compute_inertia_rate = self._bound(*self.inertia_rate.calls)
        self._effects: Array = np.zeros(robot.nv)
        effects = PartCall(
            engine.InverseDynamics,
            **self._at,
            acceleration=np.zeros(robot.nv),
            effort=self._effects,
        )
        self.effects = Term(self._effects, [Once.at(stamp, effects)])
        self._compute_effects = self._bound(*self.effects.calls)
        self._centroidal: tuple[CentroidalMotion, Callable[[], object]] | None = None
        self._displaced: RobotState | None = None
        self._made: dict[tuple[int, str], tuple[object, Any]] = {}
        self._move = self.bind_move()

    def _bound(self, *calls: AnyCall) -> Callable[[], object]:
        return self.plan(calls).call()

    def __setattr__(self, name: str, value: object) -> None:
        if name == "t" or (name in _FIXED and name in self.__dict__):
            raise ImmutableError(
                f"state.{name} cannot be assigned, as all terms belong to one t, q and "
                "v: call state.update(t, q, v)"
            )
        super().__setattr__(name, value)

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.time.item()

    @property
    def data(self) -> pin.Data:
        """Pinocchio's data at (q, v), for terms that this class does not offer.

        They have the placements of the joints, and their Jacobians J with the rate, and
        belong to the caller: nothing here is computed with them.
        """
        stamp, model = self.stamp, self.robot.model
        if self._shown_data is None or not _fits(self._shown_data[0], self.world):
            self._shown_data = model.createData(), stamp - 1
        data, computed = self._shown_data
        if computed != stamp:
            pin.computeJointJacobiansTimeVariation(model, data, self.q, self.v)
            self._shown_data = data, stamp
        return data

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
        """`update`, with the calls of `bind_move`; return the last one's result."""
        value = move(t, q, v)
        if value is None:  # rejected: lists, for example, or invalid values
            if not isinstance(t, float | int | np.number) or not np.isfinite(t):
                given = t.item() if isinstance(t, np.number) else t
                raise NonFiniteError(
                    f"time t is {given!r}; needs a finite number of seconds"
                )
            q_in = self.robot.check_configuration(q)
            v_in = self.robot.check_tangent(v, "velocity v")
            value = move(t, q_in, v_in)
            if value is None:
                raise NonFiniteError(
                    f"t = {t!r}, q = {q!r}, v = {v!r}: their sum overflows"
                )
        return value

    def bind_move(
        self, calls: Sequence[Step] = (), origin: Array | None = None
    ) -> Move:
        """Return how `advance` moves this state, with calls of the time that follow.

        Args:
            calls: The calls after it, with the time of the state.
            origin: The clock of `advance` at time 0, shape (1,) [s]; None: it is the
                time of the state.
        """
        jacobians = PartCall(
            engine.JointJacobians,
            **self._at,
            jacobian=self.world.jacobian,
            jacobian_dot=self.world.jacobian_dot,
            placements=self.world.placements,
        )
        plan = Plan([*self.plan([jacobians]).steps(), *calls])
        memory = self._memory if origin is None else self._memory | {"origin": origin}
        return Move(calls=plan, **memory)

    @property
    def seen(self) -> "RobotState":
        """This state as users see it: t, q and v change only by `update`."""
        if self._seen is None:
            self._seen = SeenState(self)
        return self._seen

    @property
    def read_only(self) -> "RobotState":
        """This state, as the plain Python of a part gets it: nothing in it changes."""
        if self._read_only is None:
            self._read_only = ReadOnlyState(getattr(self, "_own", self))
        return self._read_only

    def frame(self, name: str) -> FrameKinematics:
        """Return the placement, the Jacobian and the motion of a frame.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        found = self._frames.get(name)
        if found is None:
            joint, local = self._joint_of(name), self.local_motion(name)
            around = self.world, self.stamp_array
            frame = FrameKinematics(self.robot.model, *around, joint, local)
            self._frames[name] = found = frame, self._bound(*frame.calls)
        frame, compute = found
        compute()
        return frame

    def _joint_of(self, frame: str) -> int:
        model = self.robot.model
        return int(model.frames[self.robot.frame_id(frame)].parentJoint)

    def local_motion(self, frame: str) -> LocalMotion:
        """Return a frame's motion in its joint; after writing it, `forget_frame`.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        found = self._local.get(frame)
        if found is None:
            placement = self.robot.model.frames[self.robot.frame_id(frame)].placement
            self._local[frame] = found = LocalMotion.fixed(placement)
        return found

    def move_frame(self, frame: str, motion: LocalMotion) -> None:
        """Place a frame elsewhere in its joint than in the model, or let it move there.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
        """
        for own, given in zip(self.local_motion(frame), motion, strict=True):
            own[:] = given
        self.forget_frame(frame)

    def forget_frame(self, frame: str) -> None:
        """Compute a frame anew whose motion in its joint was written."""
        if frame in self._frames:
            self._frames[frame][0].forget()

    def position(self, frame: str) -> Array:
        """Return the origin of a frame in the world [m], shape (3,)."""
        return self.frame(frame).position

    @property
    def centroidal(self) -> CentroidalMotion:
        """The centre of mass, the angular momentum about it, and their Jacobians."""
        if self._centroidal is None:
            model = self.robot.model
            center = CentroidalMotion(model, **self._at, stamp=self.stamp_array)
            self._centroidal = center, self._bound(*center.calls)
        center, compute = self._centroidal
        compute()
        return center

    @property
    def mass_matrix(self) -> Array:
        """M(q), shape (nv, nv) (CRBA)."""
        self._compute_inertia()
        return self.inertia.value

    @property
    def mass_matrix_rate(self) -> Array:
        """M' along v, shape (nv, nv)."""
        self._compute_inertia_rate()
        return self.inertia_rate.value

    @property
    def nonlinear_effects(self) -> Array:
        """N(q, v): Coriolis, centrifugal and gravity efforts, shape (nv,) (RNEA)."""
        self._compute_effects()
        return self._effects

    def inverse_dynamics(self, acceleration: Array) -> Array:
        """Return the effort M a + N, shape (nv,), for an acceleration (nv,) (RNEA)."""
        self._acceleration[:] = acceleration
        self._inverse_dynamics()
        return self.effort

    def rnea(self, acceleration: Array) -> PartCall:
        """Return a call that writes `effort` for the values of this array (nv,)."""
        return PartCall(
            engine.InverseDynamics,
            **self._at,
            acceleration=acceleration,
            effort=self.effort,
        )

    @property
    def stamp(self) -> int:
        """A number that changes with every `update`: use it to invalidate caches."""
        return int(self.stamp_array[0])

    def cached(self, part: object, what: str, make: Callable[[], Made]) -> Made:
        """Return the result of ``make`` for a part and this state; it is called once.

        ``what`` distinguishes the memories of a class and its subclasses.

        Parts are values and have no memory. Their memory at a state, such as buffers
        and bound calls, is kept here, so that one part may serve many states, in many
        threads.
        """
        key = id(part), what
        found = self._made.get(key)
        if found is None:
            if len(self._made) >= _MADE_LIMIT:
                self._made.clear()
            self._made[key] = found = part, make()  # keeps the part, and its id
        made: Made = found[1]
        return made

    def run(self, calls: PartCalls) -> Any:
        """Make calls now, once; return the result of the last one."""
        return self.plan(calls).run(self.t)

    def plan(self, calls: PartCalls) -> StepPlan:
        """Return calls as they are made at any time: `StepPlan.run`."""
        return planned(calls)

    def prepared(
        self, part: object, what: str, make: Callable[[], tuple[Made, PartCalls]]
    ) -> tuple[Made, Callable[[], Any]]:
        """Return the result of `cached`, and a call that makes ``make``'s calls now."""

        def plan() -> tuple[Made, StepPlan]:
            memory, calls = make()
            return memory, self.plan(calls)

        memory, calls = self.cached(part, what, plan)
        return memory, lambda: calls.run(self.t)

    def __getstate__(self) -> dict[str, Any]:
        return {
            "robot": self.robot,
            "local": self._local,
            "t": self.t,
            "q": self.q,
            "v": self.v,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["robot"], None, state["local"])  # type: ignore[misc]
        self.update(state["t"], state["q"], state["v"])

    def displaced(self, dt: float, displacement: Array) -> "RobotState":
        """Return the state at (t + dt, q ⊕ displacement) with the same velocity.

        For finite differences. Each call overwrites and returns the same object, the
        companion of this state.

        Args:
            dt: Time difference [s].
            displacement: Shape (nv,) [rad or m].
        """
        q = pin.integrate(self.robot.model, self.q, displacement)
        return self.companion.update(self.t + dt, q, self.v)

    @property
    def companion(self) -> "RobotState":
        """The state that `displaced` moves: this robot at other places."""
        if self._displaced is None:
            self._displaced = self.another()
        return self._displaced

    def another(self) -> "RobotState":
        """Return a state of the same robot, with its payloads and tools."""
        return RobotState(self.robot, self.dynamics, self._local)

    def snapshot(self) -> "RobotState":
        """Return a copy of this state, which does not change; it has no payload."""
        other = RobotState(self.robot, None, deepcopy(self._local))
        return other.update(self.t, self.q, self.v)

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
        self._own, self._shown = own, (read_only_view(own.q), read_only_view(own.v))

    q = property(lambda self: self._shown[0])
    v = property(lambda self: self._shown[1])

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Move the state that it shows; see `RobotState.update`."""
        self._own.update(t, q, v)
        return self

    def move_frame(self, frame: str, motion: LocalMotion) -> None:
        """Refuse to move a frame; see `RobotState.move_frame`."""
        raise ImmutableError(
            f"{frame!r} cannot be moved here: its controller moves it, "
            "controller.at(t).tool(...); or take state.snapshot()"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        at = self.t, np.array(self.q), np.array(self.v)
        return _copy, (self.robot, self._own._local, *at)


def as_given(part: object, state: RobotState) -> RobotState:
    """Return a state as a part's `evaluate` gets it: read-only for plain Python.

    Calls of the engine are bound to the state itself, whose arrays they write.
    """
    is_plain = implemented_by(part, "call", "own_calls", "evaluate") == "evaluate"
    return state.read_only if is_plain else state


class ReadOnlyState(SeenState):
    """A state that cannot be moved, whose arrays cannot be written.

    The plain Python of a part gets it: otherwise it would silently change the robot of
    the controller that called it.
    """

    __slots__ = ("_frames_shown",)
    _frames_shown: dict[str, FrameKinematics]

    def __init__(self, own: RobotState) -> None:
        super().__init__(own)
        object.__setattr__(self, "_frames_shown", {})

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Refuse to move; see `RobotState.displaced`."""
        raise ImmutableError(
            "the state that a part is given cannot be moved: it is its controller's; "
            "take state.displaced(dt, displacement), or state.robot.state(t, q, v)"
        )

    def frame(self, name: str) -> FrameKinematics:
        """Return a frame whose arrays cannot be written; see `RobotState.frame`."""
        own = self._own.frame(name)
        shown = self._frames_shown.get(name)
        if shown is None:
            shown = self._frames_shown[name] = ShownFrame(own)
        return shown

    def displaced(self, dt: float, displacement: Array) -> RobotState:
        """Return the companion, read-only as well; see `RobotState.displaced`."""
        return self._own.displaced(dt, displacement).read_only

    centroidal = property(lambda self: self._own.centroidal.shown)
    mass_matrix = property(lambda self: read_only_view(self._own.mass_matrix))
    time = property(lambda self: read_only_view(self._own.time))
    effort = property(lambda self: read_only_view(self._own.effort))
    world = property(
        lambda self: WorldKinematics(*map(read_only_view, self._own.world))
    )
    mass_matrix_rate = property(lambda self: read_only_view(self._own.mass_matrix_rate))
    nonlinear_effects = property(
        lambda self: read_only_view(self._own.nonlinear_effects)
    )

    def inverse_dynamics(self, acceleration: Array) -> Array:
        """Return the effort, a copy; see `RobotState.inverse_dynamics`."""
        robot = self.robot
        return robot.inverse_dynamics(self.q, self.v, np.array(acceleration))


_FIXED = {
    "robot", "q", "v", "time", "stamp_array", "dynamics", "world", "inertia",
    "inertia_rate", "effects", "effort",
}  # fmt: skip
"""Arrays of native calls: assigning others would have no effect on the calls."""


def _fits(data: pin.Data, world: WorldKinematics) -> bool:
    """Return whether the arrays of Pinocchio's data still have their size."""
    sizes = data.J.size, data.dJ.size, len(data.oMi)
    return sizes == (world.jacobian.size,) * 2 + (len(world.placements),)


def _copy(
    robot: "Robot", local: dict[str, LocalMotion], t: float, q: Array, v: Array
) -> RobotState:
    """Return an independent state, for copies and pickles."""
    return RobotState(robot, None, deepcopy(local)).update(t, q, v)


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
