"""A client's connection: requests over TCP, states and commands over UDP."""

import socket
import struct
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.errors import HardwareError
from hsp_control.companions.franka.layouts import (
    COMMAND,
    CONNECTED,
    HEADER,
    INCOMPATIBLE_VERSION,
    REQUESTS,
    STATE,
    VERSION,
    FrankaCommand,
    FrankaStatus,
    message,
)

_TIMESTAMPS = 35
"""SO_TIMESTAMPNS: the kernel records when a datagram arrived (Linux)."""
_MOST = 65536


class ConnectionEnd(HardwareError):
    """The client has disconnected, or has violated the protocol.

    Attributes:
        answered: Whether the client was informed, and will disconnect.
    """

    answered = False


_PATIENCE = 2.0
"""Maximum silence of a new client while another one waits [s]."""


class Request(NamedTuple):
    """A request.

    Attributes:
        command: The command.
        number: Its number, which the response repeats.
        payload: The rest.
    """

    command: FrankaCommand
    number: int
    payload: bytes


class Connection:
    """The connection of one client.

    Attributes:
        name: Its address, for the user.
        connected: Whether it has confirmed our version.
        outdated: Number of commands for another state than the last one.
        late: Number of commands after the deadline.
        malformed: Number of datagrams that are not commands.
    """

    def __init__(self, tcp: socket.socket, peer: tuple[str, int], host: str) -> None:
        """Take over an accepted socket."""
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        tcp.setblocking(False)
        self.tcp, self.name = tcp, f"{peer[0]}:{peer[1]}"
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.setsockopt(socket.SOL_SOCKET, _TIMESTAMPS, 1)
        self.udp.setblocking(False)
        self.udp.bind((host, 0))
        self._peer, self._buffer = (peer[0], 0), b""
        self._sent, self._begun = 0, time.monotonic()
        self.connected = False
        self.outdated = self.late = self.malformed = 0

    @property
    def silent(self) -> bool:
        """Whether it has not sent its version for some time."""
        return not self.connected and time.monotonic() - self._begun > _PATIENCE

    def requests(self) -> Iterator[Request]:
        """Yield the complete requests that have arrived; answer the first here."""
        try:
            received = self.tcp.recv(_MOST)
        except BlockingIOError:
            return
        except OSError as error:
            raise ConnectionEnd(f"the connection broke: {error.strerror}") from None
        if not received:
            raise ConnectionEnd("the client has closed the connection")
        self._buffer += received
        while len(self._buffer) >= HEADER.itemsize:
            kind, number, size = np.frombuffer(self._buffer, HEADER, 1)[0].item()
            command = _command(kind, size)
            if len(self._buffer) < size:
                return
            payload = self._buffer[HEADER.itemsize : size]
            self._buffer = self._buffer[size:]
            if self.connected and command is not FrankaCommand.CONNECT:
                yield Request(command, number, payload)
            else:
                self._connect(Request(command, number, payload))

    def respond(self, data: bytes) -> None:
        """Send responses."""
        try:
            self.tcp.sendall(data)
        except OSError as error:
            raise ConnectionEnd(f"the connection broke: {error.strerror}") from None

    def send(self, state: bytes) -> None:
        """Send a state; it may be lost."""
        assert len(state) == STATE.itemsize
        self._sent = time.time_ns()
        try:
            self.udp.sendto(state, self._peer)
        except OSError:  # the buffer is full, or the listener has left
            return

    def command(self, number: int, deadline: float) -> np.void | None:
        """Return the command for a state, if it has arrived in time."""
        while True:
            try:
                data, notes, _, address = self.udp.recvmsg(_MOST, 64)
            except OSError:  # no datagram, or an earlier state was not delivered
                return None
            if len(data) != COMMAND.itemsize or address != self._peer:
                self.malformed += 1
                continue
            command: np.void = np.frombuffer(data, COMMAND)[0]
            if command["message_id"] != number:
                self.outdated += 1
            elif _arrival(notes) - self._sent > 1e9 * deadline:
                self.late += 1
            else:
                return command

    def close(self, *, broken: bool) -> None:
        """Close the connection."""
        if broken:
            break_off(self.tcp)
        self.tcp.close()
        self.udp.close()

    def _connect(self, request: Request) -> None:
        if request.command is not FrankaCommand.CONNECT or self.connected:
            raise ConnectionEnd(
                f"{request.command.name.lower()} where the first request "
                f"{'is over' if self.connected else 'has to be connect'}"
            )
        asked = np.frombuffer(request.payload, REQUESTS[FrankaCommand.CONNECT])[0]
        version, port = (int(x) for x in asked)
        same = version == VERSION
        status = FrankaStatus.SUCCESS if same else INCOMPATIBLE_VERSION
        payload = np.array((status, VERSION), CONNECTED).tobytes()
        self.respond(message(FrankaCommand.CONNECT, request.number, payload))
        if not same:
            end = ConnectionEnd(
                f"the client speaks version {version} of the research interface; this "
                f"box speaks {VERSION}, as libfranka 0.18 to 0.21 do"
            )
            end.answered = True
            raise end
        self.connected, self._peer = True, (self._peer[0], port)


def break_off(tcp: socket.socket) -> None:
    """Make a socket's next close reset the connection."""
    tcp.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def _command(kind: int, size: int) -> FrankaCommand:
    """Return the command of a header, if its size is right."""
    try:
        command = FrankaCommand(kind)
    except ValueError:
        raise ConnectionEnd(
            f"malformed request: command {kind} does not exist"
        ) from None
    right = HEADER.itemsize + REQUESTS[command].itemsize
    if size != right:
        raise ConnectionEnd(
            f"malformed request: {command.name.lower()} of {size} bytes; it has {right}"
        )
    return command


def _arrival(notes: list[tuple[int, int, bytes]]) -> int:
    """Return when the kernel received a datagram [ns], on the clock `time.time_ns`."""
    for level, kind, data in notes:
        if level == socket.SOL_SOCKET and kind == _TIMESTAMPS:
            seconds, nanoseconds = struct.unpack("@qq", data[:16])
            return int(seconds * 1_000_000_000 + nanoseconds)
    return time.time_ns()
