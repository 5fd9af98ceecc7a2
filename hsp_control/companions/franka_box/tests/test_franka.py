"""A Franka arm behind pylibfranka, unmodified, and the control box on loopback.

All in lockstep: the box waits for every command. The client runs in another process,
which is killed if it hangs.
"""

import json
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from franka_arms import LOOPBACK, circle, host, serving
from franka_boxes import served
from places import ROOT

from hsp_control import Robot, Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.cli.options import command_line
from hsp_control.common.errors import HardwareError
from hsp_control.companions.franka import (
    FrankaHardware,
    FrankaSettings,
    Load,
    client_process,
    connect,
    connection,
)
from hsp_control.companions.franka_box.gripper import Gripper
from hsp_control.live import (
    InProcessRobot,
    LiveSettings,
    LoopReport,
    OperatorRequests,
    SimulatedRobot,
    run_loop,
)
from hsp_control.live.simulated_robot import sampled

pytest.importorskip("pylibfranka")
PERIOD = 0.001
PUSH = {"frame": "panda_link6", "force": [0, 150, 0], "start": 0.2, "duration": 0.1}
"""External torque and external force: the box determines which reflex is first."""


def moved(arm: FrankaHardware, experiment: Any = None, **options: Any) -> LoopReport:
    """Run a loop on an arm in lockstep."""
    experiment = experiment or circle()
    settings = arm.adapted(LiveSettings())
    defaults = {"duration": 1.0, "settings": settings, "log_period": PERIOD}
    return run_loop(experiment.controller, arm, **defaults | options)


@pytest.mark.process
def test_the_arm_moves_as_the_simulated_robot(tmp_path: Path) -> None:
    """States are in single precision; otherwise the two runs are identical."""
    experiment, logs = circle(), (tmp_path / "arm.journal", tmp_path / "sim.journal")
    with serving(experiment) as box:
        arm = connect(box.address, experiment.robot, PERIOD)
        report = moved(arm, log=logs[0], duration=0.8)
        assert report.ended == "completed", report.reason
        assert arm.fault is None
        assert box.reported("motion ended: the client has finished it", "0 lost")
    plant = sampled(experiment.plant, experiment.integrator, PERIOD)
    settings = arm.adapted(LiveSettings())
    assert settings.compensates_gravity
    robot = SimulatedRobot(
        plant, experiment.q0, experiment.v0, PERIOD, settings=settings
    )
    run_loop(
        circle().controller,
        InProcessRobot(robot),
        duration=0.8,
        settings=settings,
        log=logs[1],
        log_period=PERIOD,
    )
    real, simulated = map(Rollout.load, logs)
    np.testing.assert_array_equal(real.t, simulated.t)
    np.testing.assert_allclose(real.q, simulated.q, atol=2e-6)
    circling = (real.t > 0.6) & (real.t < 0.8)
    assert np.abs(real["task.hand.error"][circling]).max() < 1e-3


@pytest.mark.process
def test_a_reflex_is_reported_and_reset_only_on_request(tmp_path: Path) -> None:
    experiment = circle(plant={"type": "rigid_body", "pushes": [PUSH]})
    with serving(experiment) as box:
        arm = connect(box.address, experiment.robot, PERIOD)
        report = moved(arm, log=tmp_path / "pushed.journal")
        assert report.ended == "fault"
        (name,) = re.findall(r"(\w+_reflex): the external", report.reason)
        assert report.silent  # the arm holds its position
        assert arm.fault is not None
        assert arm.fault in report.reason
        assert box.reported("motion ended: reflex", name)
        assert Rollout.load(tmp_path / "pushed.journal").t[-1] < 0.4
        box.wait_alone()
        with pytest.raises(HardwareError, match=f"mode Reflex .{name}.*recover="):
            connect(box.address, experiment.robot, PERIOD)
        box.wait_alone()
        connect(f"{box.address}&recover=true", experiment.robot, PERIOD).close()
        box.wait_alone()
        connect(box.address, experiment.robot, PERIOD).close()


@pytest.mark.process
def test_the_operator_s_stop_finishes_the_motion() -> None:
    experiment, requests = circle(), OperatorRequests()
    with serving(experiment) as box:
        arm = connect(box.address, experiment.robot, PERIOD)

        def stop(t: float) -> None:
            if t >= 0.3:
                requests.stop("enough")

        report = moved(arm, requests=requests, on_period=stop)
        assert (report.ended, report.reason) == ("operator", "enough")
        assert not report.silent
        assert report.speed < 0.01
        assert box.reported("motion ended: the client has finished it")


@pytest.mark.process
def test_a_killed_box_ends_the_loop() -> None:
    address = host(1)
    command = [sys.executable, "-m", "hsp_control", "franka-box", "panda"]
    with subprocess.Popen(
        [*command, "--lockstep", "--patience", "60", "--host", address],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as box:
        try:
            assert box.stdout is not None
            assert f"behind {address}" in box.stdout.readline()
            experiment = circle()
            arm = connect(f"{address}?{LOOPBACK}", experiment.robot, PERIOD)

            def kill(t: float) -> None:
                if t >= 0.2 and box.poll() is None:
                    os.kill(box.pid, signal.SIGKILL)

            report = moved(arm, on_period=kill)
            assert report.ended == "fault"
            assert report.silent
            assert "NetworkException" in report.reason
        finally:
            box.kill()


@pytest.mark.process
@pytest.mark.smoke
def test_a_dead_client_is_reported() -> None:
    experiment = circle()
    with serving(experiment) as box:
        arm = connect(box.address, experiment.robot, PERIOD)

        def kill(t: float) -> None:
            if t >= 0.1:
                arm._process._process.kill()

        report = moved(arm, on_period=kill)
        assert report.ended == "fault"
        assert "the process that talks to the robot ended (SIGKILL)" in report.reason
        box.wait_alone()
        assert box.reported("motion ended")


@pytest.mark.process
def test_a_client_that_hangs_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """libfranka waits forever if a box closes the connection without an answer."""
    monkeypatch.setattr(connection, "_TIMEOUT", 1.0)
    address = host(2)
    with socket.create_server((address, 1337)) as server:

        def close_without_answer() -> None:
            link, _ = server.accept()
            link.recv(100)
            link.close()

        thread = threading.Thread(target=close_without_answer)
        thread.start()
        with pytest.raises(HardwareError, match="did not answer for 1 s"):
            connect(f"{address}?{LOOPBACK}", Robot.load("panda"), PERIOD)
        thread.join()


@pytest.mark.process
def test_who_only_reads_sets_no_thresholds(tmp_path: Path) -> None:
    with served() as rig:
        address = f"{rig.host}?{LOOPBACK}"
        assert main(["franka-model", address, str(tmp_path / "read.urdf")]) == 0
        assert np.isinf(rig.box.thresholds.upper_effort).all()
        connect(address, Robot.load("panda"), PERIOD).close()
        assert np.isfinite(rig.box.thresholds.upper_effort).all()


@pytest.mark.process
def test_the_load_is_in_both_models(tmp_path: Path) -> None:
    """A load in one model only is refused; in both, the arm follows its path."""
    load = {"mass": 0.8, "center": [0.02, 0.0, 0.15]}
    heavy = {"frame": "panda_link8", "mass": 0.8, "center": [0.02, 0.0, 0.15]}
    experiment = circle(plant={"type": "rigid_body", "payload": heavy})
    with serving(experiment) as box:
        settings = FrankaSettings(
            box.host, realtime="ignore", lockstep=True, load=Load(**load)
        )
        with pytest.raises(HardwareError, match=r"differs .* carries 1\.56 kg"):
            connect(settings, experiment.robot, PERIOD)
        box.wait_alone()
        urdf = str(tmp_path / "loaded.urdf")
        text = f"{box.address}&load.mass=0.8&load.center=[0.02, 0, 0.15]"
        assert main(["franka-model", text, urdf, "--like", "panda"]) == 0
        box.wait_alone()
        start = {"configuration": experiment.q0.tolist()}
        known = circle(robot={"name": urdf}, start=start)
        arm = connect(settings, known.robot, PERIOD)
        log = tmp_path / "loaded.journal"
        report = moved(arm, known, log=log, duration=0.8)
        assert report.ended == "completed", report.reason
    run = Rollout.load(log)
    circling = (run.t > 0.6) & (run.t < 0.8)
    assert np.abs(run["task.hand.error"][circling]).max() < 1e-3


@pytest.mark.process
def test_the_gripper_follows_openings_and_reports_its_own() -> None:
    messages: list[str] = []
    with serving(circle()) as box, closing(udp()) as policy, closing(udp()) as other:
        gripper = Gripper(messages.append, box.host)
        gripper.thing = 0.03
        other.bind((box.host, 0))
        port = other.getsockname()[1]
        settings = f"{box.address}&gripper=udp://{box.host}:{port}"
        with pytest.raises(HardwareError, match=r"gripper: .*Address already in use"):
            connect(settings, circle().robot, PERIOD)
        other.close()
        with closing(connect(settings, circle().robot, PERIOD)):

            def printed(message: Any, sender: socket.socket) -> Any:
                sender.sendto(json.dumps(message).encode(), (box.host, port))
                return json.loads(sender.recv(999))

            assert printed({}, policy) == {"value": [0.04], "grasped": False}
            for odd in ([], "x", 3, None, {"value": 3}, {"value": []}, {"values": []},
                        {"value": [{}]}, {"value": "x"}, [[[]]]):  # fmt: skip
                assert printed(odd, policy) == {"value": [0.04], "grasped": False}
            assert printed({"value": [0.0]}, policy) == {
                "value": [0.015],
                "grasped": True,
            }
            assert printed({"value": [np.nan]}, policy)["grasped"]
            with closing(udp()) as second:
                assert printed({"value": [0.04]}, second)["grasped"]
            opened = printed({"values": [[0.0], [0.03]]}, policy)
            assert opened == {"value": [0.03], "grasped": False}
    assert messages == [
        "the gripper grasps with 30 N to 0 mm", "the gripper goes to 60 mm"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("sent", "fault"),
    [(signal.SIGKILL, "has ended"), (signal.SIGSTOP, "has sent nothing for 2 s")],
)
def test_without_a_gripper_that_obeys_the_arm_stops(
    sent: signal.Signals, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The gripper's process dies or hangs during a run; the loop holds the arm."""
    monkeypatch.setattr(client_process, "_HANGS", 2.0)  # four heartbeats
    experiment, times = circle(), list[float]()
    with serving(experiment, 3 + (sent == signal.SIGSTOP)) as box:
        gripper = Gripper(lambda line: None, box.host)
        with closing(udp()) as free:
            free.bind((box.host, 0))
            port = free.getsockname()[1]
        settings = f"{box.address}&gripper=udp://{box.host}:{port}"
        arm = connect(settings, experiment.robot, PERIOD)

        def strike(t: float) -> None:
            assert arm._gripper is not None
            if t > 0.1 and not times:
                arm._gripper._process.send_signal(sent)
                times.append(t)

        report = moved(arm, experiment, duration=600.0, on_period=strike)
    assert gripper.width == 0.08
    assert report.ended == "fault"
    assert report.reason == f"the process that drives the gripper {fault}"
    assert report.at_rest
    assert not report.silent
    assert arm._gripper is not None
    assert arm._gripper._process.poll() == -signal.SIGKILL


def udp() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.settimeout(20.0)
    return made


def test_the_arm_has_seven_joints_and_a_millisecond() -> None:
    fingers = Robot.load("panda", locked={})
    with pytest.raises(HardwareError, match=r"8 degrees of freedom.*Lock the fingers"):
        connect("127.0.0.1", fingers, PERIOD)
    with pytest.raises(HardwareError, match=r"period is 0\.002 s"):
        connect("127.0.0.1", Robot.load("panda"), 0.002)


@pytest.mark.process
def test_the_command_line_drives_the_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    later = PUSH | {"start": 0.6}
    experiment = circle(plant={"type": "rigid_body", "pushes": [later]})
    file = tmp_path / "circle.yaml"
    file.write_text(yaml.safe_dump(circle().config))
    options = ["live", str(file), "--out", str(tmp_path), "--robot"]
    with serving(experiment) as box:
        assert main([*options, f"franka://{box.address}", "--duration", "0.15"]) == 0
        printed = capsys.readouterr().out
        run = Rollout.load(tmp_path / "circle-live.npz")
        assert np.abs(run["task.hand.error"][run.t < 0.1]).max() < 1e-3
        assert "end effector 0.76 kg (Desk)" in printed
        assert "differs from the robot's by" in printed
        assert "The loop: the duration is over" in printed
        box.wait_alone()
        assert main([*options, f"franka://{box.address}", "--duration", "1"]) == 2
        assert "_reflex: " in capsys.readouterr().err
        box.wait_alone()
        away = ["--set", "start={joints: {panda_joint2: -0.3}}"]
        recover = f"franka://{box.address}&recover=true"
        assert main([*options, recover, *away]) == 2
        printed = capsys.readouterr().err
        assert "from the configuration's start; 0.2 is allowed" in printed
        assert "begin where it is" in printed
    assert main([*options, "franka://a?realtme=ignore"]) == 2
    assert "did you mean 'realtime'" in capsys.readouterr().err


@pytest.mark.process
def test_the_page_is_true(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "hsp_control/companions/franka/page.md").read_text(encoding="utf-8")
    printed = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]*)\|$", text, re.MULTILINE))
    fields = FrankaSettings("a").all_fields()
    assert set(printed) == set(fields)
    for name in ("collision_torque", "collision_force"):
        wanted = ", ".join(f"{each:g}" for each in fields[name])
        assert printed[name].strip() == wanted
    (document,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "lab.yaml").write_text(document)
    load = Load(0.4, center=[0.0, 0.0, 0.1])
    written = FrankaSettings("172.16.0.2", load=load)
    assert FrankaSettings.parse(str(tmp_path / "lab.yaml")) == written
    shell = "".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    commands = shell.replace("\\\n", " ").splitlines()
    used = [shlex.split(line, comments=True)[1:] for line in commands if "hsp " in line]
    assert {command[0] for command in used if command} >= {"live", "franka-model"}
    for command in used:
        if command[0] != "install":
            command_line().parse_args(command)
    (snippet,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    with serving(load_experiment("panda_obstacle")) as box:
        snippet = snippet.replace("172.16.0.2", box.address)
        space: dict[str, Any] = {}
        exec(compile(snippet, "franka.md", "exec"), space)
    assert space["report"].ended == "completed", space["report"].reason
    assert space["arm"].fault is None
