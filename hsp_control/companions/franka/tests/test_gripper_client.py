"""The gripper's process reads datagrams of commands; no gripper is connected."""

import json
import socket
import threading
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest

from hsp_control.companions.franka import client
from hsp_control.companions.franka.client import GripperClient

SENDER = ("127.0.0.1", 5)


def gripper() -> GripperClient:
    made = GripperClient.__new__(GripperClient)
    made.sender, made.last_time = ("", 0), -10.0
    return made


@pytest.mark.parametrize(
    ("message", "opening"),
    [({}, 0.01), ({"value": [0.02]}, 0.02), ({"value": [0]}, 0.0),
     ({"values": [[0.01], [0.03]]}, 0.03)],
)  # fmt: skip
def test_an_opening_is_read(message: Any, opening: float) -> None:
    assert gripper().read(message, SENDER, 0.01) == opening


@pytest.mark.parametrize(
    "message",
    [[], None, 1, "x", {"value": "0.02"}, {"value": 0.02}, {"value": []},
     {"value": [True]}, {"value": [None]}, {"value": ["0"]}, {"value": [0.02, 5.0]},
     {"value": [-0.01]}, {"value": [2.0]}, {"value": [float("nan")]},
     {"value": {"0": 0.02}}, {"values": []}, {"values": "12"}, {"values": {}}],
    ids=repr,
)  # fmt: skip
def test_nothing_else_moves_the_fingers(message: Any) -> None:
    """Nor keeps another sender's from it.

    Text was parsed by its first letter: "0.02" closed the gripper.
    """
    made, other = gripper(), ("127.0.0.1", 6)
    with pytest.raises(ValueError, match="need"):
        made.read(message, SENDER, 0.01)
    assert made.read({"value": [0.02]}, other, 0.01) == 0.02


class Closed:
    """A standard output that nobody reads."""

    encoding = "ascii"

    def write(self, text: str) -> int:
        text.encode("ascii")
        raise BrokenPipeError

    def flush(self) -> None:
        raise BrokenPipeError


@pytest.mark.parametrize("closed", [True, False])
def test_what_cannot_be_printed_does_not_end_it(
    closed: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made = gripper()
    made.last_line = ""
    if closed:
        monkeypatch.setattr("sys.stdout", Closed())
    made.say("\ud800 é")
    assert made.last_line
    if not closed:
        assert capsys.readouterr().out == "The gripper: \\ud800 \\xe9\n"


def test_its_returned_answers_are_no_commands() -> None:
    """A policy that echoes messages: they answered each other forever."""
    made, openings = gripper(), []
    state = SimpleNamespace(width=0.03, is_grasped=True)
    made.gripper = SimpleNamespace(
        grasp=lambda width, *_: openings.append(width),
        move=lambda width, _: openings.append(width),
        read_once=lambda: state,
    )
    made.opening, made.last_line, made.last_beat = 0.0, "", -10.0
    loop, link = socket.socketpair()
    with (
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as made.inbox,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as policy,
        closing(link),
    ):
        made.inbox.bind(("127.0.0.1", 0))
        policy.settimeout(20.0)
        serving = threading.Thread(target=made.serve, args=(link,))
        serving.start()

        def reported(message: Any) -> bytes:
            policy.sendto(json.dumps(message).encode(), made.inbox.getsockname())
            return policy.recv(999)

        answer = reported({"value": [0.04]})
        for _ in range(3):
            policy.sendto(answer, made.inbox.getsockname())
        assert reported({}) == answer
        policy.settimeout(0.0)
        with pytest.raises(BlockingIOError):  # none of the three was answered
            policy.recv(999)
        loop.close()
        serving.join(20.0)
    assert openings == [0.08]


def test_the_gripper_s_process_sends_heartbeats(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also under a flood of datagrams, and without waiting for a listener."""
    now = 0.0
    monkeypatch.setattr(client, "monotonic", lambda: now)
    made = gripper()
    made.last_beat = -10.0
    loop, link = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with closing(loop), closing(link):
        for now in (0.0, 0.1, 0.4, 0.5, 0.9, 1.1):  # noqa: B007 (its clock)
            made.beat(link)
        output = [loop.recv(9, socket.MSG_DONTWAIT) for _ in range(3)]
        assert output == 3 * [client.ALIVE]
        with pytest.raises(BlockingIOError):
            loop.recv(9, socket.MSG_DONTWAIT)
        for k in range(2000):  # more than fits
            now = 2.0 + k
            made.beat(link)
