"""The process of a simulated robot: ``python -m hsp_control.cli.simulated_robot``.

Its settings come as one line of JSON through its standard input, which then stays open:
when it ends, for whatever reason its parent died, the robot stops itself, writes its
log to the end and is gone. Two lines go to its standard output: ``ready``, and at the
end what it counted, as JSON.
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

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.config import Experiment, load_experiment
from hsp_control.config.build_live import watched_robot
from hsp_control.control.controller import ControlOutput
from hsp_control.live.faults import Faults
from hsp_control.live.link import Link
from hsp_control.live.live_log import LiveLog, Row, live_channels
from hsp_control.live.packets import Kind
from hsp_control.live.settings import StopSettings
from hsp_control.live.udp_robot import BYE, serve
from hsp_control.live.watched_robot import WatchedRobot
from hsp_control.robot import RobotState
from hsp_control.simulation.plants import differing_bodies

READY = "ready"


def main() -> int:
    """Live a robot's life; return 0, or 2 after one message."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the operator's, for the loop alone
    ending = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ending.set())
    settings = json.loads(sys.stdin.buffer.readline())
    lifeline = threading.Event()
    watch = threading.Thread(
        target=_wait_for_end, args=(sys.stdin.buffer, lifeline), daemon=True
    )
    watch.start()

    def orphaned() -> str | None:
        if lifeline.is_set():
            return "the process that started the robot is gone"
        return "the robot's process was told to end" if ending.is_set() else None

    try:
        told = _live(settings, orphaned)
    except HspControlError as error:
        print(f"hsp: the simulated robot: {error}", file=sys.stderr)
        return 2
    _say(json.dumps(told))
    return 0


def _live(settings: dict[str, Any], orphaned: Any) -> dict[str, Any]:
    experiment = load_experiment(settings["config"])
    robot = watched_robot(experiment)
    _rehearse(robot, experiment)
    link = Link(
        settings["session"],
        peer=tuple(settings["peer"]),
        faults=Faults(**settings["faults"]),
        stream=2,
    )
    journal = _Truth(experiment, robot, settings) if settings["log"] else None
    _say(READY)
    served = serve(
        robot, link, orphaned=orphaned, on_row=journal.row if journal else None
    )
    link.send(Kind.BYE)  # by its number the loop knows what it never had
    reason = robot.reason or "no effort ever came"
    told: dict[str, Any] = {
        "phase": robot.phase.name.lower(),
        "reason": reason,
        "t": robot.t,
        "speed": float(np.abs(robot.v).max()),
        "outdated": served.outdated,
        "slipped": served.slipped,
        "link": {**link.counts, "lost": link.lost},
        "injected": link.injected,
    }
    if journal is not None:
        asked = reason == BYE
        status = "completed" if asked else "stopped"
        journal.log.end(status, reason, robot_process=told)
    link.close()
    return told


class _Truth:
    """The robot's own log: its true states, and the safe stop to its end.

    What the law would make of them is what the configuration's would: the robot knows
    nothing of changes that the loop makes while it runs.
    """

    def __init__(
        self, experiment: Experiment, robot: WatchedRobot, settings: dict[str, Any]
    ) -> None:
        self._controller, self._robot = experiment.controller, robot
        self._every = settings["log_period"]
        self._next, self._phase = -np.inf, robot.phase
        self._state = RobotState(experiment.robot)
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
        self.log.rehearse(self._row(0.0, robot.q, robot.v))

    def row(self, t: float, q: Array, v: Array, last: bool) -> None:
        """Write the row of a period, if it is time for one."""
        robot = self._robot
        if t < self._next and robot.phase == self._phase and not last:
            return
        self._next = (np.floor(t / self._every + 1e-6) + 1.0 - 1e-6) * self._every
        self._phase = robot.phase
        self.log.add(self._row(t, q, v))

    def _row(self, t: float, q: Array, v: Array) -> Row:
        robot, state = self._robot, self._state.update(t, q, v)
        output: ControlOutput | None = None
        with suppress(HspControlError):  # where the law has no answer, the robot has
            output = self._controller.compute(state)
        log_channels = {
            **live_channels(phase=float(robot.phase)),
            **robot.plant.log_channels(t, q, v, robot.tau),
        }
        return Row(state, output, robot.tau, log_channels)


def _rehearse(robot: WatchedRobot, experiment: Experiment) -> None:
    """Do once what will be done on the clock: nothing is then compiled there."""
    experiment.controller.compute(
        experiment.robot.state(0.0, experiment.q0, experiment.v0)
    )
    trial = WatchedRobot(
        robot.plant, robot.q, robot.v, robot.period, watchdog=1, stop=StopSettings()
    )
    trial.advance([robot.tau])
    for _ in range(10):
        trial.advance([])
        trial.measure()
    robot.plant.reset(0.0, robot.q, robot.v)


def _wait_for_end(stream: BinaryIO, ended: threading.Event) -> None:
    # Not stream.read: a thread that holds its lock at exit would end the interpreter.
    while os.read(stream.fileno(), 4096):
        pass
    ended.set()


def _say(line: str) -> None:
    try:
        print(line, flush=True)
    except BrokenPipeError:  # nobody is left to be told
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
