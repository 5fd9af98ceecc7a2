"""The robot and its state: kinematic and dynamic terms, each computed once per state.

The controller gets its kinematics and dynamics from `RobotState`, which calls Pinocchio
here, in `kinematics` and in `centroidal`. Other modules call Pinocchio directly only
for what a state does not offer: loading and checks of models, integration, collision
geometry, derivatives of gravity, plants with models of their own, and the viewer.
"""

from collections.abc import Callable, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn, Self, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import ImmutableError, NonFiniteError
from hsp_control.common.native import NativeCall
from hsp_control.robot.configuration_space import as_numbers
from hsp_control.robot.kinematics import (
    CentroidalMotion,
    FrameKinematics,
    WorldKinematics,
    inertia_terms,
    joint_placements,
)
from hsp_control.robot.matrix_view import matrix_view
from hsp_control.robot.model import RobotModel
from hsp_control.robot.pinocchio_calls import bind_pinocchio
from hsp_control.robot.valid_state import REFUSED, copy_valid

Made = TypeVar("Made")

Move = Callable[[float, Array, Array], float]
"""(t, q, v) ↦ what the last of its calls returned, or `REFUSED`."""

_DOUBLE = np.dtype(np.float64)

_MADE_LIMIT = 1000
"""Number of parts whose memory a state keeps; then it starts anew."""


class Robot(RobotModel):
    """A robot: its `RobotModel`, and states of it."""

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
        self.effort: Array = self.data.tau
        self._compute_jacobians = bind_pinocchio(
            "jacobians", robot.model, self.data, self.q, self.v
        )
        self._acceleration: Array = np.zeros(robot.nv)
        self._inverse_dynamics = self.bind_inverse_dynamics(self._acceleration)
        self._world: WorldKinematics | None = None
        self._unit_blocks = np.array(robot.unit_blocks, dtype=np.int64).reshape(-1, 2)
        self._frames: dict[str, FrameKinematics] = {}
        self.stamp_array: Indices = np.zeros(1, dtype=np.int64)
        self.inertia, self.inertia_rate = inertia_terms(
            robot.model, self.data, *self._memory, self.stamp_array
        )
        self._effects_stamp = -1
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
            q_in = as_numbers(q, self.robot.nq, "configuration q", self.robot)
            v_in = as_numbers(v, self.robot.nv, "velocity v", self.robot)
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
        first = self._compute_jacobians
        memory = *self._memory, self._unit_blocks, self.stamp_array
        if isinstance(first, NativeCall):
            from hsp_control.robot.native_move import NativeMove

            native = [first]
            for call in calls:
                if not isinstance(call, NativeCall):
                    break
                native.append(call)
            rest = tuple(calls[len(native) - 1 :])
            move: Move = NativeMove.of(native, *memory)
            return partial(_and_then, move, rest) if rest else move
        return partial(_move, memory, first, tuple(calls))

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
        if self._effects_stamp != self.stamp:
            pin.nonLinearEffects(self.robot.model, self.data, self.q, self.v)
            self._effects_stamp = self.stamp
        return self.data.nle  # type: ignore[no-any-return]

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


def _shown(name: str) -> Any:
    """Return a property that shows an attribute and refuses its assignment."""

    def refuse(state: object, value: object) -> NoReturn:
        raise ImmutableError(
            f"state.{name} cannot be assigned, as all terms belong to one t, q and v: "
            "call state.update(t, q, v)"
        )

    get: Callable[[Any], Any] = attrgetter(f"_shown_{name}")
    return property(get if name != "t" else _time, refuse)


def _time(state: "SeenState") -> float:
    return state._own.t


class SeenState(RobotState):
    """A state whose t, q and v change only together, by `update`.

    It shares all memory with the state that it shows: the arrays at whose addresses
    native calls read q and v stay writable there, and are read-only here.
    """

    __slots__ = ("_own", "_shown_q", "_shown_v")
    _own: RobotState
    if not TYPE_CHECKING:
        t, q, v = _shown("t"), _shown("q"), _shown("v")

    def __init__(self, own: RobotState) -> None:
        self.__dict__ = own.__dict__
        self._own = own
        self._shown_q, self._shown_v = _read_only(own.q), _read_only(own.v)

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Move the state that it shows; see `RobotState.update`."""
        self._own.update(t, q, v)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _copy, (self.robot, self.t, np.array(self.q), np.array(self.v))


def _move(
    memory: tuple[Array, Array, Indices, Indices],
    first: Callable[[], object],
    calls: tuple[Callable[[float], Any], ...],
    t: float,
    q: Array,
    v: Array,
) -> float:
    """`NativeMove`, where calls are made one by one."""
    if not copy_valid(t, q, v, *memory):
        return REFUSED
    first()
    value = 0.0
    for call in calls:
        value = call(t)
    return value


def _and_then(
    move: Move, calls: tuple[Callable[[float], Any], ...], t: float, q: Array, v: Array
) -> float:
    """Move, then make calls."""
    value = move(t, q, v)
    if value != REFUSED:
        for call in calls:
            value = call(t)
    return value


def _read_only(array: Array) -> Array:
    view = array.view()
    view.flags.writeable = False
    return view


def _copy(robot: Any, t: float, q: Array, v: Array) -> RobotState:
    """Return a state of its own: what a copy, or a pickle, is."""
    return RobotState(robot).update(t, q, v)
