"""A live loop: check, bind and allocate; then read, send, and stop safely."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import FallError, LiveError
from hsp_control.common.keywords import suggesting
from hsp_control.common.numbers import check_positive
from hsp_control.control.compensation import CompensatedController, Compensation
from hsp_control.control.controller import Controller
from hsp_control.control.estimation import Estimator
from hsp_control.control.falling import FallDetector
from hsp_control.control.first_state import warn_of_slow_efforts
from hsp_control.control.plans import MotionPlan
from hsp_control.geometry.scene import Scene
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.hardware import Hardware, described
from hsp_control.live.live_log import LoopLog
from hsp_control.live.operator_requests import (
    OPERATOR,
    OperatorRequests,
    stop_signals,
)
from hsp_control.live.real_time import no_garbage_collection, real_time_priority
from hsp_control.live.report import Ended, LoopReport
from hsp_control.live.safe_stop import Phase, SafeStop, StandingFeet
from hsp_control.live.settings import LiveSettings, check_held
from hsp_control.live.simulated_robot import InProcessRobot
from hsp_control.live.state_reader import StateReader
from hsp_control.robot import RobotState
from hsp_control.simulation.control_chain import ControlChain, EffortSource
from hsp_control.simulation.declared_run import declared_run
from hsp_control.simulation.plants import is_exact

_WARM_UP = 20
"""Steps before real-time operation: they bind calls and touch all memory."""


@suggesting
def run_loop(
    controller: Controller | EffortSource,
    hardware: Hardware,
    *,
    duration: float | None = None,
    plan: MotionPlan | None = None,
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
    frozen, too old, outside the limits, or farther from the last one than the robot can
    move; a velocity that contradicts the positions, an effort that was not sent, an
    inconsistent clock; a robot that stopped by itself or cannot be reached; a fall; any
    exception of the hardware, the controller, the plan, a change or ``on_period``, also
    one that is not an `Exception`, such as `asyncio.CancelledError`. Once real-time
    operation has begun, nothing is raised; the report contains the fault.

    Ctrl-C and SIGTERM are the operator's stop (`stop_signals`).

    Args:
        controller: The controller, or an `EffortSource` around one. A controller
        without compliant tasks receives a momentum observer, unless the robot is
        simulated with the controller's model (`Compensation.momentum_observer`).
        hardware: The robot.
        duration: Time from the first state to the stop [s]; None: until the operator
            stops.
        plan: Writes references and switches contacts; the controller is built from its
        `MotionPlan.parts`.
        estimators: Complete each measurement, for the plan and the controller.
        settings: The efforts accepted by the robot, the tolerated faults, and the safe
        stop; None: the defaults.
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
        The end of the run, and its response times.

    Raises:
        LiveError: If the robot has a floating base without support, or a setting is
        invalid.
        HardwareError: If no first state arrives, or the robot cannot be started.
        LogError: If the journal cannot be created.
        HspControlError: If the controller, the plan or an estimator raises at the first
            state, for example because a quantity is not measured.
    """
    source = (
        CompensatedController(controller, _compensation(controller, hardware))
        if isinstance(controller, Controller)
        else controller
    )
    settings = settings or LiveSettings()
    chain = ControlChain(source, plan, estimators)
    controller = source.controller
    robot, period = controller.robot, hardware.period
    requests = requests or OperatorRequests()
    loop_log: LoopLog | None = None
    with stop_signals(requests):
        try:
            _check(period, duration, log_period)
            check_held(robot, controller.contacts, settings)
            limits = controller.limits
            limiter = EffortLimiter(robot, settings, period, limits)
            feet = StandingFeet(robot, controller.contacts)
            safe_stop = SafeStop(
                robot, settings.stop, limiter.effort_limits, period, feet
            )
            reader = StateReader(
                robot,
                limits,
                hardware,
                settings,
                clock,
                start_time,
                controller.state.dynamics,  # with the declared payload
            )
            first = reader.wait_for_first()
            # Bind and allocate everything now, not in real-time operation.
            chain.begin(first.inertial)
            for _ in range(_WARM_UP):
                chain.effort(first._replace(t=start_time, applied=None), period)
                safe_stop.effort(reader.state)
                safe_stop.observe(reader.state, limiter.applied, reader.silent)
                limiter.reset(first.q)
            end = np.inf if duration is None else start_time + duration - 0.5 * period
            warn_of_slow_efforts(robot, first.q, limits)
            shown = scene or controller.scene
            meta = dict(meta or {})
            if log is not None and "config" not in meta:
                meta |= declared_run(
                    controller,
                    first.q,
                    first.v,
                    plan=plan,
                    estimators=estimators,
                    simulation={
                        "duration": duration,
                        "start_time": start_time,
                        "log_period": log_period,
                        "control_period": period,
                    },
                )
            loop_log = LoopLog(log, log_period, chain, shown, meta)
            loop_log.warm_up(reader, limiter)
            chain.begin(first.inertial, robot.state(start_time, first.q, first.v))
            controller.compute(start_time, first.q, first.v)  # begins
            loop_log.begin()
            safe_stop.restart()
            loop = LiveRun(
                chain,
                hardware,
                reader,
                limiter,
                safe_stop,
                loop_log,
                requests,
                settings,
                end,
                _fall_detector(controller, reader.state),
            )
            with real_time_priority(priority), no_garbage_collection():
                loop.run(on_period)
        except BaseException:
            with suppress(BaseException):  # the first error is reported
                hardware.close()
            if loop_log is not None:
                loop_log.abandon()
            raise
        return loop.finish()


def _compensation(controller: Controller, hardware: Hardware) -> Compensation:
    """Return the default compensators of a controller."""
    if isinstance(hardware, InProcessRobot):
        exact = is_exact(hardware.robot.plant, controller.robot)
        return Compensation().suited(controller, hardware.period, exact)
    return Compensation()


def _check(period: float, duration: float | None, log_period: float) -> None:
    check_positive("the hardware's period", period, "s", LiveError)
    if duration is not None and duration != np.inf:
        check_positive("duration", duration, "s", LiveError)
    check_positive("log_period", log_period, "s", LiveError)
    if not log_period >= period * (1.0 - 1e-9):
        raise LiveError(
            f"log_period is {log_period:g} s; must be a period, {period:g} s, or longer"
        )


def _called(request: BaseException) -> str:
    return "Ctrl-C" if isinstance(request, KeyboardInterrupt) else "exit"


_ROOT = 1
"""Index of the joint that a floating base is."""


def _fall_detector(controller: Controller, state: RobotState) -> FallDetector | None:
    """Return a fall detector; None if the robot's base is fixed."""
    robot = controller.robot
    if not robot.unactuated:
        return None
    base = next(
        str(frame.name)
        for frame in robot.model.frames
        if frame.parentJoint == _ROOT and frame.type == pin.FrameType.BODY
    )
    feet = tuple(contact.frame for contact in controller.contacts)
    return FallDetector(base, feet, state)


@dataclass(eq=False)
class LiveRun:
    """One run of a loop whose parts are ready: `run`, then `finish`; none raises."""

    chain: ControlChain[EffortSource]
    hardware: Hardware
    reader: StateReader
    limiter: EffortLimiter
    safe_stop: SafeStop
    log: LoopLog
    requests: OperatorRequests
    settings: LiveSettings
    end: float  # end of the duration [s]
    detector: FallDetector | None  # until a fall; None: the robot cannot fall
    phase: Phase = Phase.RUNNING  # running, damping or holding
    ended: Ended = "completed"
    reason: str = ""
    error: BaseException | None = None
    # how and why it ends, once the plan has brought the robot to rest
    ending: tuple[Ended, str] | None = None
    asked_at: float = 0.0  # time of that request [s]
    silent: bool = False  # whether it stopped sending efforts
    done: bool = False
    abandoned: bool = False
    later: str = ""  # the first fault in the safe stop, "" without one
    consistent: bool = True  # whether all measurements were valid

    def run(self, on_period: Callable[[float], object] | None) -> None:
        """Run period after period until the safe stop is complete."""
        self.reader.start()
        self.limiter.reset(self.reader.state.q)
        while not self.done:
            try:
                self.one_period(on_period)
            except OPERATOR as request:
                if self.phase != Phase.RUNNING:  # the second: the robot must stop
                    self.silent = self.done = True
                    self.abandon(request)
                    continue
                reason = f"stopped by the operator ({_called(request)})"
                # One of the law or a task, such as sys.exit(), would be raised again in
                # the stop, and would then be taken for the operator's second request.
                self.log.controller_failed |= self.chain.plan is None
                self.log.interrupted = True
                if self.ending is None:
                    self.end_regularly("operator", reason)
                else:
                    self.log.controller_failed = True
                    self.stop("operator", reason)
            except BaseException as error:  # of a signal's handler, or of this loop
                if self.phase != Phase.RUNNING:  # again: the robot must stop
                    self.silent = self.done = True
                self.fail(error)

    def abandon(self, request: BaseException) -> None:
        """Leave the safe stop to the robot, after the operator's second request."""
        self.abandoned = True
        if (
            self.ended == "completed"
        ):  # not completed: whether the robot is at rest is unknown
            self.ended = "operator"
            self.reason += (
                f"; the safe stop was cut short by the operator ({_called(request)})"
            )

    def one_period(self, on_period: Callable[[float], object] | None) -> None:
        """Read a state, send an effort, then log and make the requested changes."""
        reader, limiter = self.reader, self.limiter
        reader.read(limiter.applied, self.chain.compensated.controller.limits)
        if reader.fault is not None:
            self.consistent = False
            self.stop("fault", reader.fault, reader.error)
        elif self.requests.reason is not None:
            self.end_regularly("operator", self.requests.reason)
        elif reader.state.t >= self.end:
            self.end_regularly("completed", "the duration is over")
        elif self.ending is not None:
            self.end_regularly(*self.ending)
        self.feel_ground()
        self.check_applied_effort()
        tau = self.controller_effort() if self.phase == Phase.RUNNING else None
        stops = self.phase != Phase.RUNNING
        if stops:
            tau = self.stop_effort()
        elif reader.blind:
            tau = self.safe_stop.effort(reader.state)
        elif reader.measurement is not None:
            self.safe_stop.begin()  # anew when states are missing again
        limiter.follow(self.chain.compensated.controller.limits)
        before = limiter.sent.copy()
        # A stop must brake all joints at once; the law's effort is sent unchanged.
        inertia = reader.state.mass_matrix if stops or reader.blind else None
        if tau is not None and not limiter.apply(tau, reader.state.q, inertia):
            self.stop("fault", f"the effort is not finite: {tau.tolist()}")
        self.send(before)
        if self.consistent and reader.measurement is not None:
            self.safe_stop.observe(reader.state, limiter.applied, reader.silent)
        if stops:
            self.safe_stop.trust(measurements=self.consistent, dead=reader.dead)
        reader.load = self.safe_stop.load
        response = reader.effort_sent(limiter.applied)
        self.report_applied_effort()
        self.log_row(response)
        if self.phase == Phase.RUNNING:
            self.rest_of_period(on_period)

    def feel_ground(self) -> None:
        """Detect the stance feet, and stop if the robot falls."""
        measurement, state = self.reader.measurement, self.reader.state
        if self.detector is None or measurement is None:
            return
        self.safe_stop.feet.update(measurement._replace(t=state.t))
        try:
            self.detector.check(state)
        except FallError as error:
            self.fall(str(error))

    def fall(self, reason: str, error: BaseException | None = None) -> None:
        """Stop a falling robot: its feet no longer support it."""
        self.detector = None
        self.safe_stop.feet.lift()
        self.stop("fault", reason, error)

    def controller_effort(self) -> Array | None:
        """Return the controller's effort, or a lasting one; None: hold the last."""
        measurement, t = self.reader.measurement, self.reader.state.t
        if measurement is None:
            return self.limiter.lasting
        try:
            # The effort of the motors is used, with the gravity that the robot adds.
            has = None if measurement.applied is None else self.limiter.applied.copy()
            measured = measurement._replace(t=t, applied=has)
            effort = self.chain.effort(measured, self.hardware.period)
            tau = np.asarray(effort, dtype=float)
            if tau.shape != measurement.v.shape:
                raise ValueError(
                    f"the effort has shape {tau.shape}; needs {measurement.v.shape}"
                )
        except FallError as error:
            self.log.controller_failed = True
            self.fall(str(error), error)
            return None
        except OPERATOR:
            raise
        except BaseException as error:  # a user's task or field may raise anything
            self.log.controller_failed = True
            self.fail(error)
            return None
        return tau

    def stop_effort(self) -> Array:
        """Return the safe stop's effort at the measured or predicted state."""
        tau = self.safe_stop.effort(self.reader.state)
        self.phase = self.safe_stop.phase
        too_long = self.reader.predicted_for > self.settings.prediction_time
        unknown = self.reader.connection_lost or too_long
        unknown |= self.reader.ambiguous and self.safe_stop.done
        self.silent = unknown or not np.isfinite(tau).all()
        self.done = self.silent or self.safe_stop.done
        return tau

    def end_regularly(self, ended: Ended, reason: str) -> None:
        """Stop once the plan, if there is one, has brought the robot to rest."""
        plan, state = self.chain.plan, self.reader.state
        if plan is None or self.phase != Phase.RUNNING:
            self.stop(ended, reason)
            return
        if self.ending is None:
            self.ending, self.asked_at = (ended, reason), state.t
            plan.stop()
        still = float(np.abs(state.v).max()) <= self.settings.stop.standstill
        waited = state.t - self.asked_at >= self.settings.stop.coming_to_rest
        if waited or (plan.rests and still):
            self.stop(*self.ending)

    def stop(
        self, ended: Ended, reason: str, error: BaseException | None = None
    ) -> None:
        """Start the safe stop; later calls change neither it nor the reason."""
        if self.phase != Phase.RUNNING:
            if ended == "fault":
                self.later = self.later or reason
            return
        self.phase = Phase.DAMPING
        self.ended, self.reason, self.error = ended, reason, error
        self.safe_stop.begin()
        dead = self.reader.dead
        self.safe_stop.trust(measurements=self.consistent, dead=dead)
        self.reader.stop()

    def fail(self, error: BaseException) -> None:
        """Stop after an error of a user's code or of the law."""
        name = type(error).__name__
        text = described(error)
        message = text if text.startswith(name) else f"{name}: {text}"
        self.stop("fault", message, error)

    def check_applied_effort(self) -> None:
        """Report to the controller the robot's effort: a sent one may be lost."""
        if (measurement := self.reader.measurement) is None:
            self.limiter.no_measurement()
            return
        has = measurement.applied
        if has is not None:
            wrong = self.limiter.contradiction(has, halted=measurement.halted)
            if wrong is not None:
                self.consistent = False
                self.stop("fault", wrong)
                has = None
        if self.limiter.robot_has(has):
            self.report_applied_effort()

    def report_applied_effort(self) -> None:
        """Report to the controller the effort of the motors."""
        if self.log.controller_failed:
            return
        try:
            self.chain.compensated.applied(self.limiter.applied, self.hardware.period)
        except OPERATOR:
            raise
        except BaseException as error:
            self.fail(error)

    def send(self, before: Array) -> None:
        """Send the limited effort, unless the state is unknown (fail-silent)."""
        if self.silent:
            return
        try:
            self.hardware.write(self.limiter.sent.copy())
        except OPERATOR:
            raise
        except BaseException as error:  # a driver may raise anything
            self.limiter.replace_sent(before)
            reason = f"the effort cannot be sent: {described(error)}"
            self.stop("fault", reason, error)

    def log_row(self, response: float) -> None:
        """Write a row if one is due; after an interrupt by Ctrl-C, once more."""

        def write() -> None:
            self.log.row(
                self.phase, self.reader, self.limiter, response, last=self.done
            )

        try:
            try:
                write()
            except KeyboardInterrupt:
                write()
                raise
        except OPERATOR:
            raise
        except BaseException as error:  # the disk is full, or a user's task raises
            self.fail(error)

    def rest_of_period(self, on_period: Callable[[float], object] | None) -> None:
        """Make the operator's changes, and call the user's function."""
        try:
            self.requests.run_pending()
            if on_period is not None:
                on_period(self.reader.state.t)
        except OPERATOR:
            raise
        except BaseException as error:
            self.fail(error)

    def finish(self) -> LoopReport:
        """Close the hardware, end the log, and return the report."""
        self._close("the robot cannot be closed", self.hardware.close)
        self._close("the log cannot be ended", lambda: self.log.end(self.report()))
        return self.report()

    def report(self) -> LoopReport:
        """Return the report of the run."""
        state = self.reader.state
        speed = self.reader.speed
        standing = speed <= self.settings.stop.standstill
        at_rest = standing and self.safe_stop.done and not self.silent
        ended, reason = self.ended, self.reason
        if ended != "fault" and not self.abandoned and (self.later or not at_rest):
            ended = "fault"
            reason += f"; then {self.later or f'the robot still moved at {speed:.3g}'}"
        return LoopReport(
            ended=ended,
            reason=reason,
            phase=self.phase,
            silent=self.silent,
            speed=speed,
            at_rest=at_rest,
            t=state.t,
            deadlines=self.reader.deadlines,
            error=self.error,
            log=self.log.path,
        )

    def _close(self, what: str, close: Callable[[], object]) -> None:
        """Close something; after an interrupt by Ctrl-C, once more."""
        for last in (False, True):
            try:
                close()
            except KeyboardInterrupt as interrupt:
                if last:
                    self._add(f"{what}: {described(interrupt)}")
                continue
            except BaseException as error:
                self._add(f"{what}: {described(error)}")
                self.error = self.error or error
            return

    def _add(self, fault: str) -> None:
        """Report a fault after the end."""
        self.ended, self.reason = "fault", f"{self.reason}; {fault}"
