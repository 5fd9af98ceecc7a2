"""The live loop: states in, efforts out, and a safe stop whatever happens."""

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
from hsp_control.live.commander import Commander, as_commander
from hsp_control.live.effort_port import EffortPort
from hsp_control.live.hardware import Hardware
from hsp_control.live.intake import Intake
from hsp_control.live.latency import no_garbage_collection, real_time_priority
from hsp_control.live.live_log import LoopLog
from hsp_control.live.operator import Operator
from hsp_control.live.report import Ended, LoopReport
from hsp_control.live.safe_stop import Phase, SafeStop
from hsp_control.live.settings import (
    EffortInterface,
    StopSettings,
    Tolerance,
    check_fixed,
)
from hsp_control.robot import Robot

_WARM_UP = 20
"""Steps off the clock: all kernels are compiled, all memory is touched."""


def run_loop(
    controller: Controller | Commander,
    hardware: Hardware,
    *,
    duration: float | None = None,
    interface: EffortInterface | None = None,
    tolerance: Tolerance | None = None,
    stop: StopSettings | None = None,
    operator: Operator | None = None,
    log: str | Path | None = None,
    log_period: float = 0.01,
    scene: Scene | None = None,
    meta: Mapping[str, Any] | None = None,
    start_time: float = 0.0,
    priority: int | None = None,
    on_period: Callable[[float], object] | None = None,
    clock: Callable[[], float] = monotonic,
) -> LoopReport:
    """Control a robot until the time is over, the operator stops, or a fault.

    Every end is the same: a safe stop, damping and then hold (`SafeStop`), after which
    the hardware is closed. Faults are a state that is not finite, missing, too old or
    beyond the limits, a robot that stopped by itself or cannot be reached, and anything
    that the controller or a change raises. Nothing is raised once the first effort is
    out; the report has what was.

    Args:
        controller: The controller, or a `Commander` around one.
        hardware: The robot.
        duration: When to stop, after the first state [s]; None: when the operator says.
        interface: How the robot wants its efforts.
        tolerance: What is put up with.
        stop: How the safe stop brakes and holds.
        operator: What may stop the loop, and change the controller between periods.
            Ctrl-C, where Python raises it, is the operator's stop as well.
        log: The journal to write; `Rollout.load` reads it whatever happened.
        log_period: Time between two rows [s], a period or longer.
        scene: Obstacles to log.
        meta: JSON data to add to the log's.
        start_time: The law's time at the first state [s].
        priority: Real-time priority (SCHED_FIFO); None: that of all processes.
        on_period: Called with the law's time [s] in the rest of every period.
        clock: A monotonic clock [s].

    Raises:
        LiveError: If the robot has a floating base, or settings contradict each other.
        HardwareError: If no first state comes, or the robot is not fit to start.
        LogError: If the journal cannot be begun.
        HspControlError: If the law has no effort at the first state.
    """
    commander, tolerance = as_commander(controller), tolerance or Tolerance()
    settings, interface = stop or StopSettings(), interface or EffortInterface()
    robot, period = commander.controller.robot, hardware.period
    try:
        _check(robot, period, duration, log_period)
        port = EffortPort(robot, interface, period)
        safe_stop = SafeStop(robot, settings, port.greatest, period)
        limits = commander.controller.limits
        intake = Intake(robot, limits, hardware, tolerance, clock)
        first = intake.first(start_time)
        for _ in range(
            _WARM_UP
        ):  # on the clock nothing shall happen for the first time
            commander.effort(start_time, first.q, first.v, period)
            safe_stop.effort(intake.state)
            port.begin(first.q)
        book = LoopLog(log, log_period, commander, scene, dict(meta or {}))
        book.rehearse(intake, port)
        commander.restart()
        safe_stop.begin()
        end = np.inf if duration is None else start_time + duration - 0.5 * period
        loop = _Loop(commander, hardware, intake, port, safe_stop, book, end)
        loop.operator, loop.blind = operator or Operator(), tolerance.blind
        first_of_all = (
            nullcontext() if priority is None else real_time_priority(priority)
        )
        with first_of_all, no_garbage_collection():
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
    """One run; `period` is one turn of it."""

    operator: Operator
    blind: float

    def __init__(
        self,
        commander: Commander,
        hardware: Hardware,
        intake: Intake,
        port: EffortPort,
        safe_stop: SafeStop,
        book: LoopLog,
        end: float,
    ) -> None:
        self.commander, self.hardware, self.intake = commander, hardware, intake
        self.port, self.safe_stop, self.book, self.end = port, safe_stop, book, end
        self.phase = Phase.RUNNING
        self.ended: Ended = "completed"
        self.reason = ""
        self.error: Exception | None = None
        self.silent = self.over = False

    def run(self, on_period: Callable[[float], object] | None) -> None:
        """Run period after period until the safe stop is over."""
        self.intake.begin()
        self.port.begin(self.intake.state.q)
        while not self.over:
            try:
                self.period(on_period)
            except KeyboardInterrupt:
                if self.phase != Phase.RUNNING:  # again: leave the robot to itself
                    self.silent = self.over = True
                self.stop("operator", "stopped by the operator (Ctrl-C)")

    def period(self, on_period: Callable[[float], object] | None) -> None:
        """Take a state, send an effort, and do the rest."""
        intake, port = self.intake, self.port
        intake.take(port.acting)
        if intake.trouble is not None:
            self.stop("fault", intake.trouble, intake.error)
        elif self.operator.reason is not None:
            self.stop("operator", self.operator.reason)
        elif intake.state.t >= self.end:
            self.stop("completed", "its time is over")
        tau = self.command() if self.phase == Phase.RUNNING else None
        if self.phase != Phase.RUNNING:
            tau = self.stopping()
        if tau is not None and not port.pass_on(tau, intake.state.q):
            self.stop("fault", f"the effort is not finite: {tau.tolist()}")
        self.send()
        response = intake.answered()
        self.commander.applied(port.acting, self.hardware.period)
        try:
            self.book.row(self.phase, intake, port, response, last=self.over)
            if self.phase == Phase.RUNNING:
                self.operator.make_changes()
                if on_period is not None:
                    on_period(intake.state.t)
        except Exception as error:  # a user's change, or a disk that is full
            self.stop("fault", f"{type(error).__name__}: {error}", error)

    def command(self) -> Array | None:
        """Return the law's effort; None, for the last one, where nothing was seen."""
        found, t = self.intake.found, self.intake.state.t
        if found is None:
            return None
        try:
            return self.commander.effort(t, found.q, found.v, self.hardware.period)
        except Exception as error:  # whatever a user's task or field may raise
            self.book.law_is_well = False
            self.stop("fault", f"{type(error).__name__}: {error}", error)
            return None

    def stopping(self) -> Array:
        """Return the safe stop's effort, at the state that was seen or is reckoned."""
        tau = self.safe_stop.effort(self.intake.state)
        self.phase = self.safe_stop.phase
        self.silent = self.intake.gone or self.intake.blind > self.blind
        self.over = self.silent or self.safe_stop.done
        return tau

    def stop(self, ended: Ended, reason: str, error: Exception | None = None) -> None:
        """Begin the safe stop, once; what comes later changes no reason."""
        if self.phase != Phase.RUNNING:
            return
        self.phase = Phase.DAMPING
        self.ended, self.reason, self.error = ended, reason, error
        self.safe_stop.begin()

    def send(self) -> None:
        """Send what the port has, unless nobody knows any more what that should be."""
        if self.silent:
            return
        try:
            self.hardware.write(self.port.sent)
        except (HardwareError, OSError) as error:
            self.stop("fault", f"the effort cannot be sent: {error}", error)

    def finish(self) -> LoopReport:
        """Close the log, and say what was."""
        state = self.intake.state
        report = LoopReport(
            ended=self.ended,
            reason=self.reason,
            phase=self.phase,
            silent=self.silent,
            speed=float(np.abs(state.v).max()),
            t=state.t,
            deadlines=self.intake.deadlines,
            error=self.error,
            log=self.book.path,
        )
        self.book.end(report)
        return report
