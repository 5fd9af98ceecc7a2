"""The process of a simulated robot: ``python -m hsp_control.cli.simulated_robot``.

It reads its settings from its standard input, one line of JSON. The input then stays
open; when the parent process dies it is closed, and the robot stops itself, completes
its log and ends. It writes two lines to its standard output: ``ready``, and at the end
its report, as JSON.
"""

import json
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hsp_control.cli.live_experiment import simulated_robot
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.config import Experiment, load_experiment
from hsp_control.control.output import ControlOutput
from hsp_control.live.link import Faults, Link
from hsp_control.live.live_log import LiveLog, Row, live_channels
from hsp_control.live.packets import Kind
from hsp_control.live.settings import LiveSettings
from hsp_control.live.simulated_robot import SimulatedRobot
from hsp_control.live.udp import CLOSED_BY_LOOP, serve
from hsp_control.robot import RobotState
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.plants import differing_bodies

READY = "ready"


def main() -> int:
    """Run the robot until it has stopped; return 0, or 2 after one error message."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C stops the loop only
    terminated = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: terminated.set())
    settings = json.loads(sys.stdin.buffer.readline())
    parent_died = threading.Event()
    watch = threading.Thread(
        target=_wait_for_end, args=(sys.stdin.buffer, parent_died), daemon=True
    )
    watch.start()

    def stop_reason() -> str | None:
        if parent_died.is_set():
            return "the process that started the robot has ended"
        return "the robot's process was terminated" if terminated.is_set() else None

    try:
        report = _run(settings, stop_reason)
    except HspControlError as error:
        print(f"hsp: the simulated robot: {error}", file=sys.stderr)
        return 2
    _print(json.dumps(report))
    return 0


def _run(settings: dict[str, Any], stop_reason: Any) -> dict[str, Any]:
    experiment = load_experiment(settings["config"])
    robot = simulated_robot(experiment)
    _warm_up(robot, experiment)
    link = Link(
        settings["session"],
        peer=tuple(settings["peer"]),
        faults=Faults(**settings["faults"]),
        stream=2,
    )
    log = _RobotLog(experiment, robot, settings) if settings["log"] else None
    _print(READY)
    served = serve(
        robot, link, stop_reason=stop_reason, on_row=log.row if log else None
    )
    link.send(Kind.BYE)  # its sequence number tells the loop how many packets it lost
    reason = robot.reason or "no effort arrived"
    report: dict[str, Any] = {
        "phase": robot.phase.name.lower(),
        "reason": reason,
        "t": robot.t,
        "speed": float(np.abs(robot.v).max()),
        "outdated": served.outdated,
        "slipped": served.overrun,
        "link": {**link.counts, "lost": link.lost},
        "injected": link.injected,
    }
    if log is not None:
        status = "completed" if reason == CLOSED_BY_LOOP else "stopped"
        log.log.end(status, reason, robot_process=report)
    link.close()
    return report


class _RobotLog:
    """The robot's own log: its true states, to the end of its safe stop.

    The controller's columns are computed with the configuration's controller: the robot
    does not know the changes that the loop makes while it runs.
    """

    def __init__(
        self, experiment: Experiment, robot: SimulatedRobot, settings: dict[str, Any]
    ) -> None:
        self._controller, self._robot = experiment.controller, robot
        self._every = settings["log_period"]
        self._next, self._phase = -np.inf, robot.phase
        self._state = RobotState(experiment.robot)
        self._excess = LimitExcess(experiment.robot)
        meta = {
            **settings["meta"],
            "plant": {
                **robot.plant.describe(),
                **differing_bodies(robot.plant, experiment.robot),
            },
            "config": settings["config"],
        }
        path = Path(settings["log"])
        self.log = LiveLog(path, experiment.controller, experiment.scene, meta)
        self.log.warm_up(self._row(0.0, robot.q, robot.v))

    def row(self, t: float, q: Array, v: Array, last: bool) -> None:
        """Write the row of a period, if one is due."""
        robot = self._robot
        self._excess.see(self._controller.limits, q, v)
        if t < self._next and robot.phase == self._phase and not last:
            return
        self._next = (np.floor(t / self._every + 1e-6) + 1.0 - 1e-6) * self._every
        self._phase = robot.phase
        self.log.add(self._row(t, q, v))

    def _row(self, t: float, q: Array, v: Array) -> Row:
        robot, state = self._robot, self._state.update(t, q, v)
        output: ControlOutput | None = None
        with suppress(HspControlError):  # then its columns are empty
            output = self._controller.compute(state)
        log_channels = {
            **live_channels(phase=float(robot.phase)),
            **robot.plant.log_channels(t, q, v, robot.tau),
            **self._excess.take(self._controller.limits),
        }
        return Row(state, output, robot.tau, log_channels)


def _warm_up(robot: SimulatedRobot, experiment: Experiment) -> None:
    """Execute each real-time operation once, so that none is compiled later."""
    experiment.controller.compute(0.0, experiment.q0, experiment.v0)
    trial = SimulatedRobot(
        robot.plant,
        robot.q,
        robot.v,
        robot.period,
        settings=LiveSettings(watchdog=1),
        contacts=experiment.controller.contacts,
    )
    trial.advance([robot.tau])
    for _ in range(10):
        trial.advance([])
        trial.measured()
    robot.plant.reset(0.0, robot.q, robot.v)


def _wait_for_end(stream: BinaryIO, ended: threading.Event) -> None:
    # Not stream.read: a thread that holds its lock at exit aborts the interpreter.
    while os.read(stream.fileno(), 4096):
        pass
    ended.set()


def _print(line: str) -> None:
    try:
        print(line, flush=True)
    except BrokenPipeError:  # the parent has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
