"""Followers: repeated sampling of trajectories into the same memory."""

from collections.abc import Callable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import CallSequence, TimeWindow, says, stay

Follower = Callable[[float], object]
"""A function of time [s] that writes the sample at that time into fixed memory."""


def sampled(trajectory: Any, t: float, out: Any) -> Any:
    """Write a trajectory's sample at time t [s] with its kernel, and return it."""
    function, arguments = trajectory.kernel()
    function(*arguments, *out, float(t))
    return out


def follow_sampled(trajectory: Any, out: Any) -> Follower:
    """Return the follower of a trajectory that says its kernel, or its sample."""
    if trajectory.constant:
        trajectory.sample(0.0, out)
        return stay
    if says(trajectory, "kernel", "sample") == "kernel":
        function, arguments = trajectory.kernel()
        return bind(function, *arguments, *out, timed=True)
    return follow_by(trajectory.sample, out)


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
