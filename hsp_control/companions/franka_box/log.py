"""The true motion behind a control box as an ordinary log."""

from pathlib import Path
from typing import Self

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LogError
from hsp_control.companions.franka_box import ControlBox
from hsp_control.config import Experiment
from hsp_control.control.interface import LogChannel
from hsp_control.live.live_log import DueRows
from hsp_control.robot import RobotState
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.plants import differing_bodies

_PERIOD = 0.01
"""Time between two rows [s]."""


class BoxLog:
    """Writes rows while the arm moves; a context, whose end completes the log.

    The columns of the configuration's controller are empty: the client controls the
    arm.

    Attributes:
        path: The log.
    """

    def __init__(self, path: Path, experiment: Experiment, box: ControlBox) -> None:
        """Begin a journal beside the log, and observe the box."""
        if path.suffix != ".npz":
            raise LogError(f"--log {path}: the name of a log ends in .npz")
        self.path, self._box = path, box
        self._state = RobotState(experiment.robot)
        self._due = DueRows(_PERIOD)
        plant = {
            **box.plant.describe(),
            **differing_bodies(box.plant, experiment.robot),
        }
        meta = {
            "name": f"{experiment.name}, behind a control box",
            "title": experiment.scenario.title,
            "config": experiment.config,
            "plant": plant,
        }
        self._journal = path.with_suffix(".journal")
        self._log = LogWriter(
            experiment.controller, experiment.scene, 0, path=self._journal, meta=meta
        )
        self._log.warm_up(*self._row())
        box.on_period = self._on_period

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if error is None:
            self._log.end("completed", "the box was switched off")
        else:
            self._log.end("stopped", str(error) or type(error).__name__)
        Rollout.load(self._journal).save(self.path)
        self._journal.unlink()

    def _on_period(self) -> None:
        box = self._box
        if not box.at_rest and self._due.is_due(box.t, 0):
            self._log.record(*self._row())
            self._due.written(box.t, 0)

    def _row(self) -> tuple[RobotState, None, Array, dict[str, LogChannel]]:
        """Return the arguments of `LogWriter.record`."""
        box = self._box
        channels = {
            "box.mode": LogChannel(float(box.mode), "-", "1 idle; 2 move; 4 reflex"),
            **box.plant.log_channels(box.t, box.q, box.v, box.tau),
        }
        return self._state.update(box.t, box.q, box.v), None, box.tau, channels
