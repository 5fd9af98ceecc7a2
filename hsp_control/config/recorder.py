"""Records a user's own loop, in the log that all commands accept."""

from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.errors import LogError
from hsp_control.common.keywords import suggesting
from hsp_control.common.numbers import check_positive
from hsp_control.control.controller import Controller
from hsp_control.control.output import ControlOutput
from hsp_control.declaration.language import check_kind
from hsp_control.live.hardware import described
from hsp_control.simulation import Rollout
from hsp_control.simulation.declared_run import declared_controller
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.simulate import SimulationSettings


class Recorder:
    """Records a user's own loop: `hsp plot`, `view`, `export` and `run` accept its log.

    Rows are written to the disk at once, so that a killed program loses none:

        with hsp.Recorder(controller, "out/mine.npz") as recorder:
            while running:
                output = controller.compute(t, q, v)
                recorder.record(output)
        hsp.plots.diagnostics_figure(recorder.rollout)

    `hsp run` repeats it in simulation, if the parts are data and not Python functions,
    and t begins at 0.

    Attributes:
        path: The log's file; None: after closing, the log is only in memory.
    """

    @suggesting
    def __init__(
        self,
        controller: Controller,
        path: str | Path | None = None,
        *,
        log_period: float = 0.01,
    ) -> None:
        """Begin a log; an existing file is replaced when the recorder is closed.

        Args:
            controller: The controller whose outputs are recorded.
            path: The file, ``.npz``; None: none.
            log_period: Time between two rows [s]; outputs in between are left out.

        Raises:
            LogError: If the period is not positive, or the file cannot be written.
        """
        check_kind("controller is", controller, Controller, LogError)
        check_positive("log_period", log_period, "s", LogError)
        if path is not None and not isinstance(path, str | Path):
            raise LogError(f"path is {path!r}; needs a file, such as 'out/mine.npz'")
        self.path = None if path is None else Path(path)
        self._folder = TemporaryDirectory() if path is None else None
        where = Path(self._folder.name) / "log" if self._folder else Path(str(path))
        self._journal = where.with_suffix(".journal")
        self._controller, self._period = controller, log_period
        self._config, self._lost = declared_controller(
            controller, simulation=SimulationSettings()
        )
        self._begun = self._last = self._due = -inf
        self._held = 0.0  # time between the first two outputs [s]
        meta = {"name": where.stem, "config": self._config, "config_lost": self._lost}
        scene = controller.scene
        self._writer = LogWriter(controller, scene, 0, path=self._journal, meta=meta)
        self._rollout: Rollout | None = None

    @property
    def journal(self) -> Path:
        """The journal with all rows, until the recorder is closed."""
        return self._journal

    def record(self, output: ControlOutput, tau: ArrayLike | None = None) -> None:
        """Write a row for the controller's last output, if one is due.

        Args:
            output: The result of the last `Controller.compute`.
            tau: The effort that was sent, shape (nv,) [N·m or N]; None: the output's.

        Raises:
            LogError: If the recorder is closed, or the file cannot be written.
            ShapeError: If the effort has another shape.
        """
        if self._rollout is not None:
            raise LogError("the recorder is closed")
        state = self._controller.state
        if self._begun == -inf:
            self._begun = state.t
            if self._config is not None:
                placed = self._controller.setup.start.state
                start = {
                    "configuration": state.q.tolist(),
                    "velocity": state.v.tolist(),
                    "relative_to": placed.q.tolist(),
                }
                self._config["start"] = start
                self._config["simulation"]["start_time"] = state.t
        elif self._last == self._begun:
            self._held = state.t - self._begun
        self._controller._memory.clock.recorded(state.t)
        self._last = state.t
        if state.t < self._due:
            return
        rows = np.floor((state.t - self._begun) / self._period + 1e-6) + 1.0
        self._due = self._begun + (rows - 1e-6) * self._period
        sent = output.tau if tau is None else tau
        applied = self._controller.robot.check_tangent(sent, "effort tau")
        self._writer.record(state, output, applied, {})

    def close(self, status: str = "completed", message: str = "") -> Rollout:
        """End the log, and return it; a second call does nothing more.

        Args:
            status: ``completed``, ``interrupted`` or ``stopped``.
            message: Why, if it was not completed.

        Raises:
            LogError: If the file cannot be written.
        """
        if self._rollout is None:
            try:
                self._writer.end(status, message)
                self._rollout = self._read()
            finally:
                self._writer.close()
                if self._folder is not None:
                    self._folder.cleanup()
            if self.path is not None:
                self._rollout.save(self.path)
                self._journal.unlink(missing_ok=True)
        return self._rollout

    @property
    def rollout(self) -> Rollout:
        """The log, once the recorder is closed.

        Raises:
            LogError: If it is not.
        """
        if self._rollout is None:
            raise LogError("the recorder still records: close it first")
        return self._rollout

    def _read(self) -> Rollout:
        if self._begun == -inf:
            raise LogError("nothing was recorded")
        rollout = Rollout.load(self._journal)
        if self._config is not None:
            rows = max(len(rollout) - 1, 1)
            settings = {"duration": rows * self._period, "log_period": self._period}
            ratio = self._period / self._held if self._held > 0.0 else 0.0
            if abs(ratio - round(ratio)) < 1e-6 * ratio:
                settings["control_period"] = self._period / round(ratio)
            self._config["simulation"] |= settings
            rollout.meta["config"] = self._config
        return rollout

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.close()
        elif self._begun > -inf:
            interrupted = isinstance(error, KeyboardInterrupt)
            status = "interrupted" if interrupted else "stopped"
            self.close(status, described(error))
        else:  # no row was written
            self._writer.close()
            self._journal.unlink(missing_ok=True)
            if self._folder is not None:
                self._folder.cleanup()
