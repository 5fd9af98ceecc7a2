"""Request the robot's URDF from a control box, which pylibfranka cannot."""

import socket
from time import monotonic, sleep

import numpy as np

from hsp_control.common.errors import HardwareError
from hsp_control.companions.franka.layouts import (
    CONNECTED,
    HEADER,
    PORT,
    REQUESTS,
    VERSION,
    FrankaCommand,
    FrankaStatus,
    message,
)

_TIMEOUT = 10.0
_OTHER_CLIENT = 2.0
_LARGEST = 20_000_000
"""Largest answer that is read [bytes]."""


def robot_urdf(address: str) -> str:
    """Return the URDF of the robot at an address: the arm, without its end effector.

    A box serves one client, and may notice late that the last one has disconnected: the
    request is repeated for two seconds.
    """
    end = monotonic() + _OTHER_CLIENT
    while True:
        try:
            return _received(address)
        except ConnectionResetError as error:
            if monotonic() > end:
                raise HardwareError(
                    f"the control box at {address} serves another client: {error}"
                ) from None
            sleep(0.1)
        except (OSError, UnicodeDecodeError) as error:
            raise HardwareError(f"the control box at {address}: {error}") from None


def _received(address: str) -> str:
    with (
        socket.create_connection((address, PORT), _TIMEOUT) as link,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as states,
    ):
        states.bind(("", 0))
        port = states.getsockname()[1]
        hello = np.array((VERSION, port), REQUESTS[FrankaCommand.CONNECT]).tobytes()
        answer = _asked(link, FrankaCommand.CONNECT, 0, hello)
        if len(answer) < CONNECTED.itemsize:
            raise HardwareError(
                f"the control box at {address} answered with {len(answer)} bytes; "
                f"needs {CONNECTED.itemsize}"
            )
        status, version = np.frombuffer(answer, CONNECTED, 1)[0]
        if status != FrankaStatus.SUCCESS:
            raise HardwareError(
                f"the control box at {address} speaks version {version} of the "
                f"research interface; this is version {VERSION}"
            )
        answer = _asked(link, FrankaCommand.GET_ROBOT_MODEL, 1, b"")
        if answer[0] != FrankaStatus.SUCCESS:
            raise HardwareError(
                f"the control box at {address} does not hand out its model now: "
                "unlock the joints, end other programs"
            )
        return answer[1:].decode()


def _asked(link: socket.socket, command: int, count: int, request: bytes) -> bytes:
    link.sendall(message(command, count, request))
    size = int(np.frombuffer(_exactly(link, HEADER.itemsize), HEADER)[0]["size"])
    if not HEADER.itemsize < size < _LARGEST:
        raise HardwareError(f"the control box announced an answer of {size} bytes")
    return _exactly(link, size - HEADER.itemsize)


def _exactly(link: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        more = link.recv(size - len(data))
        if not more:
            raise HardwareError("the control box closed the connection")
        data += more
    return data
