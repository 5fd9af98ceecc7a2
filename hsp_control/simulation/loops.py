"""The closed loop, row by row: the law in the integrator's stages, or sampled."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.common.kernels import kernel
from hsp_control.control.compensation import Command
from hsp_control.control.controller import Controller, ControlOutput
from hsp_control.control.log_channel import LogChannel
from hsp_control.robot import RobotState
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants import ContinuousPlant, SampledPlant

RUNAWAY_SPEED = 1e4
"""Joint speed [rad/s or m/s] beyond which a simulation is said to have diverged."""


class Instant(NamedTuple):
    """One instant of the closed loop; what it holds is overwritten by the next.

    Attributes:
        state: The true state.
        output: What the controller makes of the true state.
        tau: The effort that it commands, of what it is shown, shape (nv,).
        readings: What its compensation tell of themselves.
    """

    state: RobotState
    output: ControlOutput
    tau: Array
    log_channels: Mapping[str, LogChannel]


def continuous_loop(
    controller: Controller,
    plant: ContinuousPlant,
    integrator: Integrator,
    times: Sequence[float],
    q: Array,
    v: Array,
) -> Iterator[Instant]:
    """Yield the instants at given times of a loop without sampling, as in the proofs.

    Raises:
        SimulationError: If the motion diverges.
    """
    state = RobotState(controller.robot)
    controller.restart()

    def feedback(t: float, q: Array, v: Array) -> Array:
        tau = controller.compute(state.update(t, q, v)).tau
        return plant.acceleration(t, q, v, tau)

    for k, t in enumerate(times):
        if k > 0:
            q, v = integrator.advance(plant.robot, feedback, times[k - 1], t, q, v)
            _stop_runaway(t, q, v)
        output = controller.compute(state.update(t, q, v))
        yield Instant(state, output, output.tau, {})


def sampled_loop(
    command: Command,
    plant: SampledPlant,
    periods: int,
    times: Sequence[float],
    q: Array,
    v: Array,
) -> Iterator[Instant]:
    """Yield the instants at given times of a loop with ``periods`` efforts in between.

    Raises:
        SimulationError: If the motion diverges.
    """
    plant.reset(times[0], q, v)
    command.restart()
    period = (times[1] - times[0]) / periods
    for start, end in zip(times, (*times[1:], times[-1]), strict=True):
        if end > start:
            period = (end - start) / periods
        for k in range(periods):
            t = start + k * (end - start) / periods
            tau = command.effort(t, *plant.measure(t, q, v), period).copy()
            if k == 0:
                output, state = command.output, command.state
                if not (t == state.t and _equal(state.q, q) and _equal(state.v, v)):
                    output = command.at(t, q, v)
                yield Instant(state, output, tau, command.log_channels())
            if end == start:  # the last row: nobody waits for what comes next
                return
            stop = start + (k + 1) * (end - start) / periods
            q, v = plant.advance(t, stop, tau)
        _stop_runaway(end, q, v)


def _stop_runaway(t: float, q: Array, v: Array) -> None:
    if not (_within(q, np.inf) and _within(v, RUNAWAY_SPEED)):
        speed = float(np.abs(v).max())
        raise SimulationError(
            f"the motion diverged before t = {t:.6g} s: a joint moves at {speed:.3g} "
            "rad/s (or m/s). A singularity, gains too high for the control period, or "
            "a field without a minimum do that"
        )


@kernel
def _within(x: Array, bound: float) -> bool:
    """Return whether every component is a number smaller than a bound."""
    inside = True
    for i in range(x.shape[0]):
        inside = inside and bool(-bound < x[i] < bound)
    return inside


@kernel
def _equal(x: Array, y: Array) -> bool:
    """Return whether two vectors are the same."""
    same = bool(x.shape[0] == y.shape[0])
    for i in range(x.shape[0]):
        same = same and bool(x[i] == y[i])
    return same
