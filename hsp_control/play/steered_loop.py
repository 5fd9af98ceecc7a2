"""The side of a live loop on which a page steers: what it does in each period's rest.

The page has a process of its own, which reads the loop's journal; here its messages
arrive, and words go back of where the targets are. So neither drawing nor a network
takes time from the loop. A message costs what its change of the controller costs.
"""

from collections.abc import Callable
from time import monotonic
from typing import Any

from hsp_control.control.controller import Controller
from hsp_control.live import OperatorRequests
from hsp_control.play.channel import Channel
from hsp_control.play.dead_mans_key import DeadMansKey
from hsp_control.play.handles import Handles

TOLD = 1.0 / 30.0  # time between two words to the page [s]
_MESSAGES = 4  # messages that are taken in one period at most


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
        """Begin with nothing touched."""
        self.handles = Handles(controller, period)
        self.key = key
        self._channel, self._requests = channel, requests
        self._clock, self._next = clock, -float("inf")

    def on_period(self, _t: float) -> None:
        """Take messages, and say where everything is; see `run_loop`."""
        self.listen()
        if self.key is not None and not self.key.held:
            self._requests.stop("the dead-man's key was released")
        self.handles.turn_knobs()
        now = self._clock()
        if now >= self._next:
            self._next = now + TOLD
            self.tell()

    def listen(self) -> None:
        """Take the messages of the page that have arrived."""
        for message in self._channel.receive(_MESSAGES):
            match message:
                case {"do": "hold", "held": bool(held)}:
                    self._hold(held=held)
                case {"do": "left"}:
                    self._hold(held=False)
                case {"do": "stop"}:
                    self._requests.stop("stopped from the page")
                case _ if self._requests.reason is None:
                    self.handles.take(message)
        if self.key is not None and self._channel.lost:  # nobody can hold it any more
            self._requests.stop("the process of the page has ended")

    def tell(self) -> None:
        """Say where everything is, and what the knobs are set to."""
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
            self.key.hear(held=held)
