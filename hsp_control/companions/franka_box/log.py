"""The true motion behind a control box as an ordinary log."""

from math import floor, inf
from pathlib import Path
from typing import Self

from hsp_control.common.exceptions import LogError
from hsp_control.companions.franka_box import Box
from hsp_control.config import Experiment
from hsp_control.control.measurement import LogChannel
from hsp_control.live.live_log import LiveLog, Row
from hsp_control.robot import RobotState
from hsp_control.simulation import Rollout
from hsp_control.simulation.plants import differing_bodies

_PERIOD = 0.01
"""Time between two rows [s]."""


class BoxLog:
    """Writes rows while the arm moves; a context, whose end completes the log.

    The columns of the configuration's own controller are empty: somebody else's
    controls the arm.

    Attributes:
        path: The log.
    """

    def __init__(self, path: Path, experiment: Experiment, box: Box) -> None:
        """Begin a journal beside the log, and watch the box."""
        if path.suffix != ".npz":
            raise LogError(f"--log {path}: the name of a log ends in .npz")
        self.path, self._box = path, box
        self._state = RobotState(experiment.robot)
        self._next = -inf
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
        journal = path.with_suffix(".journal")
        self._log = LiveLog(journal, experiment.controller, experiment.scene, meta)
        self._log.warm_up(self._row())
        box.on_period = self._on_period

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if error is None:
            self._log.end("completed", "the box was switched off")
        else:
            self._log.end("stopped", str(error) or type(error).__name__)
        Rollout.load(self._log.path).save(self.path)
        self._log.path.unlink()

    def _on_period(self) -> None:
        box = self._box
        if not box.at_rest and box.t >= self._next:
            self._next = (floor(box.t / _PERIOD + 1e-6) + 1.0 - 1e-6) * _PERIOD
            self._log.add(self._row())

    def _row(self) -> Row:
        box = self._box
        channels = {
            "box.mode": LogChannel(float(box.mode), "-", "1 idle; 2 move; 4 reflex"),
            **box.plant.log_channels(box.t, box.q, box.v, box.tau),
        }
        return Row(self._state.update(box.t, box.q, box.v), None, box.tau, channels)
