"""Pieces of a streamed reference: quintics within the bounds, otherwise Ruckig's.

A piece is a C² function of time, given in local coordinates (`Chart`); each begins in
the final state of the piece before it. The engine plans them
(``engine/streams/planner.cpp``): the same without Python.
"""

from abc import ABC, abstractmethod
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import StreamError, TrajectoryError
from hsp_control.trajectories.streams.chart import State


class MotionBounds(NamedTuple):
    """Maximum magnitudes of the first three derivatives, for each coordinate."""

    speed: Array  # (n,) [1/s]
    acceleration: Array  # (n,) [1/s²]
    jerk: Array  # (n,) [1/s³]


def linear_bounds(
    speed: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike, n: int
) -> MotionBounds:
    """Return bounds for each of n coordinates."""
    given = {"speed": speed, "acceleration": acceleration, "jerk": jerk}
    found = []
    for name, value in given.items():
        numbers = np.asarray(value, dtype=float)
        if numbers.ndim and numbers.shape != (n,):
            raise TrajectoryError(
                f"{name} has {numbers.size} numbers; the stream needs one or {n}"
            )
        found.append(np.broadcast_to(numbers, (n,)).copy())
    return MotionBounds(*found)


def angular_bounds(speed: float, acceleration: float, jerk: float) -> MotionBounds:
    """Return bounds on a rotation vector that keep those on ω, ω' and ω''; see `Chart`.

    A vector with components up to b/√3 is no longer than b. Each piece has axes of its
    own; where one begins, a component of ω may be beyond its bound while all of ω is
    not, and is then brought back. For that the speed is planned 5 % smaller; the
    maximum in 400 adversarial streams was 0.5 %.
    """
    curved = acceleration - speed**2 / pi
    if curved <= 0.0:
        raise TrajectoryError(
            f"angular_acceleration is {acceleration:g}; with angular_speed {speed:g} "
            f"it must be greater than {speed**2 / pi:.4g} (angular_speed²/π)"
        )
    turned = jerk - speed * curved - speed**3 / 6.0
    if turned <= 0.0:
        raise TrajectoryError(
            f"angular_jerk is {jerk:g}; with these bounds it must be greater than "
            f"{speed * curved + speed**3 / 6.0:.4g}"
        )
    planned = PLANNED * speed, curved, turned
    return MotionBounds(*(np.full(3, each / sqrt(3.0)) for each in planned))


PLANNED = 0.95
"""Share of an angular speed up to which motions are planned; see `angular_bounds`."""


class Segment(ABC):
    """A piece of the reference, from ``start`` to ``end`` [s], about ``base``."""

    def __init__(self, start: float, end: float, base: Array) -> None:
        """Set its start and end, and the orientation of its chart."""
        self.start, self.end, self.base = start, end, base

    @abstractmethod
    def state(self, t: float) -> State:
        """Return the state at time t [s], between start and end."""


_HEAD, _ROWS = 13, 52
"""Count of numbers of a piece: common ones, and per coordinate; see
``engine/streams/piece.hpp``."""
COAST = 0.0
"""The first number of a piece whose x' is constant."""


class Piece(Segment):
    """A piece planned by the engine, as numbers."""

    def __init__(self, numbers: Array, base: Array) -> None:
        """Store the numbers that the engine wrote into `room`."""
        super().__init__(float(numbers[1]), float(numbers[2]), base)
        n = (len(numbers) - _HEAD) // _ROWS
        self.numbers = numbers
        self._found = State.allocate(n)
        self._state = engine.PieceState(piece=numbers, out=vars(self._found))

    def state(self, t: float) -> State:
        """Return the state at time t [s]."""
        self._state(float(t))
        found = self._found
        x, rate, acceleration = found.x.copy(), found.rate.copy(), found.acceleration
        return State(x, rate, acceleration.copy(), self.base)


def coast(start: float, end: float, state: State) -> Piece:
    """Return a piece with x' constant; at rest if it is zero."""
    numbers = room(len(state.x))
    numbers[:3] = COAST, start, end
    numbers[4:_HEAD] = state.base.ravel()
    numbers[_HEAD:][: 2 * len(state.x)] = *state.x, *state.rate
    return Piece(numbers, state.base)


def room(n: int) -> Array:
    """Return room for the numbers of a piece with n coordinates."""
    return np.zeros(_HEAD + _ROWS * n)


def found_motion(segment: Segment | None) -> Segment:
    """Return a segment; raise if there is none."""
    if segment is None:
        raise StreamError("no motion within the bounds was found")
    return segment
