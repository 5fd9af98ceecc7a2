"""A declared rate against a difference of its value, along a motion of the robot.

A value that is differentiable has the same slope over four intervals in a row, and its
rate is that slope. Where the slopes differ, because a kink, a jump or noise lies among
them, the rate may be anything within a few times their spread, and nothing is reported.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import RateError
from hsp_control.robot import RobotState

INTERVAL = 5e-5
"""Time between two of the five states [s], with joint speeds of up to 1 rad/s."""
_ALLOWED = 1e-3
"""Relative tolerance of a rate: sampling at 1 kHz has twice this error."""
_SPREADS = 2.0
"""It may be off by this many spreads of the slopes: a jump at the middle state has a
mean slope of half its spread, and any finite rate is right there."""
_ROUNDINGS = 8.0
"""Units in the last place of the value that a difference may consist of."""
_SAME = 1e-6
"""Values that differ by less than this part are the same [-]."""

ValueAndRate = Callable[[RobotState], tuple[Array, Array]]
"""A value and its declared rate at a state, shapes (n,)."""


class Declared(NamedTuple):
    """A user-defined rate, and its names in messages."""

    part: str  # its owner
    by: str  # method or argument that declares the rate
    value: str  # name of the value
    rate: str  # name of the rate
    entry: Callable[[int], str]  # name of an entry's row or joint
    remedy: str = "correct it"

    def compare(self, values: Array, rate: Array, t: float) -> None:
        """Compare the rate at the middle one of five values with their slopes.

        Where one of them is not finite, nothing is compared.

        Args:
            values: The value at five times, `INTERVAL` apart, shape (5, n).
            rate: The declared rate at the third of them, shape (n,).
            t: The time that the message gives [s].

        Raises:
            RateError: If they differ.
        """
        if not (np.isfinite(values).all() and np.isfinite(rate).all()):
            return
        slopes = np.diff(values, axis=0) / INTERVAL
        slope, spread = slopes.mean(axis=0), slopes.max(axis=0) - slopes.min(axis=0)
        size = float(np.linalg.norm(slope))
        rounding = _ROUNDINGS * _precision(values) * np.linalg.norm(values[2])
        allowed = (
            _ALLOWED * size + _SPREADS * np.linalg.norm(spread) + rounding / INTERVAL
        )
        wrong = rate - slope
        if not np.linalg.norm(wrong) > allowed:
            return
        i = int(np.abs(wrong).argmax())
        factor = float(rate @ slope) / size**2 if size > 0.0 else 0.0
        times = ""
        if factor and np.linalg.norm(rate - factor * slope) <= allowed:
            times = f", so that it is {factor:.4g} times the true rate"
        without = ""
        if self.by.endswith("_function"):
            without = f", or leave {self.by} out: the package then takes differences"
        raise RateError(
            f"{self.part}: {self.by} is wrong: {self.rate} is {rate[i] + 0.0:.6g}"
            f"{self.entry(i)} at t = {t:.6g} s, but a difference of {self.value} "
            f"gives {slope[i]:.6g}{times}; {self.remedy}{without}"
        )


def independent_of_v(
    part: str,
    value: str,
    entry: Callable[[int], str],
    at: ValueAndRate,
    state: RobotState,
    instead: str,
) -> bool:
    """Return whether a value is a function of q and t, not random, for example.

    Args:
        part: The owner.
        value: Its name.
        entry: The name of an entry's row or joint.
        at: The value, and an ignored rate, at a state.
        state: The state of the comparison.
        instead: A sentence that names the damping parameter.

    Raises:
        RateError: If it depends on v: its rate would need v'.
    """
    v, another = velocities(state)
    there = RobotState(state.robot)

    def with_velocity(v: Array) -> Array:
        return at(there.update(state.t, state.q, v))[0].copy()

    first, other = with_velocity(v), with_velocity(another)
    if not _differ(first, other):
        return True
    if _differ(first, with_velocity(v)):
        return False
    i = int(np.abs(first - other).argmax())
    raise RateError(
        f"{part}: {value} depends on v: at t = {state.t:.6g} s and one q, it is "
        f"{first[i]:.6g}{entry(i)} with one velocity and {other[i]:.6g} with another; "
        f"it may use q, t and frames, but not v. {instead}"
    )


def along_the_flow(
    at: ValueAndRate, state: RobotState, *, timed: bool = True
) -> tuple[Array, Array]:
    """Return five values along q ⊕ s v, and the rate at the third of them.

    A robot mostly begins at rest, so v is a velocity that turns every joint.

    Args:
        at: The value and its rate at a state.
        state: Where the flow begins.
        timed: Whether time goes on, too.
    """
    v, _ = velocities(state)
    there, robot, samples = RobotState(state.robot), state.robot, []
    for k in range(5):
        s = k * INTERVAL
        there.update(state.t + timed * s, robot.integrate(state.q, s * v), v)
        value, rate = at(there)
        samples.append((value.copy(), rate.copy()))
    return np.array([value for value, _ in samples]), samples[2][1]


def velocities(state: RobotState) -> Array:
    """Return two velocities that turn every joint, shape (2, nv) [rad/s or m/s]."""
    random = np.random.default_rng(1)
    signs = random.choice((-1.0, 1.0), (2, state.robot.nv))
    return np.asarray(signs * random.uniform(0.5, 1.0, signs.shape))  # none is slow


def declared_by(part: object, ways: tuple[str, ...]) -> str:
    """Return the name of the method by which a user's class declares a rate."""
    name = type(part).__name__
    for kind in type(part).__mro__:
        for way in ways:
            if way in vars(kind) and not is_own(kind):
                return f"{name}.{way}"
    return name


def is_own(kind: type) -> bool:
    """Return whether a class is the package's, which is tested."""
    return kind.__module__.partition(".")[0] == "hsp_control"


def _differ(a: Array, b: Array) -> bool:
    most = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    return bool((np.abs(a - b) > _SAME * most).any())


def _precision(values: Array) -> float:
    """Return the relative rounding of values, which may be of single precision."""
    single = (values == values.astype(np.float32)).all()
    return float(np.finfo(np.float32 if single else np.float64).eps)
