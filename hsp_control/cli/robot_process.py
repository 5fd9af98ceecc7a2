"""Starts a simulated robot in a process of its own, and never leaves it behind."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from select import select
from time import monotonic
from types import TracebackType
from typing import Any, Self

from hsp_control.common.exceptions import HardwareError
from hsp_control.config import Experiment
from hsp_control.config.build_live import live_period
from hsp_control.live.faults import Faults
from hsp_control.live.settings import check_fixed
from hsp_control.live.udp_hardware import UdpHardware


class RobotProcess:
    """A simulated robot in its own process, and the hardware that speaks with it.

    Use it as a context: at its end the process is gone. It is its own session, so that
    Ctrl-C in a terminal reaches the loop alone; if this process dies, the robot notices
    by the end of its standard input, stops itself, writes its log, and ends.

    Attributes:
        hardware: The robot, for `run_loop`.
        process: The process.
        told: What the robot counted, once it has ended by itself; else None.
    """

    def __init__(
        self,
        experiment: Experiment,
        *,
        faults: Faults | None = None,
        log: str | Path | None = None,
        log_period: float = 0.01,
    ) -> None:
        """Prepare it; entering the context starts it.

        Args:
            experiment: Whose plant the robot is, where it starts, and whose section
                ``live`` says how it wants its efforts and how patient it is.
            faults: What happens to packets, in both directions.
            log: The journal of its true states.
            log_period: Time between two rows of it [s].

        Raises:
            LiveError: If the robot has a floating base.
        """
        check_fixed(experiment.robot)
        faults = faults or Faults()
        period = live_period(experiment)
        self.hardware = UdpHardware(experiment.robot, period, faults=faults)
        self._settings = {
            "config": experiment.scenario.model_dump(mode="json"),
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
        self.process: subprocess.Popen[bytes] | None = None
        self.told: dict[str, Any] | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def start(self, timeout: float = 180.0) -> None:
        """Start the process, and wait until the robot sends its states.

        Args:
            timeout: How long that may take [s]; kernels may have to be compiled.

        Raises:
            HardwareError: If it ends before, or takes longer.
        """
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
            said = self.process.stdout.readline() if ready else b""
        except OSError:
            said = b""
        if said.strip() != b"ready":
            self.close()
            why = "did not start" if ready else f"did not start in {timeout:g} s"
            raise HardwareError(f"the simulated robot {why}")

    def wait(self, timeout: float = 15.0) -> dict[str, Any] | None:
        """Wait until the robot has stopped and its process ended.

        Args:
            timeout: How long [s]; a safe stop takes 3 s at most.

        Returns:
            What it counted: ``phase``, ``reason``, ``speed``, ``link``, ...; None if it
            was killed.
        """
        if self.process is None:
            return None
        end = monotonic() + timeout
        assert self.process.stdout is not None
        said = b""
        while (left := end - monotonic()) > 0.0:
            ready, _, _ = select([self.process.stdout], [], [], left)
            if not ready:
                break
            data = os.read(self.process.stdout.fileno(), 65536)
            if not data:
                break
            said += data
        if said:
            self.told = json.loads(said)
        try:
            self.process.wait(max(end - monotonic(), 0.1))
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return self.told

    def kill(self) -> None:
        """Kill the process, as the machine might; nothing is waited for."""
        if self.process is not None:
            os.kill(self.process.pid, signal.SIGKILL)

    def close(self) -> None:
        """Have the robot stop, and its process end; again is no error."""
        self.hardware.close()
        process, self.process = self.process, None
        if process is not None:
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with suppress(OSError):  # it is gone, with what was not written
                        pipe.close()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.hardware.drain()
