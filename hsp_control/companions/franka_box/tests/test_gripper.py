"""The box's gripper answers any request, and no client blocks the next one."""

import socket
import struct
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from hsp_control.companions.franka_box import gripper as module
from hsp_control.companions.franka_box.gripper import PORT, Gripper

HOST = "127.0.0.77"
CONNECT, HOMING, GRASP, MOVE = range(4)
HEADER = struct.Struct("<HII")


@pytest.fixture(scope="module")
def served() -> Iterator[Gripper]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_PATIENCE", 0.2)
        patch.setattr(module, "_PERIOD", 0.001)
        yield Gripper(lambda _: None, HOST)


def client() -> socket.socket:
    made = socket.create_connection((HOST, PORT), timeout=20.0)
    made.settimeout(20.0)
    return made


def asked(made: socket.socket, command: int, payload: bytes) -> int:
    """Return the status of the answer to a request."""
    made.sendall(HEADER.pack(command, 1, HEADER.size + len(payload)) + payload)
    answer = made.recv(HEADER.size, socket.MSG_WAITALL)
    size = HEADER.unpack(answer)[2] - HEADER.size
    return int(struct.unpack_from("<H", made.recv(size, socket.MSG_WAITALL))[0])


@pytest.mark.parametrize("speed", [0.0, -1.0, 1e-9, 1e-300, np.nan, np.inf])
@pytest.mark.parametrize("goal", [0.02, np.nan, -np.inf, -0.1])
def test_no_speed_is_a_failure_and_no_endless_motion(
    served: Gripper, speed: float, goal: float
) -> None:
    with closing(client()) as made:
        assert asked(made, CONNECT, struct.pack("<HH", 3, 0)) == 0
        assert asked(made, MOVE, struct.pack("<2d", goal, speed)) == 2
        grasp = struct.pack("<5d", goal, 0.1, 0.1, speed, 30.0)
        assert asked(made, GRASP, grasp) == 2
        assert asked(made, MOVE, struct.pack("<2d", 0.05, 10.0)) == 0
    assert served.width == 0.05


@pytest.mark.parametrize(
    "sent",
    [b"", b"\0", HEADER.pack(MOVE, 1, HEADER.size + 16) + b"\0", HEADER.pack(9, 1, 10),
     HEADER.pack(MOVE, 1, 4_000_000_000), HEADER.pack(MOVE, 1, 0), bytes(500)],
)  # fmt: skip
def test_silent_or_invalid_clients_make_room(served: Gripper, sent: bytes) -> None:
    with closing(client()) as odd:
        odd.sendall(sent)
        with closing(client()) as made:
            assert asked(made, CONNECT, struct.pack("<HH", 3, 0)) == 0
            assert asked(made, MOVE, struct.pack("<2d", 0.04, 10.0)) == 0
    assert served.is_alive()


def test_who_leaves_during_a_motion_makes_room(served: Gripper) -> None:
    """The full motion would last two minutes."""
    with closing(client()) as first:
        assert asked(first, CONNECT, struct.pack("<HH", 3, 0)) == 0
        assert asked(first, MOVE, struct.pack("<2d", 0.08, 10.0)) == 0
        payload = struct.pack("<2d", 0.0, 1.01e-3)
        first.sendall(HEADER.pack(MOVE, 1, HEADER.size + len(payload)) + payload)
    with closing(client()) as made:
        made.settimeout(60.0)
        assert asked(made, CONNECT, struct.pack("<HH", 3, 0)) == 0
    assert served.width > 0.07


@pytest.mark.parametrize(("thing", "held"), [(0.045, True), (0.055, False)])
def test_a_grasp_holds_what_is_wider_by_less_than_its_outer_tolerance(
    served: Gripper, thing: float, held: bool
) -> None:
    served.thing = thing
    try:
        with closing(client()) as made:
            asked(made, CONNECT, struct.pack("<HH", 3, 0))
            asked(made, MOVE, struct.pack("<2d", 0.08, 10.0))
            grasp = struct.pack("<5d", 0.03, 0.005, 0.02, 10.0, 30.0)
            assert (asked(made, GRASP, grasp) == 0) == held
    finally:
        served.thing = 0.0
