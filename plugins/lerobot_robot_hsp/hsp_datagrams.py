"""Receives the state of an ``hsp live`` loop and sends it targets, with Python alone.

    loop = Loop("127.0.0.1:5006")
    x, y, z, *quaternion = loop.state()["frames"]["panda_tcp"]
    loop.send("127.0.0.1:5005", [x, y, z + 0.01, *quaternion])

The loop must publish its state there: ``hsp live CONFIG --publish udp://127.0.0.1:5006``.
The keys of a state are in ``hsp_control/companions/datagrams/policies.md``.
"""

import json
import socket
from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin
from select import select
from threading import Condition, Thread
from time import monotonic
from typing import Any

_LARGEST = 65_536
_POLL = 0.1
"""How soon the thread that listens notices that it must end [s]."""


class LoopError(ConnectionError):
    """No state is received, or the loop has ended."""


class Loop:
    """A loop in another process; a thread receives its newest state."""

    def __init__(self, states: str, timeout: float = 2.0) -> None:
        """Listen.

        Args:
            states: ``HOST:PORT`` where the loop publishes its state.
            timeout: Silence after which the loop is regarded as ended [s].

        Raises:
            LoopError: If something else listens there.
        """
        self._states, self._timeout, where = states, timeout, _address(states)
        self._in, self._out = (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)
        )
        try:
            self._in.bind(where)
        except OSError as error:
            self._in.close()
            self._out.close()
            raise LoopError(
                f"udp://{states}: cannot listen there: {error.strerror or error}"
            ) from None
        self._in.settimeout(_POLL)
        self._newest: dict[str, Any] | None = None
        self._heard = -float("inf")
        self._opening: float | None = None
        self._changed, self._open = Condition(), True
        self._thread = Thread(target=self._listen, name="states", daemon=True)
        self._thread.start()

    def state(self, later_than: int | None = None) -> dict[str, Any]:
        """Return the newest state; wait for it if there is none.

        Args:
            later_than: A ``number``: wait for a state after that one.

        Raises:
            LoopError: If the loop has ended, or is silent.
        """
        deadline = monotonic() + self._timeout
        with self._changed:
            while True:
                found, now = self._newest, monotonic()
                if found is not None and now - self._heard < self._timeout:
                    if found["phase"] != "running":
                        raise LoopError(f"the loop has ended: {found['reason']}")
                    if later_than is None or found["number"] != later_than:
                        return found
                if now >= deadline:
                    raise LoopError(
                        f"no state of a loop for {self._timeout:g} s at "
                        f"udp://{self._states}; start it with: hsp live CONFIG "
                        f"--duration inf --publish udp://{self._states}"
                    )
                self._changed.wait(deadline - now)

    def send(self, to: str, value: Sequence[float]) -> None:
        """Send a target to the stream that listens at ``HOST:PORT``."""
        self._send(to, {"value": [float(each) for each in value]})

    def send_chunk(
        self, to: str, values: Sequence[Sequence[float]], times: Sequence[float]
    ) -> None:
        """Send waypoints and their times from now [s]; they replace earlier ones."""
        rows = [[float(each) for each in row] for row in values]
        self._send(to, {"values": rows, "times": [float(each) for each in times]})

    def opening(self, gripper: str, wait: float = 0.0) -> float | None:
        """Return the last reported opening of a finger of a Franka's gripper.

        It reports between its motions, at ``HOST:PORT``; None: never yet.
        """
        self._out.sendto(b"{}", _address(gripper))
        while select([self._out], [], [], wait)[0]:
            self._opening, wait = json.loads(self._out.recv(_LARGEST))["value"][0], 0.0
        return self._opening

    def close(self) -> None:
        """Stop listening; a second call does nothing."""
        self._open = False
        self._thread.join()
        self._in.close()
        self._out.close()

    def _send(self, to: str, message: dict[str, Any]) -> None:
        text = json.dumps({**message, "t": monotonic()})
        self._out.sendto(text.encode(), _address(to))

    def _listen(self) -> None:
        while self._open:
            try:
                heard = json.loads(self._in.recv(_LARGEST))
            except TimeoutError:
                continue
            except (OSError, ValueError):  # another sender's datagram
                continue
            if not (isinstance(heard, dict) and {"number", "phase"} <= heard.keys()):
                continue
            with self._changed:
                if self._is_newer(heard):
                    self._newest, self._heard = heard, monotonic()
                    self._changed.notify_all()

    def _is_newer(self, heard: dict[str, Any]) -> bool:
        """Return whether a state is a later one, or of another run."""
        last = self._newest
        if last is None or last["phase"] != "running":
            return last is None or heard["phase"] == "running"
        silent = monotonic() - self._heard > 0.5 * self._timeout
        return silent or heard["number"] > last["number"]


def _address(text: str) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise ValueError(f"{text!r} is no address; needs HOST:PORT, as 127.0.0.1:5006")
    return host, int(port)


def quaternion_of(turn: Sequence[float]) -> list[float]:
    """Return the quaternion (x, y, z, w) of a rotation vector [rad]."""
    angle = hypot(*turn)
    along = 0.5 - angle * angle / 48.0 if angle < 1e-4 else sin(0.5 * angle) / angle
    return [along * each for each in turn] + [cos(0.5 * angle)]


_DOWNWARDS = 0.5
"""How near to half a turn a rotation is that begins with its largest entry positive."""


def rotation_vector_of(
    quaternion: Sequence[float], near: Sequence[float] | None = None
) -> list[float]:
    """Return a rotation vector of a quaternion (x, y, z, w) [rad].

    A hand that points downwards has turned by about half a turn, where rotation vectors
    jump to the other side. Near the last one they go on; the first has its largest
    entry positive there.
    """
    *v, w = quaternion
    if w < 0.0:
        v, w = [-each for each in v], -w
    sine = hypot(*v)
    angle = 2.0 * atan2(sine, w)
    if sine < 1e-9:
        turn = [2.0 * each for each in v]
    else:
        turn = [angle / sine * each for each in v]
    if angle < 1e-6:
        return turn
    other = [each * (1.0 - 2.0 * pi / angle) for each in turn]
    if near is None:
        half = pi - angle < _DOWNWARDS and max(turn, key=abs) < 0.0
        return other if half else turn
    return min(turn, other, key=lambda each: _apart(each, near))


def _apart(one: Sequence[float], other: Sequence[float]) -> float:
    return hypot(*(a - b for a, b in zip(one, other, strict=True)))
