"""Run a simulated robot in a process of its own, which always ends."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from select import select
from time import monotonic
from typing import Any, Self

from hsp_control.cli.live_experiment import check_live, live_period, simulated_robot
from hsp_control.common.exceptions import HardwareError
from hsp_control.config import Experiment
from hsp_control.config.streams import without_sources
from hsp_control.live.link import Faults
from hsp_control.live.udp import SensorLayout, UdpHardware


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
    ) -> None:
        check_live(experiment)
        faults = faults or Faults()
        period = live_period(experiment)
        measured = simulated_robot(experiment).measured()
        self.hardware = UdpHardware(
            experiment.robot, period, faults=faults, sensors=SensorLayout.of(measured)
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
            "peer": self.hardware.address,
            "session": self.hardware.session,
        }
        # process; None if it does not run
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
        command = [sys.executable, "-m", "hsp_control.cli.simulated_robot"]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        ready: list[Any] = [True]
        try:
            line = json.dumps(self._settings).encode() + b"\n"
            self.process.stdin.write(line)
            self.process.stdin.flush()
            ready, _, _ = select([self.process.stdout], [], [], timeout)
            answer = self.process.stdout.readline() if ready else b""
        except OSError:
            answer = b""
        if answer.strip() != b"ready":
            self.close()
            fault = "did not start" if ready else f"did not start in {timeout:g} s"
            raise HardwareError(f"the simulated robot {fault}")

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
        if output:
            self.report = json.loads(output)
        try:
            self.process.wait(max(end - monotonic(), 0.1))
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return self.report

    def kill(self) -> None:
        """Kill the process at once, without a safe stop; do not wait."""
        if self.process is not None:
            os.kill(self.process.pid, signal.SIGKILL)

    def close(self) -> None:
        """Stop the robot and end its process; a second call does nothing."""
        self.hardware.close()
        process, self.process = self.process, None
        if process is not None:
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with suppress(OSError):  # the process has ended before reading all
                        pipe.close()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.hardware.drain()
