"""Loops of hsp_control in its own environment; the tests run in LeRobot's."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
from hsp_datagrams import Loop

PLUGIN = Path(__file__).resolve().parents[1]
ROOT = PLUGIN.parents[1]
HSP = os.environ.get("HSP", str(ROOT / ".venv/bin/hsp"))
GENTLE = {
    "simulation.control_period": 0.005,
    "null_space.gain": 2,
    "tasks.hand.gains.natural_frequency": 4,
    "tasks.fingers.gains.natural_frequency": 4,
}
LOOPS = {  # a configuration, its overrides, and options
    "simulated": (
        PLUGIN / "panda.yaml",
        {**GENTLE, "simulation.integrator.step": 0.005},
        ["--lockstep"],
    ),
    "seen": (PLUGIN / "scene.yaml", GENTLE, ["--lockstep"]),
    "franka": (
        ROOT / "examples/stream/panda.yaml",
        {},
        [
            "--robot",
            "franka://127.0.0.2?realtime=ignore&lockstep=true&gripper=udp://{gripper}",
        ],
    ),
}


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Running(NamedTuple):
    """A running loop: its process, addresses and log."""

    process: subprocess.Popen
    states: str
    targets: str
    gripper: str
    cameras: str
    log: Path

    def stop(self) -> Path:
        """End it like Ctrl-C, and return its log."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(120.0) == 0
        return self.log


@contextmanager
def run_live(kind: str, out: Path) -> Iterator[Running]:
    """Run one of `LOOPS` until it is stopped."""
    config, given, options = LOOPS[kind]
    states, targets, gripper, pictures = (f"127.0.0.1:{free_port()}" for _ in range(4))
    given = {**given, "tasks.hand.trajectory.source": f"udp://{targets}"}
    if kind != "franka":
        given["tasks.fingers.displacement.source"] = f"udp://{gripper}"
    command = [HSP, "live", str(config), "--duration", "inf", "--out", str(out)]
    command += [option.format(gripper=gripper) for option in options]
    command += ["--publish", f"udp://{states}"]
    cameras = f"http://{pictures}"
    if kind == "seen":
        command += ["--cameras", cameras]
    for key, value in given.items():
        command += ["--set", f"{key}={value}"]
    process = subprocess.Popen(command)
    loop = Loop(states, timeout=300.0)
    try:
        loop.state()
        loop.close()
        log = out / f"{config.stem}-live.npz"
        yield Running(process, states, targets, gripper, cameras, log)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(120.0)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """The simulated Panda of panda.yaml."""
    with run_live("simulated", tmp_path_factory.mktemp("out")) as running:
        yield running


@pytest.fixture
def seen(tmp_path: Path) -> Iterator[Running]:
    """The simulated Panda of scene.yaml, with cameras."""
    with run_live("seen", tmp_path) as running:
        yield running


@pytest.fixture
def franka(tmp_path: Path) -> Iterator[Running]:
    """A Franka, by its emulated control box."""
    command = [HSP, "franka-box", "panda", "--lockstep", "--patience", "60"]
    command += ["--host", "127.0.0.2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as box:
        assert box.stdout is not None
        assert "in lockstep" in box.stdout.readline()
        try:
            with run_live("franka", tmp_path) as running:
                yield running
        finally:
            box.send_signal(signal.SIGINT)


@pytest.fixture
def leader() -> Iterator[str]:
    """A sender of poses on a circle; returns the address."""
    address = f"127.0.0.1:{free_port()}"
    where = ["0.3069", "0", "0.4869"]  # the hand's start
    script = str(PLUGIN / "tests/leader.py")
    process = subprocess.Popen([sys.executable, script, address, *where])
    yield address
    process.kill()
    process.wait()
