"""A Franka Hand with libfranka's interface: its fingers open, close and grasp.

Transcribed from libfranka-common (Apache-2.0, Franka Robotics),
``research_interface/gripper/types.h``.
"""

import socket
import struct
import time
from contextlib import suppress
from math import isfinite
from select import select
from threading import Thread

from hsp_control.companions.franka_box.box import Say
from hsp_control.companions.franka_box.server import listen

PORT = 1338
"""The TCP port that libfranka connects to; it has no option for another one."""
WIDEST = 0.08
"""Maximum opening of the fingers [m]."""
_PERIOD = 0.02
"""Time between two states [s]."""
_HEADER, _STATE = struct.Struct("<HII"), struct.Struct("<IddBH")
_CONNECT, _HOMING, _GRASP, _MOVE, _STOP = range(5)
_NUMBERS = {_CONNECT: "<HH", _HOMING: "<", _GRASP: "<5d", _MOVE: "<2d", _STOP: "<"}
_LARGEST = 256
"""Maximum size of a request [bytes]."""
_PATIENCE = 2.0
"""Maximum silence of a client within a request, and before its first [s]."""
_SLOWEST = 1e-3
"""Minimum speed of a motion [m/s]; a slower one could take hours."""
_FAILED = 2
"""The status of a failed motion; that of success is 0."""


class Gripper(Thread):
    """Serves one client after another, in real time and beside the arm.

    Attributes:
        width: Its opening [m].
        thing: Width of the object between the fingers [m]; 0: none.
        grasped: Whether the object is grasped.
    """

    def __init__(self, say: Say, host: str = "127.0.0.1") -> None:
        """Listen; raises a HardwareError where it cannot."""
        super().__init__(name="gripper", daemon=True)
        self.width, self.thing, self.grasped = WIDEST, 0.0, False
        self._say, self._count, self._peer = say, 0, ("", 0)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._listener = listen(host, PORT)
        self.start()

    def run(self) -> None:
        """Serve until the process ends."""
        while True:
            try:
                tcp, self._peer = self._listener.accept()[0], ("", 0)
            except OSError:  # the client has left, or there are too many files
                time.sleep(_PERIOD)
                continue
            tcp.settimeout(_PATIENCE)
            with tcp, suppress(OSError, struct.error, KeyError, ValueError):
                self._serve(tcp)

    def _serve(self, tcp: socket.socket) -> None:
        """Answer requests until one cannot be read."""
        begun = time.monotonic()
        while True:
            if not select([tcp], [], [], _PERIOD)[0]:
                if not self._peer[1] and time.monotonic() - begun > _PATIENCE:
                    return  # other clients wait
                self._tell()
                continue
            header = tcp.recv(_HEADER.size, socket.MSG_WAITALL)
            command, number, size = _HEADER.unpack(header)
            if not _HEADER.size <= size <= _LARGEST:
                raise ValueError(f"a request of {size} bytes")
            payload = tcp.recv(size - _HEADER.size, socket.MSG_WAITALL)
            given = struct.unpack(_NUMBERS[command], payload)
            if command == _CONNECT:  # the client's version is ours
                self._peer = tcp.getpeername()[0], given[1]
                answer = struct.pack("<HH", 0, given[0])
            else:
                answer = struct.pack(
                    "<H", 0 if self._obey(tcp, command, given) else _FAILED
                )
            size = _HEADER.size + len(answer)
            tcp.sendall(_HEADER.pack(command, number, size) + answer)

    def _obey(self, tcp: socket.socket, command: int, given: tuple[float, ...]) -> bool:
        """Move, and return whether the motion succeeded.

        Raises:
            ConnectionError: If the client leaves meanwhile: the fingers stop.
        """
        if command == _STOP:
            return True
        goal, speed = (WIDEST, 0.05) if command == _HOMING else (given[0], given[1])
        if command == _GRASP:
            goal, inner, outer, speed, force = given
        if not (
            isfinite(goal) and isfinite(speed) and speed >= _SLOWEST and goal >= 0.0
        ):
            self._say(f"the gripper cannot go to {goal:g} m at {speed:g} m/s")
            return False
        does = f"grasps with {force:g} N" if command == _GRASP else "goes"
        self._say(f"the gripper {does} to {1e3 * goal:.0f} mm")
        end = min(max(goal, self.thing if goal < self.width else 0.0), WIDEST)
        self.grasped = False
        while self.width != end:
            most = speed * _PERIOD
            self.width += min(max(end - self.width, -most), most)
            self._tell()
            time.sleep(_PERIOD)
            if select([tcp], [], [], 0.0)[0] and not tcp.recv(1, socket.MSG_PEEK):
                raise ConnectionError("the client has closed the connection")
        if command != _GRASP:
            return end == goal
        self.grasped = end == self.thing and goal - inner < end < goal + outer
        return self.grasped

    def _tell(self) -> None:
        """Send a state to the registered address; it may be lost."""
        self._count += 1
        state = _STATE.pack(self._count, self.width, WIDEST, self.grasped, 30)
        if self._peer[1]:
            self._udp.sendto(state, self._peer)
