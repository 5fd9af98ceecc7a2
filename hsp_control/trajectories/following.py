"""Followers: repeated sampling of trajectories into the same memory."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import CallSequence, TimeWindow, stay

Follower = Callable[[float], object]
"""A function of time [s] that writes the sample at that time into fixed memory."""

Kernel = tuple[Callable[..., None], tuple[Any, ...]]
"""``(function, parameters)``, called as ``function(*parameters, *sample, t)``."""


def follow_all(*followers: Follower) -> Follower:
    """Return a follower that calls others in order, without those that are `stay`."""
    moving = [follower for follower in followers if follower is not stay]
    if len(moving) < 2:
        return moving[0] if moving else stay
    return CallSequence(*moving)


def follow_by(sampler: Callable[[float, Any], Any], out: Any) -> Follower:
    """Return a follower that calls ``sampler(t, out)`` and writes ``out``."""

    def follower(t: float) -> None:
        sample = sampler(t, out)
        if sample is not out:
            for own, other in zip(out, sample, strict=True):
                own[:] = other

    return follower


def follow_blended(
    trajectory: Any, out: Any, blend: Follower, start: float, end: float
) -> Follower:
    """Return the follower of a trajectory that ``blend`` changes until ``end``."""
    target: Follower = trajectory.follow(out)
    if target is stay:  # the blend changes ``out``, so it must be written every time
        target = CallSequence(*map(_restorer, out))
    return CallSequence(
        TimeWindow(target, start, np.inf), TimeWindow(blend, -np.inf, end)
    )


def _restorer(out: Array) -> Follower:
    """Return what writes the present values into ``out``, of any shape, at any time."""
    flat = out.view()
    flat.shape = (-1,)  # of the same memory, or it raises
    return bind(_restore, flat.copy(), flat, timed=True)


@kernel
def _restore(constant: Array, out: Array, t: float) -> None:
    """Write the constant values into ``out``, at any time."""
    for i in range(out.shape[0]):
        out[i] = constant[i]


class Compiled(ABC):
    """Mixin, named before the abstract class: the kernel of `_kernel` samples."""

    __slots__ = ()

    _output: Callable[[Any], Any]  # the abstract class's: ``out``, checked, or a new

    @abstractmethod
    def _kernel(self) -> Kernel:
        """Return the kernel and its parameters: ``kernel(*parameters, *sample, t)``."""

    def sample(self, t: float, out: Any = None) -> Any:
        """Return the sample at time t [s]; see `Trajectory.sample`."""
        out = self._output(out)
        function, parameters = self._kernel()
        function(*parameters, *out, float(t))
        return out

    def follow(self, out: Any) -> Follower:
        """Return the follower; see `Trajectory.follow`."""
        out = self._output(out)
        function, parameters = self._kernel()
        return bind(function, *parameters, *out, timed=True)
