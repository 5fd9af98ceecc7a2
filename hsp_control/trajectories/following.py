"""Sampling again and again into the same memory, as a control loop does."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import CallSequence, TimeWindow

Follower = Callable[[float], object]
"""A function of time [s] that brings a sample, its own, up to that time."""

Kernel = tuple[Callable[..., None], tuple[Any, ...]]
"""``(function, parameters)``, called as ``function(*parameters, *sample, t)``."""


def stay(t: float) -> None:
    """Follow what does not move: its sample has been written already."""


def follow_all(*followers: Follower) -> Follower:
    """Return what calls followers in turn; those that `stay` are left out."""
    moving = [follower for follower in followers if follower is not stay]
    if len(moving) < 2:
        return moving[0] if moving else stay
    return CallSequence(*moving)


def follow_by(sampler: Callable[[float, Any], Any], out: Any) -> Follower:
    """Return the follower of anything that has a ``sample(t, out)``."""

    def follower(t: float) -> None:
        sample = sampler(t, out)
        if sample is not out:
            for own, other in zip(out, sample, strict=True):
                own[:] = other

    return follower


def follow_blended(
    trajectory: Any, out: Any, blend: Follower, start: float, end: float
) -> Follower:
    """Return the follower of a trajectory that a blend changes in place until its end.

    Args:
        trajectory: What is led to, from ``start`` on.
        out: The sample.
        blend: What changes it, until ``end``.
        start: When the blend begins [s].
        end: When it ends [s].
    """
    lead_to: Follower = trajectory.follow(out)
    if lead_to is stay:  # but the blend does not leave it alone
        parts = (bind(_put, part.copy(), part, timed=True) for part in out)
        lead_to = CallSequence(*parts)
    return CallSequence(
        TimeWindow(lead_to, start, np.inf), TimeWindow(blend, -np.inf, end)
    )


@kernel
def _put(kept: Array, out: Array, t: float) -> None:
    """Write what was kept, whatever the time."""
    for i in range(out.size):
        out.flat[i] = kept.flat[i]


class Compiled(ABC):
    """What one kernel samples: say which in `_kernel`, and no more is to be written."""

    __slots__ = ()

    _output: Callable[[Any], Any]  # the family's: ``out`` if it fits, or a new sample

    @abstractmethod
    def _kernel(self) -> Kernel:
        """Return the kernel and its parameters."""

    def sample(self, t: float, out: Any = None) -> Any:
        """Return the sample at time t; see `Trajectory.sample`."""
        out = self._output(out)
        function, parameters = self._kernel()
        function(*parameters, *out, float(t))
        return out

    def follow(self, out: Any) -> Follower:
        """Return the follower; see `Trajectory.follow`."""
        function, parameters = self._kernel()
        return bind(function, *parameters, *out, timed=True)
