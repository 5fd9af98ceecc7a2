"""The safe stop of a frozen controller: what `hsp live` does, for ``hsp_stop``."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits.joint_numbers import own_maximum
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.controller import Controller
from hsp_control.engine import Call, Move, Plan
from hsp_control.frozen.image import Port


class StopGains(NamedTuple):
    """How a robot is braked, and then held; see `hsp_control.live`'s settings."""

    damping: float = 20.0
    """k of the braking effort -k M(q) v [1/s]."""
    natural_frequency: float = 10.0
    """Natural frequency of what then holds it [rad/s]."""
    rest_speed: float = 0.01
    """Joint speed below which holding begins [rad/s or m/s]."""
    longest_damping: float = 2.0
    """Maximum duration of braking [s]."""


LIKE_LIVE = StopGains()
"""Those that `hsp live` has by default."""

LARGEST = {"damping": 0.5, "natural_frequency": 0.2}
"""Largest products of these with the period h. With one period of delay a rate k is
stable for k h < 1 and a natural frequency ω for ω h < 0.43 (docs/robustness.md); half
of it is the margin for model errors."""


def stopping(
    own: Controller,
    bound: BoundStep,
    gains: StopGains,
    period: Array,
    origin: Array,
    first: Sequence[Call],
) -> tuple[Move, list[Port]]:
    """Return the safe stop as one move, and what it says.

    Where joints are not counted from zero, as one that turns without end, it damps and
    does not hold.

    Args:
        own: The controller, of a robot with a fixed base.
        bound: Its step.
        gains: How it brakes.
        period: How long each effort is held, shape (1,) [s].
        origin: What the clock reads at time 0, shape (1,) [s].
        first: The calls that bring the model up to a time.
    """
    robot, dynamics = own.robot, bound.state.dynamics
    nv, holds = robot.nv, robot.linear
    q, v, tau = robot.neutral(), np.zeros(nv), np.zeros(nv)
    M, (gravity, away, rest) = np.zeros((nv, nv)), np.zeros((3, nv))
    held_q, holding = robot.neutral(), np.zeros(1, dtype=np.int64)
    if own.limits is None:
        limits = own_maximum(robot.model.effortLimit, robot)
    else:
        limits = np.array(own.limits.effort)
    given = {"dynamics": dynamics, "q": q}
    calls = [
        *first,
        engine.MassMatrix(**given, M=M),
        engine.InverseDynamics(**given, v=rest, acceleration=rest, effort=gravity),
    ]
    if holds:
        calls += [engine.Copy(x=q, out=away), engine.Subtract(x=held_q, out=away)]
    settings = gains if holds else gains._replace(rest_speed=-1.0, longest_damping=1e9)
    stop = engine.SafeStop(
        **settings._asdict(),
        period=period,
        q=q,
        v=v,
        gravity=gravity,
        away=away,
        M=M,
        limits=limits,
        damped_for=np.zeros(1),
        holding=holding,
        held_q=held_q,
        held_mass=np.zeros((nv, nv)),
        tau=tau,
    )
    values = bound.move.values | {
        "calls": Plan([*calls, stop]),
        "time": np.zeros(1),
        "origin": origin,
        "q": q,
        "v": v,
        "stamp": np.zeros(1, dtype=np.int64),
    }
    effort = Port("stop.tau", "N·m or N", "the effort that brakes, or holds", tau)
    held = Port("stop.holding", "-", "whether it holds", holding)
    rate = Port("stop.damping", "1/s", "how it brakes", np.array([gains.damping]))
    return engine.Move(**values), [effort, held, rate]
