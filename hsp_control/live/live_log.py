"""The log of a live loop: rows are written to a journal while the loop runs."""

from collections.abc import Mapping
from math import floor, inf, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.control.plan import RunningPlan
from hsp_control.geometry.scene import Scene
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.report import LoopReport
from hsp_control.live.safe_stop import Phase
from hsp_control.live.state_reader import StateReader
from hsp_control.robot import RobotState
from hsp_control.simulation.control_chain import ControlChain, EffortSource
from hsp_control.simulation.journal import JournalWriter
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.recorder import Recorder

CHANNEL_INFO = {
    "phase": ("-", "0 waiting; 1 running; 2 safe stop, damping; 3 safe stop, hold"),
    "sent": ("N·m or N", "sent to the robot: tau, or tau - g(q)"),
    "applied": ("N·m or N", "what the robot had of it before, if it says so"),
    "measured": ("-", "1 if the state was measured, 0 if the model predicted it"),
    "age": ("s", "state age"),
    "response": ("s", "response time: from the state's arrival to its effort"),
}


class Row(NamedTuple):
    """One row of the log; see `Recorder.record`."""

    state: RobotState  # the state
    output: ControlOutput | None  # the controller's output for it, or None
    tau: Array  # the effort of the motors, shape (nv,)
    log_channels: Mapping[str, LogChannel]  # further values to log, by name


class LiveLog:
    """Writes rows to a journal; each is passed to the operating system at once."""

    def __init__(
        self,
        path: Path,
        controller: Controller,
        scene: Scene | None = None,
        meta: Mapping[str, Any] | None = None,
    ) -> None:
        self.path = path  # the journal
        self._recorder = Recorder(controller, scene or Scene(), 1)
        self._meta = dict(meta or {})
        self._last_t = -inf
        self._journal = JournalWriter(path)

    def warm_up(self, row: Row) -> None:
        """Record a row without writing it: compiles kernels and writes the heading."""
        try:
            self._recorder.record(*row)
        finally:
            self._recorder.clear()
        self._head()

    def follow(self, plan: RunningPlan | None) -> None:
        """Set the plan of the run that begins; its streams are recorded."""
        self._recorder.plan = plan

    def add(self, row: Row) -> None:
        """Write a row if it is later than the last one."""
        if not row.state.t > self._last_t:
            return
        try:
            self._recorder.record(*row)
            columns = self._recorder.rows(0)
            if not self._journal.describes(columns):
                self._head()
            self._journal.write_row(columns)
            self._last_t = row.state.t
        finally:
            self._recorder.clear()

    def end(self, status: str, message: str, **meta: Any) -> None:
        """Write how the run ended, and close the file."""
        try:
            came = self._recorder.repeatable()
            self._journal.write_end(status, message, **came, **meta)
        except Exception:  # after Ctrl-C it may be called again
            self._journal.close()
            raise
        self._journal.close()

    def _head(self) -> None:
        meta = self._recorder.meta("running", "", **self._meta)
        self._journal.write_heading(self._recorder.rows(0), meta)


class LoopLog:
    """Selects what a loop logs: rows on a time grid, and each change of the phase."""

    def __init__(
        self,
        path: str | Path | None,
        period: float,
        chain: ControlChain[EffortSource],
        scene: Scene | None,
        meta: Mapping[str, Any],
    ) -> None:
        self._chain, self._period = chain, period
        self._log: LiveLog | None = None
        self._next, self._phase = -inf, Phase.WAITING
        self._failed = False
        self._excess = LimitExcess(chain.command.controller.robot)
        self.path = None if path is None else Path(path)
        # whether the controller has raised; it is not called again
        self.controller_failed = False
        if self.path is not None:
            self._log = LiveLog(self.path, chain.command.controller, scene, meta)

    def row(
        self,
        phase: Phase,
        reader: StateReader,
        limiter: EffortLimiter,
        response: float,
        *,
        last: bool,
    ) -> None:
        """Write a row if one is due."""
        measurement, state = reader.measurement, reader.state
        if self._log is None or self._failed:
            return
        if measurement is not None:
            limits = self._chain.command.controller.limits
            self._excess.see(limits, measurement.q, measurement.v)
        if measurement is None and phase == Phase.RUNNING:
            return  # no measurement, so no effort was computed
        if state.t < self._next and phase == self._phase and not last:
            return
        try:
            self._log.add(self._row(phase, reader, limiter, response))
        except Exception:  # after Ctrl-C the row is written again
            self._failed = True
            raise
        periods = floor(state.t / self._period + 1e-6) + 1
        self._next, self._phase = (periods - 1e-6) * self._period, phase

    def warm_up(self, reader: StateReader, limiter: EffortLimiter) -> None:
        """Record a row without writing it, so that later rows compile nothing."""
        if self._log is not None:
            self._log.warm_up(self._row(Phase.RUNNING, reader, limiter, 0.0))

    def begin(self) -> None:
        """Begin to log a run; the chain has begun, too."""
        if self._log is not None:
            self._log.follow(self._chain.plan)

    def _row(
        self, phase: Phase, reader: StateReader, limiter: EffortLimiter, response: float
    ) -> Row:
        measurement, state = reader.measurement, reader.state
        applied = None if measurement is None else measurement.applied
        unknown = np.full(limiter.sent.shape, nan)
        log_channels = live_channels(
            phase=float(phase),
            sent=limiter.sent,
            applied=unknown if applied is None else applied,
            measured=float(measurement is not None),
            age=nan if measurement is None else measurement.age,
            response=response,
        )
        if phase == Phase.RUNNING and not self.controller_failed:
            log_channels = {
                **self._chain.log_channels(state.q, state.v),
                **log_channels,
            }
        limits = self._chain.command.controller.limits
        log_channels |= self._excess.take(limits)
        return Row(state, self._output(phase, state), limiter.applied, log_channels)

    def end(self, report: LoopReport) -> None:
        """Write how the loop ended, and close the journal, if there is one."""
        if self._log is None:
            return
        deadlines = report.deadlines
        summary = {
            "ended": report.ended,
            "phase": report.phase.name.lower(),
            "silent": report.silent,
            "period": deadlines.period,
            "periods": deadlines.periods,
            "missed": deadlines.missed,
            "silent_periods": deadlines.without_state,
            "unseen": deadlines.skipped_states,
            "response": deadlines.response,
            "gap": deadlines.interval,
        }
        self._log.end(report.status, report.reason, live=summary)

    def _output(self, phase: Phase, state: RobotState) -> ControlOutput | None:
        """Return the controller's output, also during the safe stop, if possible."""
        if self.controller_failed:
            return None
        if phase == Phase.RUNNING:
            return self._chain.command.output
        try:
            return self._chain.command.controller.compute(state)
        except Exception:  # its effort is not used any more: log without it
            self.controller_failed = True
            return None


def live_channels(**values: Array | float) -> dict[str, LogChannel]:
    """Return log channels; the names are the keys of `CHANNEL_INFO`."""
    return {
        f"live.{name}": LogChannel(value, *CHANNEL_INFO[name])
        for name, value in values.items()
    }
