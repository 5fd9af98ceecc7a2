"""A plain client of DDS in another process drives, watches and is driven.

The client (`dds_client`) imports Cyclone DDS only. Both sides run in lockstep.
"""

import json
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from live_rigs import PERIOD, law, panda, start
from ros2_rigs import DOMAIN, client, fresh

from hsp_control import load_experiment
from hsp_control.cli import ros2_robot
from hsp_control.cli.live_experiment import simulated_robot
from hsp_control.live import LiveSettings, Measurement, run_loop
from hsp_control.live.ros2.hardware import Ros2Hardware

pytestmark = pytest.mark.process

LONG = 120.0
COUNT = 200
SETTINGS = ["live.watchdog=100000", "live.compensates_gravity=true"]


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    before = [signal.getsignal(kind) for kind in (signal.SIGINT, signal.SIGTERM)]
    yield
    for kind, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
        signal.signal(kind, handler)


def test_a_client_drives_the_simulated_robot(
    capsys: pytest.CaptureFixture[str],
) -> None:
    controller, states, address = fresh()
    backwards = ",".join(panda().dof_names[::-1])
    with client("drive", DOMAIN, controller, states, COUNT) as driver:
        arguments = ["panda_obstacle", f"ros2://{address}&joints={backwards}"]
        arguments += [word for each in SETTINGS for word in ("--set", each)]
        assert ros2_robot.main([*arguments, "--lockstep"]) == 0
        out, _ = driver.communicate(timeout=LONG)
    assert driver.returncode == 0
    printed = capsys.readouterr().out
    assert f"{states}, {controller}/commands: ready" in printed
    assert "The robot: the loop closed the connection" in printed
    log = json.loads(out)
    twin = simulated_robot(load_experiment("panda_obstacle", *SETTINGS))
    reached = [np.concatenate([*twin.measure(), twin.tau])]
    for _, _, _, _, tau in log:
        twin.advance([np.array(tau)])
        reached.append(np.concatenate([*twin.measure(), twin.tau]))
    last = 0
    for names, q, v, effort, _ in log:
        assert names == list(panda().dof_names)
        heard = np.concatenate([q, v, effort])
        # The client may hear a state twice more before its first effort arrives.
        last = next(k for k in range(last, len(reached)) if np.array_equal(reached[k], heard))
    assert last > COUNT - 20
    assert np.abs(reached[last][7:14]).max() > 0.01  # it moved


class Recording:
    """Hardware that waits for as long as it takes, and remembers."""

    period = PERIOD

    def __init__(self, hardware: Ros2Hardware) -> None:
        self._hardware = hardware
        self.heard: list[Measurement] = []
        self.sent: list[list[float]] = []

    def read(self, timeout: float) -> Measurement | None:
        found = self._hardware.read(LONG if len(self.sent) < 2 * COUNT else 1.0)
        if found is not None:
            self.heard.append(found)
        return found

    def write(self, effort: np.ndarray) -> None:
        self.sent.append(effort.tolist())
        self._hardware.write(effort)

    def close(self) -> None:
        self._hardware.close()


def test_the_loop_drives_a_client_that_is_a_robot() -> None:
    controller, states, address = fresh()
    joints = [f"{n}={q!r}" for n, q in zip(panda().dof_names, start().tolist(), strict=True)]
    with client("robot", DOMAIN, controller, states, COUNT, *joints) as robot:
        with pytest.warns(RuntimeWarning, match="are ignored: gripper"):
            hardware = Recording(Ros2Hardware(address, panda(), PERIOD, timeout=LONG))
        settings = LiveSettings(age=1e9, missing=3, prediction_time=0.003)
        report = run_loop(law(), hardware, settings=settings)  # type: ignore[arg-type]
        out, _ = robot.communicate(timeout=LONG)
    log: list[Any] = json.loads(out)
    assert len(log) == COUNT
    # It had no more states at the end: the loop noticed, and stopped.
    assert report.ended == "fault"
    assert report.reason in {
        "no new state for 4 periods",
        f"the effort cannot be sent: nobody listens to {controller}/commands any more",
    }
    efforts = [tau for _, _, _, tau in log]
    assert efforts == hardware.sent[:COUNT]
    told = {tuple(q + v) for _, q, v, _ in log}
    heard = [tuple([*m.q.tolist(), *m.v.tolist()]) for m in hardware.heard]
    assert len(set(heard) - told) == 0
    assert len(set(heard)) > COUNT - 20
    times = [m.t for m in hardware.heard]
    assert np.allclose(np.diff(times[2:]), PERIOD, atol=1e-12, rtol=0.0)


def test_mistakes_at_the_command_line_are_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ros2_robot.main(["panda_obstacle", "ros2://eff?domains=1"]) == 2
    assert capsys.readouterr().err == (
        "hsp: ros2://eff?domains=1: there is no option 'domains'; did you mean 'domain'? "
        "(known: domain, states, joints)\n"
    )
