"""The abstract trajectory of a point in Rⁿ, and the calls that sample trajectories."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY, replace
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ShapeError, TrajectoryError
from hsp_control.declaration import Part
from hsp_control.engine.plans import TIME, PartCall, PartCalls, bind, implemented_by
from hsp_control.trajectories import checks
from hsp_control.trajectories.arc_length import Course


def sampled(trajectory: Any, t: float, out: Any) -> Any:
    """Write a trajectory's sample at time t [s] with its call, and return it."""
    call = trajectory.call().given(out=out)
    given = {
        name: x.sample(t) if hasattr(x, "sample") else x
        for name, x in call.arguments.items()
    }
    bind(call.function, given, timed=True)(float(t))
    return out


def calls_of_sample(trajectory: Any, out: Any) -> PartCalls:
    """Return the calls of a trajectory that implements `call`, or `sample`."""
    if trajectory.constant:
        trajectory.sample(0.0, out)
        return []
    if implemented_by(trajectory, "call", "sample") == "call":
        return [trajectory.call().given(out=out, t=TIME)]
    return [PartCall(write_sample, sampler=trajectory.sample, out=out, t=TIME)]


def write_sample(t: float, sampler: Callable[[float, Any], Any], out: Any) -> None:
    """Call ``sampler(t, out)``, and write ``out`` if it returns another sample."""
    _copy(sampler(t, out), out)


def _copy(sample: Any, out: Any) -> None:
    for own, other in zip(out, sample, strict=True):
        if isinstance(own, tuple):
            _copy(other, own)
        elif own is not other:
            own[:] = other


class TrajectorySample(NamedTuple):
    """x(t), x'(t) and x''(t): a trajectory at one time, in its own units."""

    position: Array
    """x(t), shape (n,)."""
    velocity: Array
    """x'(t), shape (n,) [1/s]."""
    acceleration: Array
    """x''(t), shape (n,) [1/s²]."""

    @classmethod
    def allocate(cls, dimension: int) -> "TrajectorySample":
        """Return a sample of zeros with n = ``dimension``, for `Trajectory.sample`."""
        return cls(np.zeros(dimension), np.zeros(dimension), np.zeros(dimension))


class Trajectory(Part, ABC, family="trajectories", error=TrajectoryError):
    """x(t) in Rⁿ with x'(t) and x''(t); a value, defined at every t.

    A subclass declares its parameters as fields (see `Part`) and implements `dimension`
    and `sample`, or `call`, which makes a step faster. The coordinates may have any
    unit; a task defines its frame and units. A motion of finite duration rests at its
    first point before the start and at its last point after the end.

    Points may be relative to the robot's start: those moved by ``origin: start``, and
    omitted ones. Such a trajectory cannot be sampled; `anchored` returns it with all
    points in the world. Name the fields that hold points in `points`.

    Attributes:
        constant: Whether it rests at one point for ever.
    """

    constant: ClassVar[bool] = False
    points: ClassVar[tuple[str, ...]] = ()

    _: KW_ONLY
    origin: Literal["world", "start"] = "world"
    """Origin of the points: the world's, or the robot's start."""

    @property
    def relative(self) -> bool:
        """Whether it depends on the robot's start."""
        return self.origin == "start" or any(
            getattr(self, name) is None for name in self.points
        )

    def anchored(self, start: ArrayLike | None) -> "Trajectory":
        """Return this trajectory in the world, for a robot that starts at a point.

        A stream returns its reference in a new run; all others return their own type.

        Args:
            start: The robot's start, in the trajectory's coordinates, shape (n,); None:
            there is none, as for an obstacle.

        Raises:
            TrajectoryError: If it has another dimension, or is relative to a start that
                does not exist, or has no points that ``origin: start`` could move.
        """
        if self.origin == "start" and not self.points:
            raise TrajectoryError(
                f"origin: start cannot move a {type(self).__name__}; use origin: world"
            )
        if start is None:
            if not self.relative:
                return self
            if self.origin == "start":
                raise TrajectoryError(
                    "origin: start is not available here; use origin: world"
                )
            missing = next(n for n in self.points if getattr(self, n) is None)
            raise TrajectoryError(f"{missing} is missing: nothing starts here")
        where = np.asarray(start, dtype=float)
        origin = where if self.origin == "start" else np.zeros_like(where)
        moved: dict[str, Any] = {}
        for name in self.points:
            value = getattr(self, name)
            if value is None:
                moved[name] = where
                continue
            if value.shape[-1] != len(where):
                raise TrajectoryError(
                    f"{name} has {value.shape[-1]} coordinates {value.tolist()}; needs "
                    f"{len(where)}"
                )
            moved[name] = value + origin
        return replace(self, origin="world", **moved) if self.relative else self

    @property
    @abstractmethod
    def dimension(self) -> int:
        """The number n of coordinates."""

    @property
    def course(self) -> Course | None:
        """The interval in which it traverses its path; None: unknown."""
        return None

    def call(self) -> PartCall:
        """Return a kind of call with its arguments, without ``out``.

        With it, a `TrajectorySample`, it writes the result of `sample` at a time t; a
        function has t as its first parameter.
        """
        raise TypeError(f"{type(self).__name__} implements neither call nor sample")

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t), shapes (n,).

        Start an implementation with ``out = self._output(out)``, write all entries, and
        return ``out``.

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.

        Raises:
            ShapeError: If ``out`` has another dimension.
        """
        sample: TrajectorySample = sampled(self, t, self._output(out))
        return sample

    def calls(self, out: TrajectorySample) -> PartCalls:
        """Return the calls that write the sample into ``out``, at a `TIME`.

        From now on nothing else may write into ``out``, because calls may skip entries
        that do not change.
        """
        return calls_of_sample(self, self._output(out))

    def supplied(self) -> tuple[TrajectorySample, PartCalls]:
        """Return its sample as an argument of a call; see `planned`."""
        sample = TrajectorySample.allocate(self.dimension)
        return sample, self.calls(sample)

    def _output(self, out: TrajectorySample | None) -> TrajectorySample:
        """Return ``out``, or a new sample if it is None."""
        if self.relative:
            raise TrajectoryError(
                f"{type(self).__name__} is relative to where the robot starts, which "
                "only a controller knows; give points in the world, or `anchored`"
            )
        n = self.dimension
        if out is None:
            return TrajectorySample.allocate(n)
        checks.output(out, TrajectorySample, f"{n}")
        if len(out.position) != n:
            raise ShapeError(
                f"out has dimension {len(out.position)}; "
                f"this {type(self).__name__} has dimension {n}"
            )
        return out
