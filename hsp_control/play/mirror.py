"""A live loop in another process, as its journal and its own words tell of it.

What moves in the picture are the journal's rows. A controller of its own, which follows
the changes that the loop tells of, says what the field is: zones, capsules, distances.
"""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.config import Experiment
from hsp_control.control.controller import Controller
from hsp_control.play.channel import Channel
from hsp_control.play.handles import Handles
from hsp_control.play.knobs import RAMP
from hsp_control.simulation.journal import JournalReader
from hsp_control.simulation.log_writer import LogWriter


class ToldHandles(Handles):
    """What can be touched in another process: where it is, that process tells."""

    def __init__(self, controller: Controller, period: float) -> None:
        """Begin where the controller is."""
        super().__init__(controller, period)
        self._places = super().places()
        self.held = False

    def places(self) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
        """Return where the targets and the obstacles are, by name."""
        return self._places

    def hear(self, word: Mapping[str, Any]) -> None:
        """Note what the loop says; its changes are made here, too."""
        self._places = word["targets"], word["obstacles"]
        self.message, self.warning = word["message"], word["warning"]
        self.held = word["held"]
        for name, value in word["values"].items():
            if value == self.values[name]:
                continue
            self.values[name] = value
            at = self._controller.at(self._controller.state.t).ramp(RAMP)
            with suppress(HspControlError):  # the loop's word counts
                self.knobs[name].turn(at, value)


_KEPT = 1000
"""Rows of the journal that are kept for the picture."""


class Mirror:
    """What a picture needs of a live loop, as of a `Session`."""

    pushes = None

    def __init__(
        self,
        experiment: Experiment,
        period: float,
        journal: Path,
        channel: Channel,
        *,
        held: bool,
    ) -> None:
        """Begin at the experiment's start."""
        self.experiment, self.period = experiment, period
        self.kind: Literal["live", "held"] = "held" if held else "live"
        self.controller = experiment.controller
        output = self.controller.compute(0.0, experiment.q0, experiment.v0)
        start = LogWriter(self.controller, experiment.scene, 1)
        start.record(self.controller.state, output, output.tau, {})
        self.recorder: LogWriter | JournalReader = start
        self.handles = ToldHandles(self.controller, period)
        self.over = ""
        self._journal = JournalReader(journal, most=_KEPT)
        self._channel = channel

    @property
    def t(self) -> float:
        """The time of the last row [s]."""
        return self.controller.state.t

    @property
    def meta(self) -> dict[str, Any]:
        """The meta data of these rows."""
        if isinstance(self.recorder, LogWriter):
            return self.recorder.meta("", "")
        return self.recorder.meta

    def pull(self) -> tuple[Array, Array, float] | None:
        """Return None: nobody pulls at this robot with a mouse."""
        return None

    def say(self, message: dict[str, Any]) -> None:
        """Pass on what a page says."""
        self._channel.send(message)
        if "name" in message:  # of an obstacle
            self.handles.take(message)  # zones and distances follow it here, too

    def read(self) -> None:
        """Read what has come from the loop."""
        for word in self._channel.receive():
            self.handles.hear(word)
        if self._journal.read():
            self.recorder = self._journal
            row = self._journal.rows(self._journal.count - 1)
            with suppress(HspControlError):  # the loop says what is wrong
                self.controller.compute(float(row["t"][0]), row["q"][0], row["v"][0])
        if self._journal.ended:
            self.over = str(self._journal.meta["message"])
        elif self._channel.lost:
            self.over = "the loop's process has ended"
