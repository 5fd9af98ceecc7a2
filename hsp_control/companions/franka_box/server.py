"""Serve a box on loopback, in real time or in lockstep with its client."""

import ipaddress
import socket
from collections.abc import Callable
from contextlib import suppress
from select import select
from time import monotonic
from typing import Self

import numpy as np

from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.companions.franka.layouts import PERIOD, PORT, MoveStatus
from hsp_control.companions.franka_box.box import ControlBox, Say
from hsp_control.companions.franka_box.connection import (
    Connection,
    ConnectionEnd,
    break_off,
)
from hsp_control.companions.franka_box.motion import Motion
from hsp_control.companions.franka_box.requests import Requests
from hsp_control.live.real_time import no_garbage_collection

DEADLINE = 300e-6
"""Maximum time of a client for a command [s]: "approx. < 300 µs for your own control
loop" (https://frankarobotics.github.io/docs/libfranka.html)."""
PATIENCE = 0.5
"""Maximum wait of a box in lockstep for a command [s]; libfranka waits a second."""


class Server:
    """Serves one client at a time; without a client the box holds the arm.

    In real time a period takes a millisecond, and a command that comes later than the
    deadline is lost. In lockstep the box waits for the command of each state, and while
    no client moves the arm time does not advance: the same commands give the same bits.
    The box's own motions, braking and recovery, then take place between two states.

    Attributes:
        box: The box.
        client: The client's connection, or None.
        overrun: Delay of the box's time behind real time [s].
    """

    def __init__(
        self,
        box: ControlBox,
        say: Say,
        *,
        host: str = "127.0.0.1",
        lockstep: bool = False,
        deadline: float = DEADLINE,
        patience: float = PATIENCE,
        cut: float | None = None,
    ) -> None:
        """Listen.

        Args:
            box: The box.
            say: Called with a line per event.
            host: A loopback address; the port is always `PORT`.
            lockstep: Whether to wait for commands, instead of real time.
            deadline: Of a command in real time, after its state [s].
            patience: Longest wait for a command in lockstep [s].
            cut: Simulated time from which states and commands no longer arrive [s]; TCP
            stays. None: never.

        Raises:
            LiveError: If a time is out of range.
            HardwareError: If the address is not one of loopback, or is in use.
        """
        _check_times(deadline, patience, cut)
        self.box, self._say = box, say
        self._requests = Requests(box, say)
        self._host, self._lockstep = host, lockstep
        self._deadline, self._patience, self._cut_at = deadline, patience, cut
        self._cut = False
        self._announced: Motion | None = None
        self.client: Connection | None = None
        self.overrun = 0.0
        self._due = monotonic()
        self._listener = listen(host, PORT)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._part("the box is switched off", broken=True)
        self._listener.close()

    def serve(self, on_period: Callable[[], bool]) -> None:
        """Serve clients.

        Args:
            on_period: Called before every period; false ends the service.
        """
        advance = self._in_lockstep if self._lockstep else self._in_real_time
        # An overflow is refused, or a reflex; NumPy need not warn.
        with no_garbage_collection(), np.errstate(all="ignore"):
            self._due = monotonic()
            while on_period():
                self._notice_cut()
                number = self._send_state()
                self._respond()  # a state that is read after it is newer
                advance(number)

    def _send_state(self) -> int:
        """Send the next state, and return its number; 0 if no client can answer it."""
        number, state = self.box.state()
        client = self.client
        if client is None or not client.connected or self._cut:
            return 0
        client.send(state)
        return number

    def _in_real_time(self, number: int) -> None:
        """Wait for the command, step, and wait for the end of the period.

        A state that was sent late leaves its client the whole time until the deadline.
        """
        now = monotonic()
        late = now - self._due
        if late > PERIOD:  # it is not caught up: the clock is shifted
            self.overrun += late
            self._due = now
        self._due += PERIOD
        self.box.step(self._await(number, now + self._deadline))
        self._await(0, self._due)

    def _in_lockstep(self, number: int) -> None:
        """Wait for the command, or for a request that ends the motion, and step."""
        box = self.box
        motion = box.motion
        if motion is None:
            box.settle()
            self._await(0, monotonic() + PERIOD)
            return
        begun = motion.commands > 0
        if begun:
            longest = 0.0 if self._cut else self._patience
        else:  # the first state confirms the start; the client answers the next
            longest = PATIENCE if motion is self._announced else PERIOD
            self._announced = motion
        command = self._await(number, monotonic() + longest, motion)
        if box.motion is motion and (begun or command is not None):
            box.step(command)

    def _await(
        self, number: int, until: float, motion: Motion | None = None
    ) -> np.void | None:
        """Serve requests until the command for a state has arrived, or until a time.

        Args:
            number: Number of the state; 0: there is no command to wait for.
            until: Time at which to return, on the monotonic clock [s].
            motion: If given, return also when this motion has ended.
        """
        while True:
            client = self.client
            sockets = [self._listener]
            if client is not None:
                sockets.append(client.tcp)
                if number:
                    sockets.append(client.udp)
            ready, _, _ = select(sockets, [], [], max(until - monotonic(), 0.0))
            if client is not None and client.tcp in ready:
                # it may disconnect, and another one connect
                self._serve_requests(client)
            if self._listener in ready:
                self._accept()
            if client is not None and client.udp in ready:
                limit = np.inf if self._lockstep else self._deadline
                command = self._command(client, number, float(limit))
                if command is not None:
                    return command
            ended = motion is not None and self.box.motion is not motion
            if ended or monotonic() >= until:
                return None

    def _command(self, client: Connection, number: int, limit: float) -> np.void | None:
        malformed = client.malformed
        command = client.command(number, limit)
        if client.malformed and not malformed:
            self._say(f"ignored: a datagram of {client.name} that is not a command")
        return command

    def _accept(self) -> None:
        tcp, peer = self._listener.accept()
        silent = self.client is not None and self.client.silent
        if silent:  # it has not sent its version yet
            self._part("it is silent, and another client is waiting", broken=True)
        if self.client is not None:
            self._say(
                f"refused: {peer[0]}:{peer[1]}, since {self.client.name} is connected"
            )
            break_off(tcp)
            tcp.close()
            return
        self.client, self._cut = Connection(tcp, peer, self._host), False

    def _serve_requests(self, client: Connection) -> None:
        before, motion = client.connected, self.box.motion
        try:
            for request in client.requests():
                self._requests.answer(*request)
        except ConnectionEnd as end:
            self._part(str(end), broken=not end.answered)
            return
        if client.connected and not before:
            self._say(f"{client.name} is connected")
        if motion is not None and self.box.motion is motion:
            self._respond()  # in lockstep the next state may have to wait for it

    def _respond(self) -> None:
        data, client = b"".join(self.box.outbox), self.client
        self.box.outbox.clear()
        if client is not None and data:
            try:
                client.respond(data)
            except ConnectionEnd as end:
                self._part(str(end), broken=True)

    def _part(self, why: str, *, broken: bool) -> None:
        """End the connection of the client, if there is one."""
        client, self.client = self.client, None
        if client is None:
            return
        self._say(f"{client.name} is disconnected: {why}")
        self.box.end(MoveStatus.ABORTED, "its client is disconnected")
        with suppress(OSError):
            client.close(broken=broken)
        self.box.outbox.clear()

    def _notice_cut(self) -> None:
        if self._cut_at is not None and self.box.t >= self._cut_at and self.client:
            self._cut, self._cut_at = True, None
            self._say("the link is cut: neither states nor commands arrive any more")


def _check_times(deadline: float, patience: float, cut: float | None) -> None:
    if not 0.0 < deadline <= PERIOD:
        raise LiveError(
            f"deadline {1e6 * deadline:g} µs; must be above 0, and "
            f"{1e6 * PERIOD:g} µs, a period, at most"
        )
    if not 0.0 < patience < np.inf:
        raise LiveError(f"patience {patience:g} s; must be positive")
    if cut is not None and not cut >= 0.0:
        raise LiveError(f"cut {cut:g} s; must not be negative")


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens on loopback."""
    try:
        loopback = ipaddress.IPv4Address(host).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise HardwareError(
            f"host {host!r}; the box listens on loopback only, 127.0.0.1 to "
            "127.255.255.254: the protocol knows no password"
        )
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise HardwareError(
            f"{host}:{port}: {error.strerror}; libfranka knows no other port: give "
            "another address, such as 127.0.0.2"
        ) from None
    listener.listen()
    return listener
