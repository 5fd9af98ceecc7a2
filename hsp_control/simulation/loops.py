"""The closed loop, row by row: the law in the integrator's stages, or sampled."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.control.compensation import CompensatedController
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel, Measurement
from hsp_control.control.output import ControlOutput
from hsp_control.robot import RobotState
from hsp_control.robot.integrators import Integrator, bound
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.plants import ContinuousPlant, IntegratedPlant, SampledPlant

if TYPE_CHECKING:
    from hsp_control.simulation.native_loop import NativeLoop

RUNAWAY_SPEED = 1e4
"""Joint speed [rad/s or m/s] above which a simulation has diverged."""


class Instant(NamedTuple):
    """One instant of the closed loop; the next one overwrites its arrays."""

    state: RobotState  # the true state
    output: ControlOutput  # the controller's output for the true state
    tau: Array  # the commanded effort, computed from the measured state, shape (nv,)
    log_channels: Mapping[
        str, LogChannel
    ]  # log channels of the controller and the plan, by name


def continuous_loop(
    controller: Controller,
    plant: ContinuousPlant,
    integrator: Integrator,
    times: Sequence[float],
    q: Array,
    v: Array,
) -> Iterator[Instant]:
    """Yield the instants of a loop without sampling, as in the proofs."""
    state = controller.state
    controller.restart(origin=0.0)

    def feedback(t: float, q: Array, v: Array) -> Array:
        tau = controller.compute(t, q, v).tau
        return plant.acceleration(t, q, v, tau)

    advance = integrator.begin(plant.robot, bound(feedback))
    for k, t in enumerate(times):
        if k > 0:
            q, v = advance(times[k - 1], t, q, v)
            _check_divergence(t, q, v)
        output = controller.compute(t, q, v)
        yield Instant(state, output, output.tau, {})


def sampled_loop(
    chain: ControlChain[CompensatedController],
    plant: SampledPlant,
    periods: int,
    times: Sequence[float],
    q: Array,
    v: Array,
) -> Iterator[Instant]:
    """Yield the instants of a loop that holds each effort for a control period."""
    plant.reset(times[0], q, v)
    compensated, excess = chain.compensated, LimitExcess(plant.robot)
    controller = compensated.controller
    period = (times[1] - times[0]) / periods
    native = _native_loop(chain, plant, excess)
    tau, count = np.zeros(plant.robot.nv), 0
    for start, end in zip(times, (*times[1:], times[-1]), strict=True):
        if end > start:
            period = (end - start) / periods
        k = 0
        while k < periods:
            t = start + k * (end - start) / periods
            measured = Measurement(count, t, *plant.measure(t, q, v))
            excess.record(controller.limits, q, v)
            if chain.needs_sensors:
                measured = measured._replace(
                    applied=tau,
                    wrenches=plant.contact_wrenches(t, q, v, tau),
                    inertial=plant.inertial(),
                )
            tau = chain.effort(measured, period).copy()
            if k == 0:
                output, state = compensated.output, compensated.state
                if not (t == state.t and _same(state.q, state.v, q, v)):
                    output = compensated.evaluate(t, q, v)
                channels = {
                    **chain.log_channels(q, v),
                    **excess.collect(controller.limits),
                }
                yield Instant(state, output, tau, channels)
            if end == start:  # the last row
                return
            made = native and native.advance(start, end, periods, k, tau)
            if made:
                q, v, after = made
            else:
                after = k + 1
                stop = start + after * (end - start) / periods
                q, v = plant.advance(t, stop, tau)
            k, count = after, count + after - k
        _check_divergence(end, q, v)


def _native_loop(
    chain: ControlChain[CompensatedController], plant: SampledPlant, excess: LimitExcess
) -> "NativeLoop | None":
    """Return the loop of many periods at once; None where each must be made alone."""
    compensated = chain.compensated
    bare = (
        chain.is_bare
        and type(compensated) is CompensatedController
        and not compensated.stages
    )
    if not bare or type(plant) is not IntegratedPlant:  # not a subclass of either
        return None
    steps = plant.native_steps()
    if steps is None:
        return None
    from hsp_control.simulation.native_loop import NativeLoop

    return NativeLoop(compensated.controller, plant, steps, excess)


def _check_divergence(t: float, q: Array, v: Array) -> None:
    if not _bounded(q, v):
        speed = float(np.abs(v).max())
        raise SimulationError(
            f"the motion diverged before t = {t:.6g} s: a joint moves at {speed:.3g} "
            "rad/s (or m/s). Possible causes: a singularity, gains too high for the "
            "control period, a field without a minimum"
        )


# Lists of a few numbers are quicker than NumPy's functions.


def _bounded(q: Array, v: Array) -> bool:
    """Return whether q is finite, and v below `RUNAWAY_SPEED`; NaN is neither."""
    slow = all(abs(speed) < RUNAWAY_SPEED for speed in v.tolist())
    return slow and all(map(isfinite, q.tolist()))


def _same(q: Array, v: Array, q_other: Array, v_other: Array) -> bool:
    """Return whether two states are equal."""
    return bool(q.tolist() == q_other.tolist() and v.tolist() == v_other.tolist())
