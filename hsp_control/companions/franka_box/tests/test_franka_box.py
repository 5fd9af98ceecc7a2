"""The box and the real client: pylibfranka in another process, in lockstep.

A client can hang where libfranka waits forever, so all have a time limit.
"""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from franka_boxes import LONGEST, PATIENCE, PRELUDE, addresses, home, served
from places import covering

from hsp_control import Rollout

COMMAND = [
    *(sys.executable, "-m", "hsp_control", "franka-box"),
    *("--lockstep", "--patience", str(PATIENCE)),
]
pytest.importorskip("pylibfranka", reason="needs the extra franka")


@pytest.mark.process
def test_the_client_computes_with_the_arms_own_model() -> None:
    with served() as rig:
        report = rig.run("""
model = robot.load_model()
robot.set_EE([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0.05, 1])
robot.set_load(1.5, [0, 0.02, 0.1], [0.02, 0, 0, 0, 0.03, 0, 0, 0, 0.01])
state = robot.read_once()
names = ["q", "m_total", "O_T_EE", "tau_J", "O_ddP_O"]
print(json.dumps({
    **{name: np.array(getattr(state, name)).tolist() for name in names},
    "gravity": list(model.gravity(state)), "mass": list(model.mass(state)),
    "coriolis": list(model.coriolis(state)),
    "jacobian": list(model.zero_jacobian(state)),
}))
""")
        robot = rig.box.model.state.robot
        state = robot.state(0.0, np.array(report["q"]), np.zeros(7))
        hand = rig.box.model.O_T_EE
        rest = np.zeros(7)
        gravity = robot.inverse_dynamics(state.q, rest, rest)
        jacobian = np.array(report["jacobian"]).reshape(7, 6).T
        assert report["m_total"] == pytest.approx(0.76 + 1.5)
        assert report["gravity"] == pytest.approx(gravity, abs=1e-5)
        assert np.reshape(report["mass"], (7, 7)) == pytest.approx(
            np.array(state.mass_matrix), abs=1e-6
        )
        assert report["coriolis"] == pytest.approx(rest, abs=1e-9)
        pose = np.reshape(report["O_T_EE"], (4, 4)).T
        np.testing.assert_allclose(pose, hand.homogeneous, atol=1e-6)
        flange = state.frame("panda_link8")
        lever = hand.translation - flange.position
        assert jacobian[3:] == pytest.approx(flange.jacobian[3:], abs=1e-6)
        assert jacobian[:3] == pytest.approx(
            flange.jacobian[:3] + np.cross(flange.jacobian[3:].T, lever).T, abs=1e-6
        )


@pytest.mark.process
def test_a_reflex_is_named_and_recovered_from() -> None:
    with served() as rig:
        report = rig.run("""
report = []
for jump in (1.5, 0.5):
    control = robot.start_torque_control()
    try:
        for _ in range(5):
            state, _ = control.readOnce()
            control.writeOnce(damped(state, np.array([0, 0, 0, 0, 0, jump, 0])))
        report.append("no reflex")
        control = None
    except franka.ControlException as error:
        report.append(str(error))
        control = None
        state = robot.read_once()
        report += [str(state.robot_mode), str(state.last_motion_errors)]
        try:
            robot.start_torque_control()
        except franka.CommandException as error:
            report.append(str(error))
        robot.automatic_error_recovery()
        state = robot.read_once()
        report += [str(state.robot_mode), str(state.current_errors)]
print(json.dumps(report))
""")
    first, mode, errors, refused, mode_after, errors_after, second = report
    assert "aborted by reflex" in first
    assert "controller_torque_discontinuity" in first
    assert (mode, errors) == ("RobotMode.Reflex", '["controller_torque_discontinuity"]')
    assert 'not possible in the current mode ("Reflex")' in refused
    assert (mode_after, errors_after, second) == ("RobotMode.Idle", "[]", "no reflex")
    line = rig.message_with("ended: reflex")
    assert "joint 6 at 1500 N·m/s; limit 1000" in line


@pytest.mark.process
@pytest.mark.parametrize(
    ("controller", "kind"),
    covering(["JointImpedance", "CartesianImpedance"], ["position", "velocity"]),
)
def test_motion_generators_are_tracked(kind: str, controller: str) -> None:
    with served() as rig:
        error, moved, mode = rig.run(
            f"kind, controller = {kind!r}, {controller!r}"
            + """
mode = getattr(franka.ControllerMode, controller)
control = getattr(robot, f"start_joint_{kind}_control")(mode)
state, _ = control.readOnce()
start, worst = np.array(state.q_d), 0.0
turn = np.array([0, 0, 0, 1, 1, 0, 1]) * np.pi / 8
for step in range(1251):
    t = 2.0 * np.pi * step / 1250
    if kind == "position":
        command = franka.JointPositions((start + turn * 0.5 * (1 - np.cos(t))).tolist())
    else:
        speed = 2.0 * np.pi / 1.25 * 0.5 * np.sin(t)
        command = franka.JointVelocities((turn * speed).tolist())
    command.motion_finished = step == 1250
    control.writeOnce(command)
    if step < 1250:
        state, _ = control.readOnce()
        worst = max(worst, np.abs(np.array(state.q) - state.q_d).max())
        if step == 625:
            moved = (np.array(state.q) - start).tolist()
del control
print(json.dumps([worst, moved, str(robot.read_once().robot_mode)]))
"""
        )
    assert error < 0.02
    assert moved == pytest.approx(np.array([0, 0, 0, 1, 1, 0, 1]) * np.pi / 8, abs=0.02)
    assert mode == "RobotMode.Idle"
    assert "finished" in rig.message_with("motion ended")


@pytest.mark.process
def test_unsupported_requests_are_refused_by_the_protocol() -> None:
    with served() as rig:
        report = rig.run("""
handler = franka.AsyncPositionControlHandler
settings = handler.Configuration([1.0] * 7, 1e-3)
report = [handler.configure(robot, settings).error_message]
for attempt in (
    lambda: robot.set_load(-1.0, [0, 0, 0], [0] * 9),
    lambda: robot.set_K([2] * 16),
):
    try:
        attempt()
    except franka.CommandException as error:
        report.append(str(error))
print(json.dumps([report, str(robot.read_once().robot_mode)]))
""")
    (motion, load, frame), mode = report
    assert mode == "RobotMode.Idle"
    assert "Move command rejected: command not possible" in motion
    assert "Set Load command rejected: invalid argument" in load
    assert "Set EE to K command rejected: invalid argument" in frame
    line = rig.message_with("refused: move")
    assert "asynchronous joint position with joint impedance is not served" in line


@pytest.mark.process
def test_a_cut_link_ends_motion_and_client() -> None:
    with served(cut=0.1) as rig:
        report = rig.run("""
control = robot.start_torque_control()
try:
    while True:
        state, _ = control.readOnce()
        control.writeOnce(damped(state, np.zeros(7)))
except franka.NetworkException as error:
    print(json.dumps([str(error), str(state.robot_mode)]), flush=True)
control = robot = None
""")
        assert report == ["libfranka: UDP receive: Timeout", "RobotMode.Move"]
        line = rig.message_with("communication_constraints_violation")
        assert "20 commands in a row were lost; limit 20" in line
        # A new client is served like the first one.
        assert rig.run("print(json.dumps(str(robot.read_once().robot_mode)))") == (
            "RobotMode.Reflex"
        )


@contextmanager
def started(*options: str | Path) -> "Iterator[subprocess.Popen[str]]":
    command = [*COMMAND, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as box:
        assert box.stdout is not None
        try:
            while "research interface 10" not in (line := box.stdout.readline()):
                assert line, "the box did not start"
            yield box
        finally:
            box.kill()


@pytest.mark.process
@pytest.mark.slow
def test_a_client_sees_that_its_box_was_killed() -> None:
    host = next(addresses())
    source = f"""{PRELUDE}
control = robot.start_torque_control()
try:
    while True:
        state, _ = control.readOnce()
        control.writeOnce(damped(state, np.zeros(7)))
        print(flush=True)
except franka.NetworkException as error:
    print(error, flush=True)
    import os
    os._exit(7)
"""
    command = [sys.executable, "-c", source, host]
    with started("--host", host) as box:
        client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert client.stdout is not None
        assert client.stdout.readline()
        box.send_signal(signal.SIGKILL)
        output, _ = client.communicate(timeout=LONGEST)
        assert client.returncode == 7
        assert "libfranka: " in output


@pytest.mark.process
@pytest.mark.smoke
def test_a_second_client_is_refused_and_the_first_goes_on() -> None:
    with served() as rig:
        report = rig.run("""
try:
    franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)
except franka.NetworkException as error:
    print(json.dumps([str(error), str(robot.read_once().robot_mode)]))
""")
    assert report[0].startswith("libfranka: ")
    assert report[1] == "RobotMode.Idle"
    assert "is connected" in rig.message_with("refused: ")


@pytest.mark.process
@pytest.mark.slow
def test_the_example_in_the_documentation_runs(tmp_path: Path) -> None:
    """As a user would: the command, the example, Ctrl-C, and the log."""
    page = Path(__file__).parents[1] / "page.md"
    example = page.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    assert len(example.strip().splitlines()) <= 14
    host, log = next(addresses()), tmp_path / "example.npz"
    source = example.replace("127.0.0.1", host)
    with started("--host", host, "--log", log) as box:
        client = subprocess.run(
            [sys.executable, "-c", source],
            capture_output=True, text=True, timeout=LONGEST,
        )  # fmt: skip
        assert client.returncode == 0, client.stderr
        box.send_signal(signal.SIGINT)
        output, _ = box.communicate(timeout=LONGEST)
    assert box.returncode == 0
    assert "motion ended: the client has finished it (2999 commands, 0 lost)" in output
    assert f"Log: {log}" in output
    run = Rollout.load(log)
    moved = np.asarray(run["q"])[-1] - home()
    assert moved == pytest.approx([0, 0, 0, 0.3, 0, 0, 0], abs=0.01)
    assert np.asarray(run["t"])[-1] == pytest.approx(3.0, abs=0.2)
