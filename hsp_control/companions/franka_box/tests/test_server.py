"""The server and faulty clients: one message per fault, and the box continues."""

import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from select import select
from time import monotonic
from typing import Any

import numpy as np
import pytest
from franka_boxes import Rig, home, panda, plant, served

from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.companions.franka.layouts import (
    COMMAND,
    HEADER,
    PORT,
    STATE,
    FrankaCommand,
    message,
)
from hsp_control.companions.franka_box import ControlBox, Server, connection
from hsp_control.companions.franka_box.connection import Connection

LONGEST = 30.0
MOVE = struct.pack("<II", 2, 4).ljust(113, b"\0")
"""Torque control."""


class RawClient:
    """A client that can send anything."""

    def __init__(self, rig: Rig) -> None:
        self.tcp = socket.create_connection((rig.host, PORT), LONGEST)
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.settimeout(LONGEST)
        self.udp.bind(("127.0.0.1", 0))
        self.box: Any = None

    def ask(self, command: int, payload: bytes = b"", number: int = 1) -> bytes:
        """Send a request, and return the response's payload; b"" at an end."""
        self.tcp.sendall(message(command, number, payload))
        return self.answer()

    def answer(self) -> bytes:
        try:
            head = self.tcp.recv(HEADER.itemsize, socket.MSG_WAITALL)
            if len(head) < HEADER.itemsize:
                return b""
            size = int(np.frombuffer(head, HEADER)[0]["size"])
            return self.tcp.recv(size - len(head), socket.MSG_WAITALL)
        except ConnectionResetError:
            return b""

    def connect(self, version: int = 10) -> bytes:
        port = self.udp.getsockname()[1]
        return self.ask(FrankaCommand.CONNECT, struct.pack("<HH", version, port))

    def state(self) -> Any:
        data, self.box = self.udp.recvfrom(4096)
        return np.frombuffer(data, STATE)[0]

    def close(self) -> None:
        self.tcp.close()
        self.udp.close()


@contextmanager
def client(rig: Rig) -> Iterator[RawClient]:
    made = RawClient(rig)
    try:
        yield made
    finally:
        made.close()


def serves(rig: Rig) -> bool:
    """Return whether the next client is served, i.e. receives a state."""
    with client(rig) as good:
        return good.connect() == b"\0\x0a\0" and int(good.state()["message_id"]) > 0


def test_a_client_of_another_version_receives_ours() -> None:
    with served() as rig:
        with client(rig) as old:
            assert old.connect(version=9) == b"\1\x0a\0"
            assert old.answer() == b""
        assert serves(rig)
        line = rig.message_with("version 9")
        assert line.endswith("this box speaks 10, as libfranka 0.18 to 0.21 do")


@pytest.mark.parametrize(("data", "message"), [
    (struct.pack("<III", 99, 1, 12), "command 99 does not exist"),
    (struct.pack("<III", 1, 1, 12), "move of 12 bytes; it has 125"),
    (struct.pack("<III", 2, 1, 5), "stop_move of 5 bytes; it has 12"),
    (struct.pack("<III", 2, 1, 2**32 - 1), "4294967295 bytes; it has 12"),
    (b"GET / HTTP/1.1\r\nHost: box\r\n\r\n", "does not exist"),
    (struct.pack("<IIIHH", 0, 1, 16, 10, 1), "where the first request is over"),
])  # fmt: skip
def test_a_malformed_request_ends_the_connection(data: bytes, message: str) -> None:
    with served() as rig:
        with client(rig) as bad:
            assert bad.connect()
            bad.tcp.sendall(data)
            assert bad.answer() == b""
        assert serves(rig)
        assert "is disconnected: " in rig.message_with(message)


def test_a_command_is_late_by_when_it_arrived_not_by_when_it_is_read() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        tcp = socket.create_connection(listener.getsockname())
        connection = Connection(*listener.accept(), "127.0.0.1")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp, tcp:
            udp.bind(("127.0.0.1", 0))
            hello = struct.pack("<HH", 10, udp.getsockname()[1])
            tcp.sendall(message(FrankaCommand.CONNECT, 1, hello))
            select([connection.tcp], [], [], LONGEST)
            assert not list(connection.requests())
            box = connection.udp.getsockname()
            for deadline, late in ((0.0, 1), (LONGEST, 1)):
                connection.send(bytes(STATE.itemsize))
                udp.sendto(bytes(COMMAND.itemsize), box)
                sent = monotonic()
                while monotonic() < sent + 1e-3:  # read later than it arrives
                    pass
                command = connection.command(0, deadline)
                assert (command is None) == (deadline == 0.0)
                assert connection.late == late
        connection.close(broken=False)


def test_datagrams_that_are_no_commands_are_ignored() -> None:
    """Truncated, foreign and outdated ones are ignored; the valid one moves the arm."""
    with served(patience=LONGEST) as rig, client(rig) as noisy:
        assert noisy.connect()
        noisy.state()
        assert noisy.ask(FrankaCommand.MOVE, MOVE) == b"\1"
        while (state := noisy.state())["robot_mode"] != 2:
            pass
        good = np.zeros(1, COMMAND)
        good["message_id"] = state["message_id"]
        for _ in range(2):
            noisy.udp.sendto(b"torn", noisy.box)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign:
            foreign.sendto(good.tobytes(), noisy.box)
        good["message_id"] += 10**6
        noisy.udp.sendto(good.tobytes(), noisy.box)
        motion = rig.box.motion
        assert motion is not None
        while not motion.commands:  # it also reads earlier ones
            good["message_id"] = noisy.state()["message_id"]
            noisy.udp.sendto(good.tobytes(), noisy.box)
        assert rig.server.client is not None
        assert rig.server.client.malformed == 3
        assert rig.server.client.outdated >= 1
        assert rig.message_with("that is not a command")


def test_random_bytes_never_stop_the_box() -> None:
    random = np.random.default_rng(11)
    with served() as rig:
        for length in random.integers(1, 600, 40):
            with client(rig) as mad:
                if length % 2:
                    mad.connect()
                # the box may have closed the connection by then
                with suppress(OSError):
                    mad.tcp.sendall(random.bytes(int(length)))
                    mad.tcp.shutdown(socket.SHUT_WR)
                while mad.answer():
                    pass
        assert serves(rig)


def test_in_real_time_a_command_after_the_deadline_is_lost() -> None:
    """No answer arrives within a nanosecond; within a millisecond one does."""
    for deadline, in_time in ((1e-9, False), (1e-3, True)):
        with served(lockstep=False, deadline=deadline) as rig, client(rig) as quick:
            assert quick.connect()
            assert quick.ask(FrankaCommand.MOVE, MOVE) == b"\1"
            for _ in range(50 if not in_time else 10_000):
                good = np.zeros(1, COMMAND)
                good["message_id"] = quick.state()["message_id"]
                quick.udp.sendto(good.tobytes(), quick.box)
                motion, served_client = rig.box.motion, rig.server.client
                if in_time and (motion is None or motion.commands):
                    break
            assert served_client is not None
            if in_time:
                assert motion is None or motion.commands
            else:
                assert motion is not None
                assert not motion.commands
                assert served_client.late + served_client.outdated > 0


@pytest.mark.parametrize(("option", "message"), [
    ({"deadline": 0.0}, "deadline 0 µs; must be above 0"),
    ({"deadline": 2e-3}, "deadline 2000 µs"),
    ({"patience": float("nan")}, "patience nan s; must be positive"),
    ({"cut": -1.0}, "cut -1 s"),
])  # fmt: skip
def test_times_out_of_range_are_refused(option: dict[str, float], message: str) -> None:
    box = ControlBox(panda(), plant(), home(), print)
    with pytest.raises(LiveError, match=message):
        Server(box, print, **option)


def test_addresses_beyond_loopback_and_taken_ones_are_refused() -> None:
    box = ControlBox(panda(), plant(), home(), print)
    for host in ("0.0.0.0", "10.0.0.1", "localhost"):
        with pytest.raises(HardwareError, match="listens on loopback only"):
            Server(box, print, host=host)
    with served() as rig, pytest.raises(HardwareError, match="knows no other port"):
        Server(box, print, host=rig.host)


def test_a_silent_client_makes_room_for_the_next_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(connection, "_PATIENCE", 0.0)
    with served() as rig, client(rig):  # it is silent
        assert serves(rig)
        assert rig.message_with("another client is waiting")
