"""Loops of hsp_control in its own environment; the tests run in LeRobot's."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from hsp_datagrams import Loop

PLUGIN = Path(__file__).resolve().parents[1]
ROOT = PLUGIN.parents[1]
HSP = os.environ.get("HSP", str(ROOT / ".venv/bin/hsp"))
PATIENT = {  # a machine that runs tests is late
    "live.missing": 2000,
    "live.age": 10,
    "live.watchdog": 2000,
    "live.velocity_margin": 2,
    "simulation.control_period": 0.005,
    "simulation.integrator.step": 0.005,
    "tasks.hand.gains.natural_frequency": 4,
    "tasks.fingers.gains.natural_frequency": 4,
    "null_space.gain": 2,
}


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Running(NamedTuple):
    """A loop that runs: its process, its addresses and its log."""

    process: subprocess.Popen
    states: str
    targets: str
    gripper: str
    log: Path

    def stop(self) -> Path:
        """End it as Ctrl-C does, and return its log."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(120.0) == 0
        return self.log


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """The simulated Panda of panda.yaml, which runs until it is stopped."""
    out = tmp_path_factory.mktemp("out")
    states, targets, gripper = (f"127.0.0.1:{free_port()}" for _ in range(3))
    given = {
        **PATIENT,
        "tasks.hand.trajectory.source": f"udp://{targets}",
        "tasks.fingers.displacement.source": f"udp://{gripper}",
    }
    command = [HSP, "live", str(PLUGIN / "panda.yaml"), "--duration", "inf"]
    command += ["--out", str(out), "--publish", f"udp://{states}"]
    for key, value in given.items():
        command += ["--set", f"{key}={value}"]
    process = subprocess.Popen(command)
    loop = Loop(states, timeout=300.0)
    try:
        loop.state()
        loop.close()
        yield Running(process, states, targets, gripper, out / "panda-live.npz")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(120.0)


@pytest.fixture
def leader() -> Iterator[str]:
    """Something that tells where it is, on a circle; returns the address."""
    address = f"127.0.0.1:{free_port()}"
    where = ["0.3069", "0", "0.4869"]  # where the hand of panda.yaml starts
    script = str(PLUGIN / "tests/leader.py")
    process = subprocess.Popen([sys.executable, script, address, *where])
    yield address
    process.kill()
    process.wait()
