"""A live loop that a page steers: the loop's side, the page's, and their channel."""

import json
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any, Literal

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError
from hsp_control.companions.play.handles import Handles
from hsp_control.config import Experiment
from hsp_control.control.interface import RAMP, Controller
from hsp_control.live import OperatorRequests
from hsp_control.robot import Robot
from hsp_control.simulation.journal import JournalReader
from hsp_control.simulation.log_writer import LogWriter

_LONGEST = 65536


class Channel:
    """One end of a pair of datagram sockets; neither end ever waits for the other."""

    def __init__(self, end: socket.socket) -> None:
        """Take over an end."""
        end.setblocking(False)
        self._end = end
        self.lost = False

    def send(self, word: dict[str, Any]) -> None:
        """Send a message; it is dropped if the buffer of the other end is full."""
        if self.lost:
            return
        try:
            self._end.send(json.dumps(word).encode())
        except BlockingIOError:
            pass  # a newer one follows
        except OSError:
            self.lost = True

    def receive(self, most: int = 100) -> list[dict[str, Any]]:
        """Return the messages that have arrived, oldest first."""
        words: list[dict[str, Any]] = []
        while len(words) < most and not self.lost:
            try:
                data = self._end.recv(_LONGEST)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if data:
                words.append(json.loads(data))
            else:
                self.lost = True
        return words

    def close(self) -> None:
        """Close this end; a second call does nothing."""
        self.lost = True
        self._end.close()


def channel_pair() -> tuple[Channel, socket.socket]:
    """Return an end for this process, and the other one for another process."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    return Channel(here), there


TIMEOUT = 0.5  # silence after which the key is treated as released [s]


class DeadMansKey:
    """Whether the key is held."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        """Begin with a key that is not held."""
        self._clock = clock
        self._until = -float("inf")

    def update(self, *, held: bool) -> None:
        """Process the page's message about it."""
        self._until = self._clock() + TIMEOUT if held else -float("inf")

    @property
    def held(self) -> bool:
        """Whether it is held now."""
        return self._clock() < self._until


_SEND_PERIOD = 1.0 / 30.0  # time between two messages to the page [s]
_MESSAGES = 4  # maximum number of messages processed in a period


class SteeredLoop:
    """Lets a page steer the controller of a live loop."""

    def __init__(
        self,
        controller: Controller,
        period: float,
        channel: Channel,
        requests: OperatorRequests,
        *,
        key: DeadMansKey | None = None,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        """Begin without a change."""
        self.handles = Handles(controller, period)
        self.key = key
        self._channel, self._requests = channel, requests
        self._clock, self._next = clock, -float("inf")

    def on_period(self, _t: float) -> None:
        """Process messages, and report all places; see `run_loop`."""
        self.listen()
        if self.key is not None and not self.key.held:
            self._requests.stop("the dead-man's key was released")
        self.handles.turn_knobs()
        now = self._clock()
        if now >= self._next:
            self._next = now + _SEND_PERIOD
            self.send_state()

    def listen(self) -> None:
        """Process the messages of the page that have arrived."""
        for message in self._channel.receive(_MESSAGES):
            match message:
                case {"do": "hold", "held": bool(held)}:
                    self._hold(held=held)
                case {"do": "left"}:
                    self._hold(held=False)
                case {"do": "stop"}:
                    self._requests.stop("stopped from the page")
                case _ if self._requests.reason is None:
                    self.handles.receive(message)
        if self._channel.lost:  # it can no longer be steered
            self._requests.stop("the process of the page has ended", fault=True)

    def send_state(self) -> None:
        """Report the places of all handles and the values of the knobs."""
        targets, obstacles = self.handles.places()
        word: dict[str, Any] = {
            "targets": targets,
            "obstacles": obstacles,
            "values": self.handles.values,
            "message": self.handles.message,
            "warning": self.handles.warning,
            "held": self.key is not None and self.key.held,
        }
        self._channel.send(word)

    def _hold(self, *, held: bool) -> None:
        if self.key is not None:
            self.key.update(held=held)


class RemoteHandles(Handles):
    """Handles and knobs in another process, which reports their places and values."""

    def __init__(self, controller: Controller, period: float) -> None:
        """Begin with the controller's state."""
        super().__init__(controller, period)
        self._places = super().places()
        self.held = False

    def places(self) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
        """Return the places of the targets and the obstacles, by name."""
        return self._places

    def update(self, word: Mapping[str, Any]) -> None:
        """Store the loop's report; its changes are made here, too."""
        self._places = word["targets"], word["obstacles"]
        self.message, self.warning = word["message"], word["warning"]
        self.held = word["held"]
        for name, value in word["values"].items():
            if value == self.values[name]:
                continue
            self.values[name] = value
            at = self._controller.at(self._controller.state.t).ramp(RAMP)
            with suppress(HspControlError):  # the loop decides
                self.knobs[name].turn(at, value)


_KEPT = 1000
"""Rows of the journal that are kept for the picture."""


class Mirror:
    """The data of a live loop for a picture, as of a `Session`."""

    pushes = None
    laws: tuple[str, ...] = ()
    other = None
    previews = False

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
        self.handles = RemoteHandles(self.controller, period)
        self.over = ""
        self._journal = JournalReader(journal, most=_KEPT)
        self._channel = channel

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.experiment.robot

    @property
    def title(self) -> str:
        """The title of the scene."""
        return self.experiment.scenario.title or self.robot.name

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
        """Return None: links of a live loop cannot be pulled."""
        return None

    def say(self, message: dict[str, Any]) -> None:
        """Forward a page's commands; a preview is computed in this process."""
        if message["do"] == "preview":
            self.previews = message.get("on") is True
            return
        self._channel.send(message)
        if "name" in message:  # of an obstacle
            self.handles.receive(message)  # zones and distances follow it here, too

    def read(self) -> None:
        """Read the new messages of the loop."""
        for word in self._channel.receive():
            self.handles.update(word)
        if self._journal.read():
            self.recorder = self._journal
            row = self._journal.rows(self._journal.count - 1)
            with suppress(HspControlError):  # the loop reports it
                self.controller.compute(float(row["t"][0]), row["q"][0], row["v"][0])
        if self._journal.ended:
            self.over = str(self._journal.meta["message"])
        elif self._channel.lost:
            self.over = "the loop's process has ended"
