"""The loop's end of the process that talks to the arm: requests, and waiting."""

import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from select import select
from time import monotonic
from typing import Any

from hsp_control.common.errors import HardwareError
from hsp_control.common.silence import Silence
from hsp_control.companions.franka import client
from hsp_control.companions.franka.reflexes import explained

INSTALL = "pip install 'hsp_control[franka]'"
_AT_ONCE = 10
"""Maximum number of its messages that are read in a period."""
_HANGS = 5.0
"""Silence after which a process is treated as hanging [s]: a motion of the fingers,
during which it is silent, takes less than two."""


class ClientProcess:
    """Runs `client` in a separate process, which always ends.

    At most one request is pending. The process has its own session, so that Ctrl-C
    in a terminal reaches the loop only; if the loop's process dies, it ends, too.

    Attributes:
        waiting: Whether a request is pending.
        fault: The last message of the process that ends the connection, or None.
    """

    def __init__(self) -> None:
        """Start the process."""
        if importlib.util.find_spec("pylibfranka") is None:
            raise HardwareError(f"a Franka arm needs pylibfranka: {INSTALL}")
        self._link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed with it)
        self._process = subprocess.Popen(
            [sys.executable, "-P", client.__file__, str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            stderr=self._errors,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )
        theirs.close()
        self._silence = Silence(monotonic())
        self.waiting = False
        self.fault: str | None = None

    def ask(self, message: bytes) -> None:
        """Send a request."""
        if self.fault is None:
            try:
                self._link.send(message)
            except OSError:
                self.fault = self._ended()
        if self.fault is not None:
            raise HardwareError(self.fault)
        self.waiting = True

    def receive(self, timeout: float) -> bytes | None:
        """Return the answer to the request; None if it does not arrive in time [s]."""
        if self.fault is None:
            if not select([self._link], [], [], timeout)[0]:
                return None
            try:
                answer = self._link.recv(client.LONGEST)
            except OSError:
                answer = b""
            self.waiting = False
            if not answer:
                self.fault = self._ended()
            elif answer[:1] == client.ERROR:
                self.fault = explained(**json.loads(answer[1:]))
            else:
                return answer
        raise HardwareError(self.fault)

    def asked(self, message: bytes, timeout: float) -> Any:
        """Send a request and return the text that answers it, from JSON."""
        self.ask(message)
        answer = self.receive(timeout)
        if answer is None:
            self.fault = f"the control box did not answer for {timeout:g} s"
            raise HardwareError(self.fault)
        return json.loads(answer[1:])

    def close(self) -> None:
        """End the process, without waiting for an answer."""
        self._link.close()
        try:
            if self.waiting:
                self._process.kill()
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            pass
        finally:  # also if Ctrl-C interrupts the wait
            self._process.kill()
            self._process.wait()
            self._errors.close()

    def trouble(self) -> str:
        """Return why the process fails, "" if it runs.

        Without requests it reports periodically that it is alive.
        """
        received = False
        for _ in range(_AT_ONCE):
            if not select([self._link], [], [], 0.0)[0]:
                break
            try:
                said = self._link.recv(client.LONGEST)
            except OSError:
                said = b""
            if not said:
                return "has ended"
            received = True
        hangs = self._silence.look(monotonic(), received=received) > _HANGS
        return f"has sent nothing for {_HANGS:g} s" if hangs else ""

    def _ended(self) -> str:
        """Return how the process ended, and the last line that it wrote."""
        try:
            status = self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            return "the process that talks to the robot closed its connection"
        how = f"status {status}" if status >= 0 else signal.Signals(-status).name
        size = os.fstat(self._errors.fileno()).st_size
        self._errors.seek(max(size - 2000, 0))
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        last = f": {lines[-1]}" if lines else ""
        return f"the process that talks to the robot ended ({how}){last}"
