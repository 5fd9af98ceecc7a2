"""A state as users see it: it cannot become inconsistent."""

from collections.abc import Callable
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ImmutableError
from hsp_control.robot.state import RobotState


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
        """Set the state to show."""
        self.__dict__ = own.__dict__
        self._own = own
        self._shown_q, self._shown_v = _read_only(own.q), _read_only(own.v)

    def update(self, t: float, q: ArrayLike, v: ArrayLike) -> Self:
        """Move the state that it shows; see `RobotState.update`."""
        self._own.update(t, q, v)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _copy, (self.robot, self.t, np.array(self.q), np.array(self.v))


def _read_only(array: Array) -> Array:
    view = array.view()
    view.flags.writeable = False
    return view


def _copy(robot: Any, t: float, q: Array, v: Array) -> RobotState:
    """Return a state of its own: what a copy, or a pickle, is."""
    return RobotState(robot).update(t, q, v)
