"""The log of a live loop: the columns of every log, in a journal as they come."""

from collections.abc import Mapping
from math import floor, inf, nan
from pathlib import Path
from typing import Any, NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller, ControlOutput
from hsp_control.control.log_channel import LogChannel
from hsp_control.geometry.scene import Scene
from hsp_control.live.commander import Commander
from hsp_control.live.effort_port import EffortPort
from hsp_control.live.intake import Intake
from hsp_control.live.report import LoopReport
from hsp_control.live.safe_stop import Phase
from hsp_control.robot import RobotState
from hsp_control.simulation.journal import JournalWriter
from hsp_control.simulation.recorder import Recorder

ABOUT = {
    "phase": ("-", "0 waiting; 1 running; 2 safe stop, damping; 3 safe stop, hold"),
    "sent": ("N·m or N", "what the robot was sent: tau, or tau - g(q)"),
    "measured": ("-", "1 if the state was measured, 0 if the model reckoned it"),
    "age": ("s", "of the state"),
    "response": ("s", "from the state's arrival to its effort"),
}


class Row(NamedTuple):
    """One row; see `Recorder.record`.

    Attributes:
        state: The state.
        output: What the controller makes of it, if anything.
        tau: The effort of the motors, shape (nv,).
        readings: What else there is.
    """

    state: RobotState
    output: ControlOutput | None
    tau: Array
    log_channels: Mapping[str, LogChannel]


class LiveLog:
    """Records rows, and has each in the operating system's hands at once.

    Attributes:
        path: The journal.
    """

    def __init__(
        self,
        path: Path,
        controller: Controller,
        scene: Scene | None = None,
        meta: Mapping[str, Any] | None = None,
    ) -> None:
        """Begin the journal.

        Raises:
            LogError: If it cannot be written.
        """
        self.path = path
        self._recorder = Recorder(controller, scene or Scene(), 1)
        self._meta = dict(meta or {})
        self._last_t = -inf
        self._journal = JournalWriter(path)

    def rehearse(self, row: Row) -> None:
        """Make a row, and write none: what it needs is compiled, its columns known."""
        try:
            self._recorder.record(*row)
        finally:
            self._recorder.forget()
        self._head()

    def add(self, row: Row) -> None:
        """Write a row, if it is later than the last.

        Raises:
            LogError: If it cannot be written.
        """
        if not row.state.t > self._last_t:
            return
        self._last_t = row.state.t
        try:
            self._recorder.record(*row)
            columns = self._recorder.rows(0)
            if not self._journal.has(columns):
                self._head()
            self._journal.append(columns)
        finally:
            self._recorder.forget()

    def end(self, status: str, message: str, **meta: Any) -> None:
        """Say how it ended, and close the file.

        Raises:
            LogError: If it cannot be written.
        """
        try:
            self._journal.end(status, message, **meta)
        finally:
            self._journal.close()

    def _head(self) -> None:
        meta = self._recorder.meta("running", "", **self._meta)
        self._journal.head(self._recorder.rows(0), meta)


class LoopLog:
    """What a loop logs, and when: on a grid of times, and where its phase changes.

    Attributes:
        path: The journal; None if there is none.
        law_is_well: Whether the law may still be asked what it would do.
    """

    def __init__(
        self,
        path: str | Path | None,
        period: float,
        commander: Commander,
        scene: Scene | None,
        meta: Mapping[str, Any],
    ) -> None:
        """Begin the journal, if one is wanted.

        Raises:
            LogError: If it cannot be written.
        """
        self._commander, self._period = commander, period
        self._log: LiveLog | None = None
        self._next, self._phase = -inf, Phase.WAITING
        self.path = None if path is None else Path(path)
        self.law_is_well = True
        if self.path is not None:
            self._log = LiveLog(self.path, commander.controller, scene, meta)

    def row(
        self,
        phase: Phase,
        intake: Intake,
        port: EffortPort,
        response: float,
        *,
        last: bool,
    ) -> None:
        """Write a row, if it is time for one.

        Raises:
            LogError: If it cannot be written; no more are then.
        """
        found, state = intake.found, intake.state
        if self._log is None or (found is None and phase == Phase.RUNNING):
            return  # nothing was seen, and nothing was computed
        if state.t < self._next and phase == self._phase and not last:
            return
        periods = floor(state.t / self._period + 1e-6) + 1
        self._next, self._phase = (periods - 1e-6) * self._period, phase
        log, self._log = self._log, None  # if it cannot be written, there is none
        log.add(self._row(phase, intake, port, response))
        self._log = log

    def rehearse(self, intake: Intake, port: EffortPort) -> None:
        """Do all once that a row takes."""
        if self._log is not None:
            self._log.rehearse(self._row(Phase.RUNNING, intake, port, 0.0))

    def _row(
        self, phase: Phase, intake: Intake, port: EffortPort, response: float
    ) -> Row:
        found, state = intake.found, intake.state
        log_channels = live_channels(
            phase=float(phase),
            sent=port.sent,
            measured=float(found is not None),
            age=nan if found is None else found.age,
            response=response,
        )
        return Row(state, self._law(phase, state), port.acting, log_channels)

    def end(self, report: LoopReport) -> None:
        """Close the journal, if there is one that can be written.

        Raises:
            LogError: If it cannot.
        """
        if self._log is None:
            return
        deadlines = report.deadlines
        about = {
            "ended": report.ended,
            "phase": report.phase.name.lower(),
            "silent": report.silent,
            "period": deadlines.period,
            "periods": deadlines.periods,
            "missed": deadlines.missed,
            "silent_periods": deadlines.silent,
            "unseen": deadlines.unseen,
            "response": deadlines.response,
            "gap": deadlines.gap,
        }
        self._log.end(report.status, report.reason, live=about)

    def _law(self, phase: Phase, state: RobotState) -> ControlOutput | None:
        """Return what the law says of this state, also where it is not followed."""
        if not self.law_is_well:
            return None
        if phase == Phase.RUNNING:
            return self._commander.output
        try:
            return self._commander.controller.compute(state)
        except Exception:  # it is not followed any more: the log goes on without
            self.law_is_well = False
            return None


def live_channels(**values: Array | float) -> dict[str, LogChannel]:
    """Return readings by their names in `ABOUT`."""
    return {
        f"live.{name}": LogChannel(value, *ABOUT[name])
        for name, value in values.items()
    }
