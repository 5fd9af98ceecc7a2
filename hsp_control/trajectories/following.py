"""Followers: repeated sampling of trajectories into the same memory."""

from collections.abc import Callable
from typing import Any

from hsp_control.common.native import bind, one_call, says, stay, supplied

Follower = Callable[[float], object]
"""A function of time [s] that writes the sample at that time into fixed memory."""


def sampled(trajectory: Any, t: float, out: Any) -> Any:
    """Write a trajectory's sample at time t [s] with its kernel, and return it."""
    function, arguments = trajectory.kernel()
    given = [x.sample(t) if hasattr(x, "sample") else x for x in arguments]
    function(*given, out, float(t))
    return out


def follow_sampled(trajectory: Any, out: Any) -> Follower:
    """Return the follower of a trajectory that says its kernel, or its sample."""
    if trajectory.constant:
        trajectory.sample(0.0, out)
        return stay
    if says(trajectory, "kernel", "sample") == "kernel":
        function, arguments = trajectory.kernel()
        given, follow, _ = supplied(arguments)
        return follow_all(*follow, bind(function, *given, out, timed=True))
    return follow_by(trajectory.sample, out)


def follow_all(*followers: Follower) -> Follower:
    """Return a follower that calls others in order, without those that are `stay`."""
    moving = [follower for follower in followers if follower is not stay]
    if len(moving) < 2:
        return moving[0] if moving else stay
    return one_call(moving)


def follow_by(sampler: Callable[[float, Any], Any], out: Any) -> Follower:
    """Return a follower that calls ``sampler(t, out)`` and writes ``out``."""

    def follower(t: float) -> None:
        sample = sampler(t, out)
        if sample is not out:
            for own, other in zip(out, sample, strict=True):
                own[:] = other

    return follower
