"""The server and clients that speak badly: one line each, and the box goes on."""

import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
import pytest
from franka_boxes import Rig, home, panda, plant, served

from hsp_control.common.exceptions import HardwareError
from hsp_control.franka_box import PORT, Box, Server
from hsp_control.franka_box.wire import COMMAND, HEADER, STATE, Command, response

LONGEST = 30.0


class RawClient:
    """A client that can say anything."""

    def __init__(self, rig: Rig) -> None:
        self.tcp = socket.create_connection((rig.host, PORT), LONGEST)
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.settimeout(LONGEST)
        self.udp.bind(("127.0.0.1", 0))
        self.box: Any = None

    def ask(self, command: int, payload: bytes = b"", number: int = 1) -> bytes:
        """Send a request, and return the response's payload; b"" at an end."""
        self.tcp.sendall(response(command, number, payload))
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
        return self.ask(Command.CONNECT, struct.pack("<HH", version, port))

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
    """Return whether the next client is served: it gets a state."""
    with client(rig) as good:
        return good.connect() == b"\0\x0a\0" and int(good.state()["message_id"]) > 0


def test_another_version_is_told_ours() -> None:
    with served() as rig:
        with client(rig) as old:
            assert old.connect(version=9) == b"\1\x0a\0"
            assert old.answer() == b""
        assert serves(rig)
        line = rig.tells("version 9")
        assert line.endswith("this box speaks 10, as libfranka 0.18 to 0.21 do")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (struct.pack("<III", 99, 1, 12), "command 99 does not exist"),
        (struct.pack("<III", 1, 1, 12), "move of 12 bytes; it has 125"),
        (struct.pack("<III", 2, 1, 5), "stop_move of 5 bytes; it has 12"),
        (struct.pack("<III", 2, 1, 2**32 - 1), "4294967295 bytes; it has 12"),
        (b"GET / HTTP/1.1\r\nHost: box\r\n\r\n", "does not exist"),
        (struct.pack("<IIIHH", 0, 1, 16, 10, 1), "where the first request is over"),
    ],
)
def test_a_malformed_request_ends_the_connection(data: bytes, said: str) -> None:
    with served() as rig:
        with client(rig) as bad:
            assert bad.connect()
            bad.tcp.sendall(data)
            assert bad.answer() == b""
        assert serves(rig)
        assert "is disconnected: " in rig.tells(said)


def test_whoever_does_not_connect_first_is_sent_away() -> None:
    with served() as rig:
        with client(rig) as rude:
            assert rude.ask(Command.GET_ROBOT_MODEL) == b""
        assert serves(rig)
        assert rig.tells("get_robot_model where the first request has to be connect")


def test_a_request_in_pieces_is_whole() -> None:
    with served() as rig, client(rig) as slow:
        assert slow.connect()
        for byte in response(Command.GET_ROBOT_MODEL, 7, b""):
            slow.tcp.sendall(bytes([byte]))
        answer = slow.answer()
        assert answer == b"\0" + rig.box.arm.urdf.encode()


def test_datagrams_that_are_no_commands_are_ignored() -> None:
    """Torn, foreign and outdated ones; the right one moves the arm."""
    with served(patience=LONGEST) as rig, client(rig) as noisy:
        assert noisy.connect()
        noisy.state()
        move = struct.pack("<II", 2, 4).ljust(113, b"\0")
        assert noisy.ask(Command.MOVE, move) == b"\1"
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
        for _ in range(3):
            state = noisy.state()
            good["message_id"] = state["message_id"]
            noisy.udp.sendto(good.tobytes(), noisy.box)
        noisy.state()
        assert rig.server.client is not None
        assert rig.server.client.malformed == 3
        assert rig.server.client.outdated >= 1
        assert rig.tells("that is no command")


def test_random_bytes_never_stop_the_box() -> None:
    random = np.random.default_rng(11)
    with served() as rig:
        for length in random.integers(1, 600, 40):
            with client(rig) as mad:
                if length % 2:
                    mad.connect()
                with suppress(OSError):  # the box may have had enough by then
                    mad.tcp.sendall(random.bytes(int(length)))
                    mad.tcp.shutdown(socket.SHUT_WR)
                while mad.answer():
                    pass
        assert serves(rig)


def test_addresses_beyond_loopback_and_taken_ones_are_refused() -> None:
    box = Box(panda(), plant(), home(), print)
    for host in ("0.0.0.0", "10.0.0.1", "localhost"):
        with pytest.raises(HardwareError, match="listens on loopback only"):
            Server(box, print, host=host)
    with served() as rig, pytest.raises(HardwareError, match="knows no other port"):
        Server(box, print, host=rig.host)
