"""Control boxes for tests: in a thread, each on its own address, for real clients."""

import itertools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.companions.franka.layouts import COMMAND, PERIOD
from hsp_control.companions.franka_box import Arm, ControlBox, Server
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import IntegratedPlant, RigidBody, SampledPlant

LONGEST = 120.0
"""Time after which a client is killed: libfranka can wait forever [s]."""
PATIENCE = 30.0
"""Time a box waits for a command [s]: test machines may stall."""
PRELUDE = """
import json, sys
import numpy as np, pylibfranka as franka
robot = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)

def damped(state, effort):
    return franka.Torques((effort - 5.0 * np.array(state.dq)).tolist())
"""
"""The common beginning of the tests' clients."""


def command(**fields: Any) -> Any:
    record = np.zeros(1, COMMAND)
    for name, value in fields.items():
        record[name] = value
    return record[0]


@cache
def panda() -> Arm:
    return Arm(Robot.load("panda"))


def home() -> Array:
    return np.array(panda().robot.home())


def plant(**settings: Any) -> SampledPlant:
    """Return a Panda with rotors, and further settings."""
    part = RigidBody(**{"motor_inertia": 0.1, **settings})
    made = part.build(panda().robot, Rk4(PERIOD))
    if isinstance(made, SampledPlant):
        return made
    return IntegratedPlant(made, Rk4(PERIOD))  # type: ignore[arg-type]


class Rig:
    """A box that serves in a thread.

    Attributes:
        server: Its server.
        box: The box.
        host: Its address.
        messages: Its messages.
    """

    def __init__(self, host: str, server: Server, messages: list[str]) -> None:
        self.host, self.server, self.messages = host, server, messages
        self.box = server.box

    def message_with(self, text: str) -> str:
        """Return the only line that contains a text."""
        lines = [line for line in self.messages if text in line]
        assert len(lines) == 1, (text, self.messages)
        return lines[0]

    def run(self, source: str, *, status: int = 0) -> Any:
        """Run a client to its end; return its last line of output, parsed as JSON."""
        client = subprocess.run(
            [sys.executable, "-c", PRELUDE + source, self.host],
            capture_output=True,
            text=True,
            timeout=LONGEST,
        )
        assert client.returncode == status, client.stdout + client.stderr
        return json.loads(client.stdout.splitlines()[-1]) if client.stdout else None


@contextmanager
def served(
    simulated: SampledPlant | None = None, q: Array | None = None, **options: Any
) -> Iterator[Rig]:
    """Serve a box in lockstep in a thread, at a free address."""
    messages: list[str] = []
    start = home() if q is None else q
    box = ControlBox(panda(), simulated or plant(), start, messages.append)
    patient = {"lockstep": True, "patience": PATIENCE, **options}
    with _anywhere(box, messages, patient) as (server, host):
        running = threading.Event()
        running.set()
        thread = threading.Thread(target=server.serve, args=(running.is_set,))
        thread.start()
        try:
            yield Rig(host, server, messages)
        finally:
            running.clear()
            thread.join(LONGEST)
            assert not thread.is_alive()


def addresses() -> Iterator[str]:
    """Yield loopback addresses that are unlikely to be used by other tests."""
    random = np.random.default_rng(os.getpid())
    for _ in itertools.count():
        yield f"127.{random.integers(1, 255)}.{random.integers(256)}.1"


@contextmanager
def _anywhere(
    box: ControlBox, messages: list[str], options: dict[str, Any]
) -> Iterator[tuple[Server, str]]:
    for host in itertools.islice(addresses(), 20):
        try:
            server = Server(box, messages.append, host=host, **options)
        except HardwareError:
            continue
        with server:
            yield server, host
        return
    raise AssertionError("no address is free")
