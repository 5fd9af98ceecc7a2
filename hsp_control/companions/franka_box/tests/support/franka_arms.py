"""Franka arms for tests: behind a control box in lockstep, in a thread."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import sleep
from typing import Any

from hsp_control import load_experiment
from hsp_control.companions.franka.layouts import PERIOD
from hsp_control.companions.franka_box import Arm, ControlBox, Server
from hsp_control.config import Experiment
from hsp_control.live.simulated_robot import sampled

LOOPBACK = "realtime=ignore&lockstep=true"
"""The query part of the address of a box in lockstep."""


def host(number: int = 0) -> str:
    """Return a loopback address that no other test process uses."""
    high, low = divmod(os.getpid() % 16384, 128)
    return f"127.{10 + number}.{high}.{low + 1}"


def circle(**changes: Any) -> Experiment:
    """Return a Panda that draws a circle while a posture field moves its elbow."""
    document: dict[str, Any] = {
        "robot": {"name": "panda"},
        "tasks": {
            "hand": {
                "type": "frame_pose",
                "trajectory": {
                    "type": "composed",
                    "position": {
                        "type": "circle",
                        "origin": "start",
                        "center": [0, 0, 0],
                        "radius": 0.1,
                        "angular_rate": 2.0,
                        "normal": [0, 0, 1],
                    },
                },
                "gains": {"natural_frequency": 10.0},
                "blend": 0.5,
            }
        },
        "null_space": {
            "gain": 8.0,
            "fields": [{"type": "target_posture", "target": "home", "weight": 2.0}],
        },
        "start": {"joints": {"panda_joint1": 0.3, "panda_joint3": -0.3}},
        "simulation": {
            "duration": 1.0,
            "control_period": PERIOD,
            "integrator": {"type": "rk4", "step": PERIOD},
        },
    }
    return load_experiment(document | changes)


class RunningBox:
    """A box that serves from a thread.

    Attributes:
        host: Its address.
        lines: Its messages.
    """

    def __init__(self, host: str) -> None:
        self.host = host
        self.lines: list[str] = []

    @property
    def address(self) -> str:
        """The address after ``franka://``."""
        return f"{self.host}?{LOOPBACK}"

    def wait_alone(self) -> None:
        """Wait until it has detected that its clients have left."""
        for _ in range(6000):
            ended = sum(" is disconnected: " in line for line in self.lines)
            if self._begun() == ended:
                return
            sleep(0.01)
        raise AssertionError(f"a client stays: {self.lines}")

    def _begun(self) -> int:
        connected = [line for line in self.lines if line.endswith("is connected")]
        return sum(not line.startswith("refused") for line in connected)

    def reported(self, *words: str) -> bool:
        """Return whether a line contains all words."""
        return any(all(word in line for word in words) for line in self.lines)


@contextmanager
def serving(
    experiment: Experiment, number: int = 0, **options: Any
) -> Iterator[RunningBox]:
    """Serve an experiment's plant in lockstep; options are the `Server`'s.

    A gripper keeps its address, so a box next to another gripper has another number.
    """
    running, ended = RunningBox(host(number)), threading.Event()
    plant = sampled(experiment.plant, experiment.integrator, PERIOD)
    box = ControlBox(Arm(experiment.robot), plant, experiment.q0, running.lines.append)
    server = Server(
        box,
        running.lines.append,
        host=running.host,
        lockstep=True,
        patience=60.0,
        **options,
    )

    def serve() -> None:
        with server:
            server.serve(lambda: not ended.is_set())

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield running
    finally:
        ended.set()
        thread.join(60.0)
        assert not thread.is_alive(), "the box does not end"
