"""What a program sets while a frozen controller runs: gains, K_N, and targets.

Gains are as on a controller's time line: they crossfade to a new value, and go on from
what is then in force; see `Evolution`, and ``engine/frozen/evolve.hpp``.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.controller import Controller
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import LARGEST
from hsp_control.engine import Call
from hsp_control.frozen.image import TARGET, VELOCITY, Port
from hsp_control.law import VARYING
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.trajectories.streams.alone import StreamAlone
from hsp_control.trajectories.streams.stream import Streamed

_MOST = 8
"""How many ramps of one input may be under way."""


class Input(NamedTuple):
    """An input, and the calls that bring it up to a time."""

    port: Port
    calls: tuple[Call, ...]


def inputs_of(own: Controller, bound: BoundStep, period: float) -> Iterator[Input]:
    """Yield the inputs of a controller whose efforts are held for a period [s]."""
    for task in own.tasks:
        if impedance_of(task) is not None:
            continue  # changes of it wait where they would add energy
        # A scalar error is unstable from these on, whatever the other one is.
        Kp, Kv, *_ = own.feedback(task.name)
        if task.order == 1:
            meaning, most = "rate of the error", 2.0 / period
            yield _matrix(f"{task.name}.K", "1/s", meaning, Kp, most)
            continue
        meaning, most = "stiffness of the error equation", 4.0 / period**2
        yield _matrix(f"{task.name}.Kp", "1/s²", meaning, Kp, most)
        meaning, most = "damping of the error equation", 2.0 / period
        yield _matrix(f"{task.name}.Kv", "1/s", meaning, Kv, most)
    K_N = bound.active.resolution.problem.gain
    meaning = "K_N, rate of the null-space error"
    name, most = "null_space_gain", min(2.0 / period, LARGEST)
    if own.metric.form != VARYING:
        yield _matrix(name, "1/s", meaning, K_N, most)
        return
    k = np.array([K_N[0, 0]])  # it is a multiple of the identity: see `checked_gain`
    evolve = _evolving(k, np.nextafter(0.0, 1.0), most, 0)
    port = Port(name, "1/s", meaning, k, evolve)
    yield Input(port, (evolve, engine.ScaledIdentity(k=k, out=K_N)))


def streams_of(own: Controller) -> dict[str, StreamAlone]:
    """Return the streams of a controller without Python, by the tasks' names."""
    found = {}
    for task in own.tasks:
        for stream in parts_within(task, Streamed):
            found[task.name] = stream.alone
    return found


def targets_of(own: Controller, streams: Mapping[str, StreamAlone]) -> Iterator[Port]:
    """Yield the targets and velocities that a program sends.

    They count from the next step on: the newest one, as of a stream's ``latest``.
    """
    for task in own.tasks:
        if task.name not in streams:
            continue
        stream = streams[task.name]
        turns = len(stream.target) > len(stream.velocity)
        unit = "m or the task's, and a quaternion x, y, z, w" if turns else "the task's"
        meaning = "where the reference goes, and rests"
        at = f"{task.name}.target"
        yield Port(at, unit, meaning, stream.target, stream.call, TARGET)
        meaning = "how it moves until it fades: linear, then angular, in world axes"
        at = f"{task.name}.velocity"
        yield Port(at, "1/s", meaning, stream.velocity, stream.call, VELOCITY)


def _matrix(name: str, unit: str, meaning: str, own: Array, most: float) -> Input:
    """Return a positive definite matrix as an input, row by row."""
    x = own.reshape(-1)
    assert np.shares_memory(x, own)
    evolve = _evolving(x, -most, most, len(own))
    return Input(Port(name, unit, meaning, x, evolve), (evolve,))


def _evolving(x: Array, least: float, most: float, definite: int) -> Call:
    return engine.Evolve(
        initial=x.copy(),
        targets=np.zeros((_MOST, len(x))),
        times=np.zeros((_MOST, 2)),
        count=np.zeros(1, dtype=np.int64),
        least=least,
        most=most,
        definite=definite,
        x=x,
    )
