"""A loop and a robot in two processes over a lossy line; either one is killed.

All in lockstep, since test machines are slow. Every run must end in the safe stop with
complete logs, and every injected fault must be detected.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from places import further

import hsp_control as hsp
from hsp_control import Rollout
from hsp_control.cli import main
from hsp_control.cli.robot_process import RobotProcess
from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.companions.play.steering import PageProcess
from hsp_control.live import Faults, LiveSettings, Phase, run_loop

pytestmark = pytest.mark.process

CONFIG: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {"tip": {
        "type": "frame_position", "gains": {"natural_frequency": 10.0}, "blend": 0.3,
        "trajectory": {"type": "circle", "origin": "start", "center": [0.0, 0.0, 0.05],
                       "radius": 0.05, "angular_rate": 1.5, "normal": [1, 0, 0]},
    }},
    "simulation": {"duration": 1.0, "control_period": 0.001,
                   "integrator": {"type": "semi_implicit_euler", "step": 0.001}},
}  # fmt: skip
COUNTED = {"late": "stale", "duplicated": "duplicated", "corrupted": "corrupted"}


SETTINGS = LiveSettings(start_timeout=60.0)


def assert_stopped(log: Rollout) -> None:
    """The robot's own log: true states, to the end of its safe stop."""
    phases = log["live.phase"]
    # No damping if the loop had already brought it to rest.
    assert {Phase.RUNNING, Phase.HOLDING} <= set(phases)
    assert (np.diff(phases) >= 0).all()
    assert phases[-1] == Phase.HOLDING
    assert np.abs(log.v[-1]).max() < 0.01
    held = log.q[phases == Phase.HOLDING]
    assert np.abs(held - held[-1]).max() < 0.01
    assert_whole(log)


def assert_whole(log: Rollout) -> None:
    assert (np.diff(log.t) > 0.0).all()
    for name in ("q", "v", "tau"):
        assert np.isfinite(log[name]).all()


def gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def wait_for(what: Any, seconds: float = 60.0) -> bool:
    end = monotonic() + seconds
    while not what():
        if monotonic() > end:
            return False
        sleep(0.02)
    return True


def test_a_bad_line_is_seen_counted_and_survived(tmp_path: Path) -> None:
    experiment = hsp.load_experiment(CONFIG)
    logs = tmp_path / "loop.journal", tmp_path / "robot.journal"
    faults = Faults(late=0.03, lost=0.03, duplicated=0.03, corrupted=0.03, seed=1)
    with RobotProcess(experiment, faults=faults, log=logs[1], lockstep=True) as robot:
        report = run_loop(
            experiment.controller,
            robot.hardware,
            duration=1.0,
            settings=SETTINGS,
            log=logs[0],
        )
        reported = robot.wait(60.0)
        pid = robot.process.pid if robot.process else 0
    assert gone(pid)
    assert report.ended == "completed", report.reason
    assert (report.phase, report.silent) == (Phase.HOLDING, False)
    assert reported is not None
    assert reported["reason"] == "the loop closed the connection"
    link = robot.hardware.link
    ends = (link.counts, link.lost, reported["injected"]), (
        reported["link"], reported["link"]["lost"], link.injected
    )  # fmt: skip
    for counts, lost, injected in ends:
        assert min(injected.values()) > 10
        assert lost == injected["lost"]
        assert counts["foreign"] == 0
        for fault, seen in COUNTED.items():
            if fault == "late":  # one that was not overtaken is new
                assert injected[fault] - 3 <= counts[seen] <= injected[fault]
            else:
                assert counts[seen] == injected[fault]
    # The robot did its task despite the line.
    log = Rollout.load(logs[0])
    assert log.status == "completed"
    assert_whole(log)
    assert_stopped(Rollout.load(logs[1]))
    assert np.linalg.norm(log["task.tip.error"][log.t > 0.5], axis=1)[:20].max() < 0.02


def test_the_robot_s_process_is_killed(tmp_path: Path) -> None:
    experiment = hsp.load_experiment(CONFIG)
    logs = tmp_path / "loop.journal", tmp_path / "robot.journal"
    with RobotProcess(experiment, log=logs[1], lockstep=True) as robot:
        killed = []

        def kill(t: float) -> None:
            if t >= 0.3 and not killed:
                killed.append(t)
                robot.process.kill()

        report = run_loop(
            experiment.controller,
            robot.hardware,
            duration=60.0,
            settings=SETTINGS,
            log=logs[0],
            on_period=kill,
        )
        assert robot.wait(10.0) is None
    assert report.ended == "fault"
    assert report.reason == "no new state for 21 periods"
    assert report.silent
    log, truth = (Rollout.load(path) for path in logs)
    assert log.status == "stopped"
    assert_whole(log)
    # Its last rows are predicted; the robot's own log ends where it was killed.
    assert set(log["live.measured"]) == {0.0, 1.0}
    assert truth.status == "interrupted"
    assert_whole(truth)
    assert truth.t[-1] >= killed[0] - 0.02
    assert set(truth["live.phase"]) == {Phase.RUNNING}


def hsp_live(tmp_path: Path, *options: str) -> "subprocess.Popen[str]":
    path = tmp_path / "arm.yaml"
    path.write_text(json.dumps(CONFIG))
    command = [sys.executable, "-m", "hsp_control", "live", str(path), "--lockstep"]
    return subprocess.Popen(
        [*command, *options, "--out", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def rows(path: Path) -> int:
    try:
        return len(Rollout.load(path))
    except hsp.HspControlError:  # not begun yet
        return 0


def test_the_loop_s_process_is_killed(tmp_path: Path) -> None:
    process = hsp_live(tmp_path, "--duration", "60")
    assert wait_for(lambda: rows(tmp_path / "arm-live.journal") > 20, 200.0)
    process.kill()
    process.communicate(timeout=200)
    assert process.returncode == -signal.SIGKILL
    # The robot is alone now: it stops, writes its log, and its process ends.
    truth_path = tmp_path / "arm-robot.journal"

    def ended() -> bool:
        return Rollout.load(truth_path).status != "interrupted"

    assert wait_for(ended)
    truth, log = Rollout.load(truth_path), Rollout.load(tmp_path / "arm-live.journal")
    assert truth.status == "stopped"
    assert truth.meta["message"] == "the process that started the robot has ended"
    assert_stopped(truth)
    assert Phase.DAMPING in truth["live.phase"]  # it was not braked otherwise
    assert log.status == "interrupted"
    assert_whole(log)
    assert set(log["live.phase"]) == {Phase.RUNNING}
    # Repeated runs have the duration of the command, or that of the run.
    assert log.config is not None
    assert truth.config is not None
    ran = np.ptp(truth.t[truth["live.phase"] == Phase.RUNNING])
    assert log.config["simulation"]["duration"] == 60.0
    assert truth.config["simulation"]["duration"] == pytest.approx(ran, abs=0.01)


@pytest.mark.smoke
def test_a_robot_that_cannot_start_is_reported(tmp_path: Path) -> None:
    experiment = hsp.load_experiment(CONFIG)
    robot = RobotProcess(experiment, log=tmp_path / "none" / "file")
    (tmp_path / "none").write_text("")
    with pytest.raises(HardwareError, match=r"^the simulated robot: .*none"):
        robot.start()
    robot.close()


@pytest.mark.parametrize(
    "raised", [KeyboardInterrupt, *further(SystemExit, MemoryError)]
)
def test_a_start_that_is_cut_short_leaves_no_process(
    raised: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A context manager that failed on entry has no exit, so it must end the
    process."""
    robot = RobotProcess(hsp.load_experiment(CONFIG))
    page = PageProcess(port=None, host="127.0.0.1", held=False)
    started: list[int] = []

    def fails(*_: object) -> None:
        assert robot.process is not None
        started.append(robot.process.pid)
        raise raised

    monkeypatch.setattr("hsp_control.cli.robot_process.select", fails)
    with pytest.raises(raised), robot:
        pass
    assert gone(started[0])

    def page_fails(self: PageProcess) -> None:
        started.append(self._process.pid)
        raise raised

    monkeypatch.setattr(PageProcess, "_wait_for_address", page_fails)
    with pytest.raises(raised), page:
        pass
    assert gone(started[1])


@pytest.mark.parametrize(("options", "message"), [
    (["--faults", "lots=1"], "no fault 'lots'"),
    (["--duration", "-1"], "--duration -1; must be positive"),
    (["--robot", "a://b", "--faults", "lost=0.1"], "are for the simulated robot"),
    (["--robot", "a://b", "--lockstep"], "are for the simulated robot"),
    (["--set", "live.missing=-1"], "live.missing"),
])  # fmt: skip
def test_options_that_are_none(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["live", "iiwa_null_space", *options]) == 2
    assert message in capsys.readouterr().err


def test_forces_at_feet_are_sent_over_the_wire(tmp_path: Path) -> None:
    """Solo stands; a plan measures a foot on which the other process presses."""
    pytest.importorskip("mujoco")
    pytest.importorskip("example_robot_data")
    experiment = hsp.load_experiment(
        "whole_body/solo12_trunk",
        "tasks.trunk.trajectory={type: hold}",
        "plan={type: sensed, contacts: {front_left: {force: 0.5, starts: true}}}",
        "simulation.control_period=0.001",
    )
    logs = tmp_path / "loop.journal", tmp_path / "robot.journal"
    with RobotProcess(
        experiment, log=logs[1], log_period=0.001, lockstep=True
    ) as robot:
        report = run_loop(
            experiment.controller,
            robot.hardware,
            duration=0.5,
            plan=experiment.scenario.plan,
            settings=SETTINGS,
            log=logs[0],
            log_period=0.001,
        )
        reported = robot.wait(60.0)
    assert report.ended == "completed", report.reason
    assert reported is not None
    loop, true = (Rollout.load(log) for log in logs)
    rows = {round(1000.0 * t): k for k, t in enumerate(true.t)}
    running = loop["live.phase"] == Phase.RUNNING
    pairs = [
        (k, rows[n])
        for k, t in enumerate(loop.t)
        if running[k] and loop["live.measured"][k] and (n := round(1000.0 * t)) in rows
    ]
    assert len(pairs) == running.sum() == 500
    mine, theirs = np.array(pairs).T
    np.testing.assert_array_equal(loop.q[mine], true.q[theirs])
    felt = loop["plan.front_left.force"][mine]
    pressed = true["plant.contact.FL_FOOT.force"][theirs, 2]
    weight = 9.81 * sum(each.mass for each in experiment.robot.model.inertias)
    assert felt[-1] == pytest.approx(pressed[-1], rel=0.05)
    assert 0.1 * weight < felt[-1] < 0.5 * weight
    assert_whole(true)
    assert true.q[-1, 2] > 0.9 * experiment.q0[2], "it stands when all has ended"


def test_a_floating_base_that_nothing_holds_is_refused_before_anything_starts() -> None:
    robot = {"name": "panda", "root": "free_flyer"}
    experiment = hsp.load_experiment(CONFIG | {"robot": robot, "base": "driven"})
    with pytest.raises(LiveError, match="floating base and no contacts"):
        RobotProcess(experiment)
