"""Ask a control box for the robot's URDF, which pylibfranka does not hand out.

The research interface (libfranka-common, ``service_types.h``): requests over TCP, each
with a header of three numbers: command, its count, its size with the header.
"""

import socket
import struct
from time import monotonic, sleep

from hsp_control.common.exceptions import HardwareError

_PORT = 1337
_VERSION = 10  # of the research interface: libfranka 0.18 to 0.21
_CONNECT, _MODEL = 0, 11
_HEADER = struct.Struct("<III")
_TIMEOUT = 10.0
_OTHER_CLIENT = 2.0
_LARGEST = 20_000_000
"""Largest answer that is read [bytes]."""


def robot_urdf(address: str) -> str:
    """Return the URDF of the robot at an address: the arm, without its end effector.

    A box serves one client, and may take a moment to notice that the last one has gone:
    for two seconds this asks again.

    Raises:
        HardwareError: If the control box cannot be reached or does not answer.
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
        except (OSError, struct.error, UnicodeDecodeError) as error:
            raise HardwareError(f"the control box at {address}: {error}") from None


def _received(address: str) -> str:
    with (
        socket.create_connection((address, _PORT), _TIMEOUT) as link,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as states,
    ):
        states.bind(("", 0))
        port = states.getsockname()[1]
        answer = _asked(link, _CONNECT, 0, struct.pack("<HH", _VERSION, port))
        status, version = struct.unpack_from("<BH", answer)
        if status != 0:
            raise HardwareError(
                f"the control box at {address} speaks version {version} of the "
                f"research interface; this is version {_VERSION}"
            )
        answer = _asked(link, _MODEL, 1, b"")
        if answer[:1] != b"\0":
            raise HardwareError(
                f"the control box at {address} does not hand out its model now: "
                "unlock the joints, end other programs"
            )
        return answer[1:].decode()


def _asked(link: socket.socket, command: int, count: int, request: bytes) -> bytes:
    link.sendall(_HEADER.pack(command, count, _HEADER.size + len(request)) + request)
    _, _, size = _HEADER.unpack(_exactly(link, _HEADER.size))
    if not _HEADER.size < size < _LARGEST:
        raise HardwareError(f"the control box announced an answer of {size} bytes")
    return _exactly(link, size - _HEADER.size)


def _exactly(link: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        more = link.recv(size - len(data))
        if not more:
            raise HardwareError("the control box closed the connection")
        data += more
    return data
