"""The live loop: read states, send efforts, and always end with a safe stop."""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError, LiveError
from hsp_control.control.controller import Controller
from hsp_control.geometry.scene import Scene
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.effort_source import EffortSource, as_effort_source
from hsp_control.live.hardware import Hardware
from hsp_control.live.latency import no_garbage_collection, real_time_priority
from hsp_control.live.live_log import LoopLog
from hsp_control.live.operator_requests import OperatorRequests
from hsp_control.live.report import Ended, LoopReport
from hsp_control.live.safe_stop import Phase, SafeStop
from hsp_control.live.settings import LiveSettings, check_fixed
from hsp_control.live.state_reader import StateReader
from hsp_control.robot import Robot

_WARM_UP = 20
"""Steps before real-time operation: they compile kernels and touch all memory."""


def run_loop(
    controller: Controller | EffortSource,
    hardware: Hardware,
    *,
    duration: float | None = None,
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
    hardware is closed. Faults are: a state that is not finite, missing, too old or
    outside the limits; a robot that stopped by itself or cannot be reached; any
    exception of the controller or of a change. After the first effort was sent nothing
    is raised; the report contains the fault.

    Args:
        controller: The controller, or an `EffortSource` around one.
        hardware: The robot.
        duration: Time from the first state to the stop [s]; None: until the operator
            stops.
        settings: Which efforts the robot accepts, the faults that are tolerated, and
            how the safe stop brakes and holds; None: the defaults.
        requests: The operator's requests: stop the loop, or change the controller
            between periods. Ctrl-C (`KeyboardInterrupt`) is the operator's stop, too.
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
        LiveError: If the robot has a floating base, or a setting is invalid.
        HardwareError: If no first state arrives, or the robot cannot be started.
        LogError: If the journal cannot be created.
        HspControlError: If the controller raises at the first state.
    """
    effort_source, settings = as_effort_source(controller), settings or LiveSettings()
    robot, period = effort_source.controller.robot, hardware.period
    try:
        _check(robot, period, duration, log_period)
        limits = effort_source.controller.limits
        limiter = EffortLimiter(robot, settings, period, limits)
        safe_stop = SafeStop(robot, settings.stop, limiter.effort_limits, period)
        reader = StateReader(robot, limits, hardware, settings, clock)
        first = reader.wait_for_first(start_time)
        # Compile and allocate everything now, not in real-time operation.
        for _ in range(_WARM_UP):
            effort_source.effort(start_time, first.q, first.v, period)
            safe_stop.effort(reader.state)
            limiter.reset(first.q)
        shown = scene or effort_source.controller.scene
        loop_log = LoopLog(log, log_period, effort_source, shown, dict(meta or {}))
        loop_log.warm_up(reader, limiter)
        effort_source.restart()
        effort_source.controller.compute(start_time, first.q, first.v)  # begins there
        safe_stop.begin()
        end = np.inf if duration is None else start_time + duration - 0.5 * period
        loop = _Loop(effort_source, hardware, reader, limiter, safe_stop, loop_log, end)
        loop.requests = requests or OperatorRequests()
        loop.prediction_time = settings.prediction_time
        scheduling = nullcontext() if priority is None else real_time_priority(priority)
        with scheduling, no_garbage_collection():
            loop.run(on_period)
    finally:
        hardware.close()
    return loop.finish()


def _check(
    robot: Robot, period: float, duration: float | None, log_period: float
) -> None:
    check_fixed(robot)
    if not 0.0 < period < np.inf:
        raise LiveError(f"the hardware's period is {period} s; must be positive")
    if duration is not None and not duration > 0.0:
        raise LiveError(f"duration is {duration} s; must be positive")
    if not log_period >= period * (1.0 - 1e-9):
        raise LiveError(
            f"log_period is {log_period:g} s; must be a period, {period:g} s, or longer"
        )


class _Loop:
    """The state of one run; `period` is called once a period."""

    requests: OperatorRequests
    prediction_time: float

    def __init__(
        self,
        effort_source: EffortSource,
        hardware: Hardware,
        reader: StateReader,
        limiter: EffortLimiter,
        safe_stop: SafeStop,
        log: LoopLog,
        end: float,
    ) -> None:
        self.effort_source, self.hardware, self.reader = effort_source, hardware, reader
        self.limiter, self.safe_stop, self.log = limiter, safe_stop, log
        self.end = end
        self.phase = Phase.RUNNING
        self.ended: Ended = "completed"
        self.reason = ""
        self.error: Exception | None = None
        self.silent = self.done = False

    def run(self, on_period: Callable[[float], object] | None) -> None:
        """Run period after period until the safe stop is complete."""
        self.reader.start()
        self.limiter.reset(self.reader.state.q)
        while not self.done:
            try:
                self.period(on_period)
            except KeyboardInterrupt:
                if self.phase != Phase.RUNNING:  # the second: the robot must stop
                    self.silent = self.done = True
                self.stop("operator", "stopped by the operator (Ctrl-C)")

    def period(self, on_period: Callable[[float], object] | None) -> None:
        """Read a state, send an effort, then log and make the requested changes."""
        reader, limiter = self.reader, self.limiter
        reader.read(limiter.applied, self.effort_source.controller.limits)
        if reader.fault is not None:
            self.stop("fault", reader.fault, reader.error)
        elif self.requests.reason is not None:
            self.stop("operator", self.requests.reason)
        elif reader.state.t >= self.end:
            self.stop("completed", "the duration is over")
        tau = self.controller_effort() if self.phase == Phase.RUNNING else None
        if self.phase != Phase.RUNNING:
            tau = self.stop_effort()
        limiter.follow(self.effort_source.controller.limits)
        if tau is not None and not limiter.apply(tau, reader.state.q):
            self.stop("fault", f"the effort is not finite: {tau.tolist()}")
        self.send()
        response = reader.effort_sent()
        self.effort_source.applied(limiter.applied, self.hardware.period)
        try:
            self.log.row(self.phase, reader, limiter, response, last=self.done)
            if self.phase == Phase.RUNNING:
                self.requests.run_pending()
                if on_period is not None:
                    on_period(reader.state.t)
        except Exception as error:  # of a user's change, or the disk is full
            self.stop("fault", f"{type(error).__name__}: {error}", error)

    def controller_effort(self) -> Array | None:
        """Return the controller's effort; None without a measurement: hold the last."""
        measurement, t = self.reader.measurement, self.reader.state.t
        if measurement is None:
            return None
        try:
            return self.effort_source.effort(
                t, measurement.q, measurement.v, self.hardware.period
            )
        except Exception as error:  # a user's task or field may raise anything
            self.log.controller_failed = True
            self.stop("fault", f"{type(error).__name__}: {error}", error)
            return None

    def stop_effort(self) -> Array:
        """Return the safe stop's effort at the measured or predicted state."""
        tau = self.safe_stop.effort(self.reader.state)
        self.phase = self.safe_stop.phase
        too_long = self.reader.predicted_for > self.prediction_time
        self.silent = self.reader.connection_lost or too_long
        self.done = self.silent or self.safe_stop.done
        return tau

    def stop(self, ended: Ended, reason: str, error: Exception | None = None) -> None:
        """Start the safe stop; later calls change neither it nor the reason."""
        if self.phase != Phase.RUNNING:
            return
        self.phase = Phase.DAMPING
        self.ended, self.reason, self.error = ended, reason, error
        self.safe_stop.begin()

    def send(self) -> None:
        """Send the limited effort, unless the state is unknown (fail-silent)."""
        if self.silent:
            return
        try:
            self.hardware.write(self.limiter.sent)
        except (HardwareError, OSError) as error:
            self.stop("fault", f"the effort cannot be sent: {error}", error)

    def finish(self) -> LoopReport:
        """Close the log, and return the report."""
        state = self.reader.state
        report = LoopReport(
            ended=self.ended,
            reason=self.reason,
            phase=self.phase,
            silent=self.silent,
            speed=float(np.abs(state.v).max()),
            t=state.t,
            deadlines=self.reader.deadlines,
            error=self.error,
            log=self.log.path,
        )
        self.log.end(report)
        return report
