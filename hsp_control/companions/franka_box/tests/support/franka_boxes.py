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
from hsp_control.common.exceptions import HardwareError
from hsp_control.companions.franka.layouts import COMMAND, PERIOD
from hsp_control.companions.franka_box import Arm, ControlBox, Server
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import IntegratedPlant, RigidBody, SampledPlant

LONGEST = 120.0
"""Time after which a client is killed: libfranka can wait for ever [s]."""
PATIENCE = 30.0
"""How long a box waits for a command [s]: machines that run tests may stall."""
PRELUDE = """
import json, sys
import numpy as np, pylibfranka as franka
robot = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)

def damped(state, effort):
    return franka.Torques((effort - 5.0 * np.array(state.dq)).tolist())
"""
"""The beginning of the clients of these tests."""


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
        said: Its messages.
    """

    def __init__(self, host: str, server: Server, said: list[str]) -> None:
        self.host, self.server, self.said = host, server, said
        self.box = server.box

    def tells(self, text: str) -> str:
        """Return the only line that contains a text."""
        lines = [line for line in self.said if text in line]
        assert len(lines) == 1, (text, self.said)
        return lines[0]

    def run(self, source: str, *, status: int = 0) -> Any:
        """Run a client to its end; return what it prints last, as JSON."""
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
    """Serve a box in lockstep, in a thread, at an address that is free."""
    said: list[str] = []
    start = home() if q is None else q
    box = ControlBox(panda(), simulated or plant(), start, said.append)
    patient = {"lockstep": True, "patience": PATIENCE, **options}
    with _anywhere(box, said, patient) as (server, host):
        running = threading.Event()
        running.set()
        thread = threading.Thread(target=server.serve, args=(running.is_set,))
        thread.start()
        try:
            yield Rig(host, server, said)
        finally:
            running.clear()
            thread.join(LONGEST)
            assert not thread.is_alive()


def addresses() -> Iterator[str]:
    """Yield loopback addresses that other tests hardly use at the same time."""
    random = np.random.default_rng(os.getpid())
    for _ in itertools.count():
        yield f"127.{random.integers(1, 255)}.{random.integers(256)}.1"


@contextmanager
def _anywhere(
    box: ControlBox, said: list[str], options: dict[str, Any]
) -> Iterator[tuple[Server, str]]:
    for host in itertools.islice(addresses(), 20):
        try:
            server = Server(box, said.append, host=host, **options)
        except HardwareError:
            continue
        with server:
            yield server, host
        return
    raise AssertionError("no address is free")
