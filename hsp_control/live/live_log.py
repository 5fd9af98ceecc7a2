"""The log of a live loop: which rows are due, and their contents."""

from collections.abc import Mapping
from math import floor, inf, nan
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.measurement import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.geometry.scene import Scene
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.report import LoopReport
from hsp_control.live.safe_stop import Phase
from hsp_control.live.state_reader import StateReader
from hsp_control.robot import RobotState
from hsp_control.simulation.control_chain import ControlChain, EffortSource
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.log_writer import LogWriter

_CHANNELS = {
    "phase": ("-", "0 waiting; 1 running; 2 safe stop, damping; 3 safe stop, hold"),
    "sent": ("N·m or N", "sent to the robot: tau, or tau - g(q)"),
    "applied": ("N·m or N", "the last applied effort, if the robot reports it"),
    "measured": ("-", "1 if the state was measured, 0 if the model predicted it"),
    "age": ("s", "state age"),
    "response": ("s", "response time: from the state's arrival to its effort"),
}


def live_channels(**values: Array | float) -> dict[str, LogChannel]:
    """Return the columns that a live loop logs, by their names."""
    return {
        f"live.{name}": LogChannel(value, *_CHANNELS[name])
        for name, value in values.items()
    }


class DueRows:
    """The times of a log's rows: on a grid, and at changes of the phase."""

    def __init__(self, period: float) -> None:
        self._period, self._next, self._last = period, -inf, -inf
        self._phase = -1

    def is_due(self, t: float, phase: int, *, last: bool = False) -> bool:
        """Return whether a row is due at a time [s]; if ``last``, any later one is."""
        on_grid = t >= self._next or phase != self._phase
        return (on_grid or last) and t > self._last

    def written(self, t: float, phase: int) -> None:
        """Record that a row was written."""
        periods = floor(t / self._period + 1e-6) + 1
        self._next, self._last = (periods - 1e-6) * self._period, t
        self._phase = phase


class LoopLog:
    """The log of a loop: selects its rows, and writes them at once."""

    def __init__(
        self,
        path: str | Path | None,
        period: float,
        chain: ControlChain[EffortSource],
        scene: Scene,
        meta: Mapping[str, Any],
    ) -> None:
        self._chain, self._due = chain, DueRows(period)
        self._failed = False
        controller = chain.compensated.controller
        self._excess = LimitExcess(controller.robot)
        self.path = None if path is None else Path(path)
        # whether the controller has raised; it is not called again
        self.controller_failed = False
        self.interrupted = False  # whether it was an operator's exception
        self._log: LogWriter | None = None
        if self.path is not None:
            self._log = LogWriter(controller, scene, 0, path=self.path, meta=meta)

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
            limits = self._chain.compensated.controller.limits
            self._excess.record(limits, measurement.q, measurement.v)
        if measurement is None and phase == Phase.RUNNING:
            return  # no measurement, so no effort was computed
        if not self._due.is_due(state.t, phase, last=last):
            return
        try:
            row = self._row(phase, reader, limiter, response)
            self._log.record(*row, parts=not self.interrupted)
        except KeyboardInterrupt:  # the row is written again
            raise
        except BaseException:
            self._failed = True
            raise
        self._due.written(state.t, phase)

    def warm_up(self, reader: StateReader, limiter: EffortLimiter) -> None:
        """Make a row without writing it, so that later rows compile nothing."""
        if self._log is not None:
            self._log.warm_up(*self._row(Phase.RUNNING, reader, limiter, 0.0))

    def begin(self) -> None:
        """Begin to log a run; the chain has begun, too."""
        if self._log is not None:
            self._log.plan = self._chain.plan

    def end(self, report: LoopReport) -> None:
        """Write the end of the loop, and close the journal, if there is one."""
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

    def abandon(self) -> None:
        """Close the journal of a run that did not begin; another run may write it."""
        if self._log is not None:
            self._log.close()

    def _row(
        self, phase: Phase, reader: StateReader, limiter: EffortLimiter, response: float
    ) -> tuple[RobotState, ControlOutput | None, Array, Mapping[str, LogChannel]]:
        """Return the arguments of `LogWriter.record`."""
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
            own = self._chain.log_channels(state.q, state.v)
            log_channels = {**own, **log_channels}
        limits = self._chain.compensated.controller.limits
        log_channels |= self._excess.collect(limits)
        return state, self._output(phase, state), limiter.applied, log_channels

    def _output(self, phase: Phase, state: RobotState) -> ControlOutput | None:
        """Return the controller's output, also during the safe stop, if possible."""
        if self.controller_failed:
            return None
        if phase == Phase.RUNNING:
            return self._chain.compensated.output
        try:
            return self._chain.compensated.controller.compute(state)
        except KeyboardInterrupt:
            raise
        except BaseException:  # its effort is no longer used: log without it
            self.controller_failed = True
            return None
