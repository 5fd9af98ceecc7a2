"""Run a simulated robot in a separate process, which always ends."""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from select import select
from time import monotonic
from typing import Any, BinaryIO, Self

import numpy as np

from hsp_control.cli.live_experiment import check_live, live_period, simulated_robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError, HspControlError
from hsp_control.config import Experiment, load_experiment
from hsp_control.config.streams import without_sources
from hsp_control.control.controller import Controller
from hsp_control.control.fitting import Base
from hsp_control.control.measurement import LogChannel
from hsp_control.live.hardware import installed
from hsp_control.live.link import Faults, Link, PacketKind
from hsp_control.live.live_log import DueRows, live_channels
from hsp_control.live.settings import LiveSettings
from hsp_control.live.simulated_robot import SimulatedRobot
from hsp_control.live.udp import CLOSED_BY_LOOP, Row, SensorLayout, UdpHardware, serve
from hsp_control.robot import RobotState
from hsp_control.simulation.declared_run import with_duration
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.plants import differing_bodies


def end_process(process: subprocess.Popen[bytes], patience: float) -> None:
    """Close a process's pipes, so that it ends; kill it if that takes too long [s]."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):  # the process has ended before reading all
                pipe.close()
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class RobotProcess:
    """A simulated robot in its own process, and the `Hardware` that connects to it.

    Use it as a context manager: at its end the process has ended. The process has its
    own session, so that Ctrl-C in a terminal reaches the loop only. If this process
    dies, the robot's standard input is closed; then the robot stops itself, writes its
    log and ends.
    """

    def __init__(
        self,
        experiment: Experiment,
        *,
        faults: Faults | None = None,
        log: str | Path | None = None,
        log_period: float = 0.01,
        cameras: str | None = None,
        lockstep: bool = False,
    ) -> None:
        check_live(experiment)
        faults = faults or Faults()
        period = live_period(experiment)
        measured = simulated_robot(experiment).measured()
        self.hardware = UdpHardware(
            experiment.robot,
            period,
            faults=faults,
            sensors=SensorLayout.of(measured),
            alive=self._runs if lockstep else None,
        )
        self._settings = {
            "config": without_sources(experiment.config),
            "meta": {
                "name": f"{experiment.name}, the robot",
                "title": experiment.scenario.title,
            },
            "faults": faults.as_json(),
            "log": None if log is None else str(Path(log).absolute()),
            "log_period": log_period,
            "cameras": cameras,
            "lockstep": lockstep,
            "peer": self.hardware.address,
            "session": self.hardware.session,
        }
        self.process: subprocess.Popen[bytes] | None = None
        # robot's report (a dictionary), once it has ended by itself
        self.report: dict[str, Any] | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self, timeout: float = 180.0) -> None:
        """Start the process, and wait until it is ready."""
        command = [sys.executable, "-m", "hsp_control.cli.robot_process"]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        ready: list[Any] = [True]
        answer = b""
        try:
            line = json.dumps(self._settings).encode() + b"\n"
            self.process.stdin.write(line)
            self.process.stdin.flush()
            ready, _, _ = select([self.process.stdout], [], [], timeout)
            answer = self.process.stdout.readline() if ready else b""
        except OSError:
            pass
        except BaseException:  # such as Ctrl-C: nothing else ends the process
            self.close()
            raise
        if (reply := answer.decode(errors="replace").strip()) != READY:
            self.close()
            late = "" if ready else f" in {timeout:g} s"
            raise HardwareError(reply or f"the simulated robot did not start{late}")

    def _runs(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def wait(self, timeout: float = 15.0) -> dict[str, Any] | None:
        """Wait until the robot has stopped and its process has ended."""
        if self.process is None:
            return None
        end = monotonic() + timeout
        assert self.process.stdout is not None
        output = b""
        while (left := end - monotonic()) > 0.0:
            ready, _, _ = select([self.process.stdout], [], [], left)
            if not ready:
                break
            data = os.read(self.process.stdout.fileno(), 65536)
            if not data:
                break
            output += data
        if output.startswith(b"{"):
            self.report = json.loads(output)
        elif output:
            print(f"hsp: {output.decode().strip()}", file=sys.stderr)
        try:
            self.process.wait(max(end - monotonic(), 0.1))
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return self.report

    def close(self) -> None:
        """Stop the robot and end its process; a second call does nothing."""
        self.hardware.close()
        process, self.process = self.process, None
        if process is not None:
            end_process(process, 10.0)
        self.hardware.drain()


READY = "ready"


def main() -> int:
    """Run the robot until it has stopped; return 0, or 2 if it cannot.

    This is the robot's process. It reads its settings from its standard input, one line
    of JSON. The input then stays open; when the parent process dies it is closed, and
    the robot stops itself, completes its log and ends. It writes two lines to its
    standard output: ``ready``, and at the end its report, as JSON, or an error.
    """
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
        _print(f"the simulated robot: {error}")
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
        receives=PacketKind.EFFORT,
    )
    log = _RobotLog(experiment, robot, settings) if settings["log"] else None
    rows: list[Row] = [log.row] if log else []
    if settings["cameras"]:
        address, known = installed("--cameras", settings["cameras"], "cameras")
        rows.append(known.load()(address, robot.plant))
    _print(READY)
    served = serve(
        robot,
        link,
        stop_reason=stop_reason,
        on_rows=rows,
        lockstep=settings["lockstep"],
    )
    link.send(PacketKind.BYE)  # its number shows the loop how many packets were lost
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

    There are no tasks in it: a robot does not know what the loop follows. `with_tasks`
    adds them from the loop's log.
    """

    def __init__(
        self, experiment: Experiment, robot: SimulatedRobot, settings: dict[str, Any]
    ) -> None:
        self._robot, self._limits = robot, experiment.controller.limits
        self._due = DueRows(settings["log_period"])
        self._state = RobotState(experiment.robot)
        self._excess = LimitExcess(experiment.robot)
        meta = {
            **settings["meta"],
            "plant": {
                **robot.plant.describe(),
                **differing_bodies(robot.plant, experiment.robot),
            },
            "config": with_duration(settings["config"], None),
        }
        path = Path(settings["log"])
        scene = experiment.scene
        base: Base | None = "flying" if experiment.robot.unactuated else None
        nothing = Controller(experiment.robot, (), limits=None, base=base, scene=scene)
        self.log = LogWriter(nothing, scene, 0, path=path, meta=meta)
        self.log.warm_up(*self._row(0.0, robot.q, robot.v), parts=False)

    def row(self, t: float, q: Array, v: Array, last: bool) -> None:
        """Write the row of a period, if one is due."""
        robot = self._robot
        self._excess.record(self._limits, q, v)
        if self._due.is_due(t, robot.phase, last=last):
            self.log.record(*self._row(t, q, v), parts=False)
            self._due.written(t, robot.phase)

    def _row(
        self, t: float, q: Array, v: Array
    ) -> tuple[RobotState, None, Array, dict[str, LogChannel]]:
        """Return the arguments of `LogWriter.record`."""
        robot, state = self._robot, self._state.update(t, q, v)
        log_channels = {
            **live_channels(phase=float(robot.phase)),
            **robot.plant.log_channels(t, q, v, robot.tau),
            **self._excess.collect(self._limits),
        }
        return state, None, robot.tau, log_channels


def _warm_up(robot: SimulatedRobot, experiment: Experiment) -> None:
    """Execute each real-time operation once in advance."""
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
