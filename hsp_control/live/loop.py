"""Run a live loop: check, compile and allocate, then control the robot."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError, LiveError
from hsp_control.control.compensation import Command
from hsp_control.control.controller import Controller
from hsp_control.control.estimator import Estimator
from hsp_control.control.first_state import warn_of_slow_efforts
from hsp_control.control.plan import Plan
from hsp_control.declaration.nested import parts_within
from hsp_control.geometry.scene import Scene
from hsp_control.live.bearing_feet import BearingFeet, balance_of
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.hardware import Hardware
from hsp_control.live.live_log import LoopLog
from hsp_control.live.one_run import OneRun
from hsp_control.live.operator_requests import OperatorRequests, stop_signals
from hsp_control.live.real_time import no_garbage_collection, real_time_priority
from hsp_control.live.report import LoopReport
from hsp_control.live.safe_stop import SafeStop
from hsp_control.live.settings import LiveSettings, check_held
from hsp_control.live.state_reader import StateReader
from hsp_control.simulation.control_chain import ControlChain, EffortSource
from hsp_control.trajectories.schedule import Schedule

_WARM_UP = 20
"""Steps before real-time operation: they compile kernels and touch all memory."""


def run_loop(
    controller: Controller | EffortSource,
    hardware: Hardware,
    *,
    duration: float | None = None,
    plan: Plan | None = None,
    estimators: Sequence[Estimator] = (),
    settings: LiveSettings | None = None,
    requests: OperatorRequests | None = None,
    log: str | Path | None = None,
    log_period: float = 0.01,
    scene: Scene | None = None,
    meta: Mapping[str, Any] | None = None,
    start_time: float = 0.0,
    priority: int | None = None,
    on_period: Callable[[float], object] | None = None,
    clock: Callable[[], float] = monotonic,
) -> LoopReport:
    """Control a robot until the duration is over, the operator stops, or a fault.

    Every run ends with a safe stop, damping and then hold (`SafeStop`); then the
    hardware is closed. Faults are: a state that is malformed, not finite, missing,
    frozen, too old, outside the limits, or further from the last one than the robot can
    be; a clock of the robot that jumps; a robot that stopped by itself or cannot be
    reached; a fall; any exception of the hardware, the controller, the plan or a
    change. Once real-time
    operation has begun, nothing is raised; the report contains the fault.

    Ctrl-C and SIGTERM are the operator's stop (`stop_signals`).

    Args:
        controller: The controller, or an `EffortSource` around one.
        hardware: The robot.
        duration: Time from the first state to the stop [s]; None: until the operator
            stops.
        plan: What writes references and switches contacts; the controller is made of
            its `Plan.parts`.
        estimators: What completes each measurement, for the plan and the controller.
        settings: Which efforts the robot accepts, the faults that are tolerated, and
            how the safe stop brakes and holds; None: the defaults.
        requests: The operator's requests: stop the loop, or change the controller
            between periods. `KeyboardInterrupt` is the operator's stop, too.
        log: The journal to write; `Rollout.load` reads it also after a crash.
        log_period: Time between two rows [s], a period or longer.
        scene: Obstacles to log; None: those of the controller.
        meta: JSON data to add to the log's.
        start_time: The controller's time at the first state [s].
        priority: Real-time priority (SCHED_FIFO), 1 to 99; None: ordinary scheduling.
        on_period: Called with the controller's time [s] in the rest of every period.
        clock: A monotonic clock [s].

    Returns:
        How the run ended, and its response times.

    Raises:
        LiveError: If the robot has a floating base that nothing holds, or a setting is
            invalid.
        HardwareError: If no first state arrives, or the robot cannot be started.
        LogError: If the journal cannot be created.
        HspControlError: If the controller, the plan or an estimator raises at the first
            state: what it needs may not be measured.
    """
    source = Command(controller) if isinstance(controller, Controller) else controller
    settings = settings or LiveSettings()
    chain = ControlChain(source, plan, estimators)
    controller = source.controller
    robot, period = controller.robot, hardware.period
    requests = requests or OperatorRequests()
    with stop_signals(requests):
        try:
            _check(period, duration, log_period)
            check_held(robot, controller.contacts, settings)
            limits = controller.limits
            limiter = EffortLimiter(robot, settings, period, limits)
            feet = BearingFeet(robot, controller.contacts)
            safe_stop = SafeStop(
                robot, settings.stop, limiter.effort_limits, period, feet
            )
            reader = StateReader(robot, limits, hardware, settings, clock, start_time)
            first = reader.wait_for_first()
            # Compile and allocate everything now, not in real-time operation.
            chain.begin(first.inertial)
            for _ in range(_WARM_UP):
                chain.effort(first._replace(t=start_time, applied=None), period)
                safe_stop.effort(reader.state)
                limiter.reset(first.q)
            end = np.inf if duration is None else start_time + duration - 0.5 * period
            rehearse(controller, start_time, end, first.q, first.v)
            warn_of_slow_efforts(robot, first.q, limits)
            shown = scene or controller.scene
            loop_log = LoopLog(log, log_period, chain, shown, dict(meta or {}))
            loop_log.warm_up(reader, limiter)
            chain.begin(first.inertial, robot.state(start_time, first.q, first.v))
            controller.compute(start_time, first.q, first.v)  # begins
            loop_log.begin()
            safe_stop.begin()
            balance = balance_of(robot, controller.contacts, reader.state)
            loop = OneRun(
                chain,
                hardware,
                reader,
                limiter,
                safe_stop,
                loop_log,
                requests,
                settings,
                end,
                balance,
            )
            with real_time_priority(priority), no_garbage_collection():
                loop.run(on_period)
        except BaseException:
            with suppress(Exception):  # the first error is what matters
                hardware.close()
            raise
        return loop.finish()


def _check(period: float, duration: float | None, log_period: float) -> None:
    if not 0.0 < period < np.inf:
        raise LiveError(f"the hardware's period is {period} s; must be positive")
    if duration is not None and not duration > 0.0:
        raise LiveError(f"duration is {duration} s; must be positive")
    if not log_period >= period * (1.0 - 1e-9):
        raise LiveError(
            f"log_period is {log_period:g} s; must be a period, {period:g} s, or longer"
        )


_MOST = 200
"""Most instants that are rehearsed: a schedule may repeat itself for hours."""


def rehearse(
    controller: Controller, start: float, end: float, q: Array, v: Array
) -> None:
    """Evaluate a copy of a controller wherever its tasks or contacts change."""
    # Their native calls are compiled then, not in the loop: a robot waits no seconds.
    times = sorted({t for t in _instants(controller) if start < t <= end and t < inf})
    if not times:
        return
    preview = controller.preview()
    for t in islice(times, _MOST):
        with suppress(HspControlError):  # the robot will be elsewhere then
            preview.compute(t, q, v)


def _instants(controller: Controller) -> Iterator[float]:
    """Yield when sets of tasks and contacts begin: amid ramps, and after them [s]."""
    declared = controller.tasks, controller.contacts, controller.changes
    for schedule in parts_within(declared, Schedule):
        for begin, end in schedule.windows:
            yield begin
            yield begin + 0.5 * schedule.ramp
            yield begin + schedule.ramp
            yield end - 0.5 * schedule.ramp
            yield end
    for change in controller.changes:
        yield change.at
        yield change.at + 0.5 * change.ramp
        yield change.end
