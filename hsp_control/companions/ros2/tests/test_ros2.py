"""A plain DDS client in another process commands, observes and is commanded.

The client (`dds_client`) imports Cyclone DDS only. Both sides run in lockstep.
"""

import json
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_rigs import PERIOD, law, start
from loaded_robots import panda
from ros2_rigs import DOMAIN, client, fresh
from wording import wording

from hsp_control import load_experiment
from hsp_control.cli.live_experiment import simulated_robot
from hsp_control.companions.ros2 import robot as ros2_robot
from hsp_control.companions.ros2.hardware import Ros2Hardware
from hsp_control.live import LiveSettings, Measurement, run_loop

LONG = 120.0
COUNT = 200
SETTINGS = ["live.watchdog=100000", "live.compensates_gravity=true"]


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    before = [signal.getsignal(kind) for kind in (signal.SIGINT, signal.SIGTERM)]
    yield
    for kind, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
        signal.signal(kind, handler)


@pytest.mark.process
def test_a_client_drives_the_simulated_robot(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    controller, states, address = fresh()
    backwards = ",".join(panda().dof_names[::-1])
    output = tmp_path / "output.json"
    with client(output, "drive", DOMAIN, controller, states, COUNT):
        arguments = ["panda_obstacle", f"ros2://{address}&joints={backwards}"]
        arguments += [word for each in SETTINGS for word in ("--set", each)]
        assert ros2_robot.main([*arguments, "--lockstep"]) == 0
    printed = capsys.readouterr().out
    assert f"{states}, {controller}/commands: ready" in printed
    assert "The robot: the loop closed the connection" in printed
    log = json.loads(output.read_text())
    twin = simulated_robot(load_experiment("panda_obstacle", *SETTINGS))
    reached = [np.concatenate([*twin.measure(), twin.tau])]
    for _, _, _, _, tau in log:
        twin.advance([np.array(tau)])
        reached.append(np.concatenate([*twin.measure(), twin.tau]))
    last = 0
    for names, q, v, effort, _ in log:
        assert names == list(panda().dof_names)
        heard = np.concatenate([q, v, effort])
        # The client may receive a state twice more before its first effort arrives.
        last = next(
            k for k in range(last, len(reached)) if np.array_equal(reached[k], heard)
        )
    assert last > COUNT - 20
    assert np.abs(reached[last][7:14]).max() > 0.01  # it moved


@pytest.mark.process
def test_the_status_of_a_robot_after_a_fault_reports_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    controller, states, address = fresh()
    with client(tmp_path / "output.json", "drive", DOMAIN, controller, states, COUNT):
        arguments = ["panda_obstacle", f"ros2://{address}", "--set", "live.watchdog=1"]
        assert ros2_robot.main(arguments) == 2
    assert "The robot: the loop closed the connection" not in capsys.readouterr().out


class Recording:
    """Hardware that waits as long as the robot is alive, and records."""

    period = PERIOD

    def __init__(self, hardware: Ros2Hardware, robot: subprocess.Popen[bytes]) -> None:
        self._hardware, self._robot = hardware, robot
        self.heard: list[Measurement] = []
        self.sent: list[list[float]] = []

    def read(self, timeout: float) -> Measurement | None:
        found = self._hardware.read(0.0)
        while found is None and self._robot.poll() is None:
            found = self._hardware.read(0.1)
        if found is not None:
            self.heard.append(found)
        return found

    def write(self, effort: np.ndarray) -> None:
        self.sent.append(effort.tolist())
        self._hardware.write(effort)

    def close(self) -> None:
        self._hardware.close()


@pytest.mark.process
def test_the_loop_drives_a_client_that_is_a_robot(tmp_path: Path) -> None:
    controller, states, address = fresh()
    joints = [
        f"{n}={q!r}" for n, q in zip(panda().dof_names, start().tolist(), strict=True)
    ]
    output = tmp_path / "output.json"
    with client(output, "robot", DOMAIN, controller, states, COUNT, *joints) as robot:
        with pytest.warns(RuntimeWarning, match="are ignored: gripper"):
            connected = Ros2Hardware(address, panda(), PERIOD, timeout=LONG)
        hardware = Recording(connected, robot)
        own = {"missing": 200, "prediction_time": 0.003}
        settings = LiveSettings(age=1e9, contact=1e3, **own)  # it moves arbitrarily
        report = run_loop(law(), hardware, settings=settings)  # type: ignore[arg-type]
    log: list[Any] = json.loads(output.read_text())
    assert len(log) == COUNT
    # At the end there were no more states: the loop detected it and stopped.
    assert report.ended == "fault"
    assert report.reason in {
        "no new state for 201 periods",
        f"the effort cannot be sent: no subscriber of {controller}/commands is left",
    }
    efforts = [tau for _, _, _, tau in log]
    assert efforts == hardware.sent[:COUNT]
    reported = {tuple(q + v) for _, q, v, _ in log}
    heard = [(*m.q.tolist(), *m.v.tolist()) for m in hardware.heard]
    assert len(set(heard) - reported) == 0
    assert len(set(heard)) > COUNT // 4  # a busy machine loses some
    periods = np.array([m.t for m in hardware.heard]) / PERIOD
    assert np.allclose(periods, periods.round(), atol=1e-9, rtol=0.0)
    assert (np.diff(periods) > 0.5).all()


def test_mistakes_at_the_command_line_are_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ros2_robot.main(["panda_obstacle", "ros2://eff?domains=1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    reported = (
        "hsp: ros2://eff?domains=1: ... 'domains' ... 'domain' ... states, joints"
    )
    assert re.search(wording(reported), line)
