"""The box and the real client: pylibfranka in a process of its own, in lockstep.

A client can hang where libfranka waits for ever, so each has a time limit.
"""

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from franka_boxes import (
    LONGEST,
    PATIENCE,
    PRELUDE,
    addresses,
    home,
    panda,
    plant,
    served,
)

from hsp_control import Rollout, load_experiment
from hsp_control.companions.franka.layouts import Error
from hsp_control.simulation.plants import Payload

COMMAND = [
    *(sys.executable, "-m", "hsp_control", "franka-box"),
    *("--lockstep", "--patience", str(PATIENCE)),
]
pytest.importorskip("pylibfranka", reason="needs the extra franka")
pytestmark = pytest.mark.process


def test_the_client_computes_with_the_arms_own_model() -> None:
    with served() as rig:
        told = rig.run("""
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
        state = robot.state(0.0, np.array(told["q"]), np.zeros(7))
        hand = rig.box.model.O_T_EE
        rest = np.zeros(7)
        gravity = robot.inverse_dynamics(state.q, rest, rest)
        jacobian = np.array(told["jacobian"]).reshape(7, 6).T
        assert told["m_total"] == pytest.approx(0.76 + 1.5)
        assert told["gravity"] == pytest.approx(gravity, abs=1e-5)
        assert np.reshape(told["mass"], (7, 7)) == pytest.approx(
            np.array(state.mass_matrix), abs=1e-6
        )
        assert told["coriolis"] == pytest.approx(rest, abs=1e-9)
        pose = np.reshape(told["O_T_EE"], (4, 4)).T
        np.testing.assert_allclose(pose, hand.homogeneous, atol=1e-6)
        flange = state.frame("panda_link8")
        lever = hand.translation - flange.position
        assert jacobian[3:] == pytest.approx(flange.jacobian[3:], abs=1e-6)
        assert jacobian[:3] == pytest.approx(
            flange.jacobian[:3] + np.cross(flange.jacobian[3:].T, lever).T, abs=1e-6
        )


def test_the_clients_names_of_errors_are_ours() -> None:
    with served() as rig:
        rig.box.readings.fields["errors"][:] = 1
        told = rig.run("print(json.dumps(str(robot.read_once().current_errors)))")
    assert told == str([error.spelling for error in Error]).replace("'", '"')


REACH = """
goal = np.array(robot.read_once().q) + [0.2, -0.1, 0.1, 0.2, -0.1, 0.2, 0.1]
control, effort = robot.start_torque_control(), np.zeros(7)
for step in range(1500):
    state, _ = control.readOnce()
    pull = 60.0 * (goal - np.array(state.q))
    effort += np.clip(pull - effort, -0.3, 0.3)
    command = franka.Torques((effort - 25.0 * np.array(state.dq)).tolist())
    command.motion_finished = step == 1499
    control.writeOnce(command)
del control
state = robot.read_once()
print(json.dumps([(goal - np.array(state.q)).tolist(), str(state.robot_mode),
                  state.q, state.tau_J]))
"""


def test_the_same_client_gives_the_same_bits() -> None:
    runs = []
    for _ in range(2):
        with served() as rig:
            left, mode, *numbers = rig.run(REACH)
            assert mode == "RobotMode.Idle"
            assert np.abs(left).max() < 0.02
            runs.append((numbers, rig.box.q.tolist()))
            assert "finished" in rig.tells("motion ended")
            assert "1499 commands, 0 lost" in rig.tells("motion ended")
    assert runs[0] == runs[1]


def test_a_reflex_is_named_and_recovered_from() -> None:
    with served() as rig:
        told = rig.run("""
told = []
for jump in (1.5, 0.5):
    control = robot.start_torque_control()
    try:
        for _ in range(5):
            state, _ = control.readOnce()
            control.writeOnce(damped(state, np.array([0, 0, 0, 0, 0, jump, 0])))
        told.append("no reflex")
        control = None
    except franka.ControlException as error:
        told.append(str(error))
        control = None
        state = robot.read_once()
        told += [str(state.robot_mode), str(state.last_motion_errors)]
        try:
            robot.start_torque_control()
        except franka.CommandException as error:
            told.append(str(error))
        robot.automatic_error_recovery()
        state = robot.read_once()
        told += [str(state.robot_mode), str(state.current_errors)]
print(json.dumps(told))
""")
    first, mode, errors, refused, mode_after, errors_after, second = told
    assert "aborted by reflex" in first
    assert "controller_torque_discontinuity" in first
    assert (mode, errors) == ("RobotMode.Reflex", '["controller_torque_discontinuity"]')
    assert 'not possible in the current mode ("Reflex")' in refused
    assert (mode_after, errors_after, second) == ("RobotMode.Idle", "[]", "no reflex")
    line = rig.tells("ended: reflex")
    assert "joint 6 at 1500 N·m/s; limit 1000" in line


def test_a_limit_that_is_reached_is_left_again() -> None:
    with served() as rig:
        at, back = rig.run("""
control, push = robot.start_torque_control(), 0.0
try:
    while True:
        state, _ = control.readOnce()
        push = min(push + 0.02, 4.0)
        control.writeOnce(damped(state, np.array([0, 0, 0, push, 0, 0, 0])))
except franka.ControlException as error:
    assert "joint_position_limits_violation" in str(error)
control = None
at = robot.read_once().q[3]
robot.automatic_error_recovery()
print(json.dumps([at, robot.read_once().q[3]]))
""")
        upper = panda().limits.upper[3]
    assert at > upper > back
    line = rig.tells("joint_position_limits_violation: joint 4 at ")
    assert f"rad; limit {upper:.6g}" in line
    assert "recovered" in rig.tells("recovered")


@pytest.mark.parametrize("controller", ["JointImpedance", "CartesianImpedance"])
@pytest.mark.parametrize("kind", ["position", "velocity"])
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
    assert "finished" in rig.tells("motion ended")


@pytest.mark.parametrize("kind", ["pose", "velocity"])
def test_motion_generators_of_the_hand_are_tracked(kind: str) -> None:
    with served() as rig:
        error, moved, mode = rig.run(
            f"kind = {kind!r}"
            + """
mode = franka.ControllerMode.JointImpedance
control = getattr(robot, f"start_cartesian_{kind}_control")(mode)
state, _ = control.readOnce()
start, worst = np.array(state.O_T_EE), 0.0
way = np.array([0.03, -0.03, 0.05])
for step in range(1001):
    t = 2.0 * np.pi * step / 1000
    if kind == "pose":
        pose = start.copy()
        pose[12:15] += way * 0.5 * (1 - np.cos(t))
        command = franka.CartesianPose(pose.tolist())
    else:
        speed = 2.0 * np.pi / 1.0 * 0.5 * np.sin(t)
        command = franka.CartesianVelocities([*(way * speed), 0, 0, 0])
    command.motion_finished = step == 1000
    control.writeOnce(command)
    if step < 1000:
        state, _ = control.readOnce()
        far = np.array(state.O_T_EE) - state.O_T_EE_c
        worst = max(worst, np.abs(far).max())
        if step == 500:
            moved = (np.array(state.O_T_EE) - start)[12:15].tolist()
del control
print(json.dumps([worst, moved, str(robot.read_once().robot_mode)]))
"""
        )
    assert error < 2e-3
    assert moved == pytest.approx([0.03, -0.03, 0.05], abs=2e-3)
    assert mode == "RobotMode.Idle"
    assert "finished" in rig.tells("motion ended")


def test_what_is_not_served_is_refused_by_the_protocol() -> None:
    with served() as rig:
        told = rig.run("""
handler = franka.AsyncPositionControlHandler
settings = handler.Configuration([1.0] * 7, 1e-3)
told = [handler.configure(robot, settings).error_message]
for attempt in (
    lambda: robot.set_load(-1.0, [0, 0, 0], [0] * 9),
    lambda: robot.set_K([2] * 16),
):
    try:
        attempt()
    except franka.CommandException as error:
        told.append(str(error))
print(json.dumps([told, str(robot.read_once().robot_mode)]))
""")
    (motion, load, frame), mode = told
    assert mode == "RobotMode.Idle"
    assert "Move command rejected: command not possible" in motion
    assert "Set Load command rejected: invalid argument" in load
    assert "Set EE to K command rejected: invalid argument" in frame
    line = rig.tells("refused: move")
    assert "asynchronous joint position with joint impedance is not served" in line


def test_a_cut_link_ends_motion_and_client() -> None:
    with served(cut=0.1) as rig:
        told = rig.run("""
control = robot.start_torque_control()
try:
    while True:
        state, _ = control.readOnce()
        control.writeOnce(damped(state, np.zeros(7)))
except franka.NetworkException as error:
    print(json.dumps([str(error), str(state.robot_mode)]), flush=True)
control = robot = None
""")
        assert told == ["libfranka: UDP receive: Timeout", "RobotMode.Move"]
        line = rig.tells("communication_constraints_violation")
        assert "20 commands in a row were lost; limit 20" in line
        # Once more: a new client is served as the first one was.
        assert rig.run("print(json.dumps(str(robot.read_once().robot_mode)))") == (
            "RobotMode.Reflex"
        )


CIRCLE: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {
        "hand": {
            "type": "frame_position",
            "trajectory": {
                "type": "circle",
                "origin": "start",
                "center": [0.0, 0.0, 0.05],
                "radius": 0.05,
                "angular_rate": 6.0,
                "normal": [1, 0, 0],
            },
            "gains": {"natural_frequency": 10.0},
            "blend": 0.5,
        }
    },
    "null_space": {"gain": 10, "fields": [{"type": "target_posture"}]},
    "simulation": {
        "duration": 1.0,
        "control_period": 0.001,
        "log_period": 0.01,
        "integrator": {"type": "rk4", "step": 0.001},
    },
}


@pytest.mark.slow
def test_a_circle_with_a_posture_is_the_one_that_is_simulated() -> None:
    """The same law and plant with and without the box: they differ by single precision.

    The simulation knows no box, no gravity that somebody else adds, no packets.
    """
    experiment = load_experiment(CIRCLE)
    run, path = experiment.run(), []
    with served(plant(motor_inertia=0.0), experiment.q0) as rig:
        rig.box.on_period = lambda: path.append(rig.box.q.copy())
        rig.run(
            f"config = {CIRCLE!r}"
            + """
from hsp_control import Rollout, load_experiment
experiment = load_experiment(config)
arm, state, rest = experiment.robot, experiment.robot.state, np.zeros(7)
experiment.controller.compute(0.0, experiment.q0, rest)  # compile before the motion
control = robot.start_torque_control()
for step in range(1001):
    told, _ = control.readOnce()
    q, v = np.array(told.q), np.array(told.dq)
    tau = experiment.controller.compute(1e-3 * step, q, v).tau
    command = franka.Torques((tau - arm.inverse_dynamics(q, rest, rest)).tolist())
    command.motion_finished = step == 1000
    control.writeOnce(command)
"""
        )
        assert "1000 commands, 0 lost" in rig.tells("finished")
    simulated = np.asarray(run["q"])
    served_path = np.array([experiment.q0, *path[:1000]])[::10]
    assert np.abs(simulated - experiment.q0).max() > 0.1
    np.testing.assert_allclose(served_path, simulated, atol=1e-6)


def test_a_payload_that_nobody_knows_is_an_external_force() -> None:
    """Two kilograms at the hand pull down; the load that is set explains them."""
    payload = Payload("panda_tcp", 2.0)
    still = """
control = robot.start_joint_position_control(franka.ControllerMode.JointImpedance)
for _ in range(600):
    state, _ = control.readOnce()
    control.writeOnce(franka.JointPositions(list(state.q_d)))
del control
print(json.dumps(state.O_F_ext_hat_K))
"""
    with served(plant(payload=payload)) as rig:
        force = rig.run(still)
        assert force[2] == pytest.approx(2.0 * 9.81, rel=0.02)
        known = rig.run("robot.set_load(2.0, [0, 0, 0.1034], [0] * 9)" + still)
        assert np.abs(known).max() < 0.2


def test_a_client_that_is_killed_leaves_a_box_for_the_next() -> None:
    with served() as rig:
        endless = """
control = robot.start_torque_control()
while True:
    state, _ = control.readOnce()
    control.writeOnce(damped(state, np.zeros(7)))
    print(flush=True)
"""
        client = subprocess.Popen(
            [sys.executable, "-c", PRELUDE + endless, rig.host], stdout=subprocess.PIPE
        )
        try:
            assert client.stdout is not None
            assert client.stdout.readline()
        finally:
            client.kill()
            client.communicate(timeout=LONGEST)
        assert rig.run("print(json.dumps(str(robot.read_once().robot_mode)))") == (
            "RobotMode.Idle"
        )
        assert "its client is disconnected" in rig.tells("motion ended")


def await_start(box: "subprocess.Popen[str]") -> None:
    assert box.stdout is not None
    while "research interface 10" not in (line := box.stdout.readline()):
        assert line, "the box did not start"


@pytest.mark.slow
def test_a_client_sees_that_its_box_was_killed() -> None:
    host = next(addresses())
    with subprocess.Popen(
        [*COMMAND, "--host", host], stdout=subprocess.PIPE, text=True
    ) as box:
        assert box.stdout is not None
        try:
            await_start(box)
            client = subprocess.Popen(
                [
                    sys.executable,
                    "-c",
                    PRELUDE
                    + """
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
""",
                    host,
                ],
                stdout=subprocess.PIPE,
                text=True,
            )
            assert client.stdout is not None
            assert client.stdout.readline()
            box.send_signal(signal.SIGKILL)
            said, _ = client.communicate(timeout=LONGEST)
            assert client.returncode == 7
            assert "libfranka: " in said
        finally:
            box.kill()


@pytest.mark.smoke
def test_a_second_client_is_refused_and_the_first_goes_on() -> None:
    with served() as rig:
        told = rig.run("""
try:
    franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)
except franka.NetworkException as error:
    print(json.dumps([str(error), str(robot.read_once().robot_mode)]))
""")
    assert told[0].startswith("libfranka: ")
    assert told[1] == "RobotMode.Idle"
    assert "is connected" in rig.tells("refused: ")


@pytest.mark.slow
def test_the_example_in_the_documentation_runs(tmp_path: Path) -> None:
    """As a user does it: the command, the example, Ctrl-C, and the log."""
    page = Path(__file__).parents[3] / "docs/companions/franka_box.md"
    example = page.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    assert len(example.strip().splitlines()) <= 14
    host, log = next(addresses()), tmp_path / "example.npz"
    with subprocess.Popen(
        [*COMMAND, "--host", host, "--log", log], stdout=subprocess.PIPE, text=True
    ) as box:
        try:
            await_start(box)
            source = example.replace("127.0.0.1", host)
            client = subprocess.run(
                [sys.executable, "-c", source],
                capture_output=True, text=True, timeout=LONGEST,
            )  # fmt: skip
            assert client.returncode == 0, client.stderr
            box.send_signal(signal.SIGINT)
            said, _ = box.communicate(timeout=LONGEST)
        finally:
            box.kill()
    assert box.returncode == 0
    assert "motion ended: the client has finished it (2999 commands, 0 lost)" in said
    assert f"Log: {log}" in said
    run = Rollout.load(log)
    moved = np.asarray(run["q"])[-1] - home()
    assert moved == pytest.approx([0, 0, 0, 0.3, 0, 0, 0], abs=0.01)
    assert np.asarray(run["t"])[-1] == pytest.approx(3.0, abs=0.2)
