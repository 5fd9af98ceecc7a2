"""A user's first attempts: degrees, targets, errors, and re-entrant steps."""

import pickle
import re
import threading
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from controller_cases import assert_same, contents, states, track
from hypothesis import given
from hypothesis import strategies as st
from loaded_robots import panda
from robot_cases import load
from wording import wording

import hsp_control as hsp
from hsp_control.cli.main import main
from hsp_control.common.errors import ConfigurationError, ControllerError
from hsp_control.control.first_state import JUMP, StartWarning, warn_of_jump
from hsp_control.control.first_state import REST as REST_SPEED

REST = np.zeros(7)


def holding(**options: Any) -> hsp.Controller:
    return hsp.Controller(panda(), [track()], limits=None, **options)


# --- degrees ------------------------------------------------------------------------


def test_degrees_are_reported_at_the_first_state_and_after_a_restart() -> None:
    home = panda().home()
    degrees = np.rad2deg(home)
    message = wording("joint 'panda_joint2' ... -45 rad ... 1.7628 rad: degrees?")
    law = holding()
    with pytest.raises(ConfigurationError, match=message):
        law.compute(0.0, degrees, REST)
    with pytest.raises(ConfigurationError, match=message):
        holding(start=home).compute(panda().state(0.0, degrees, REST))
    with pytest.raises(ConfigurationError, match=message):
        hsp.simulate(law, degrees, duration=0.01, control_period=0.001)
    before = contents(law.compute(0.0, home, REST))
    law.compute(0.0, degrees, REST)  # later states are not checked
    law.restart()
    with pytest.raises(ConfigurationError, match="degrees"):
        law.compute(0.0, degrees, REST)
    assert_same(contents(law.compute(0.0, home, REST)), before)


# --- a target set by the user -------------------------------------------------------


def pose_of(frame: Any) -> pin.SE3:
    return pin.SE3(frame.rotation, frame.position)


@pytest.mark.parametrize(
    ("task", "frame_value"),
    [
        (hsp.FramePose(), pose_of),
        (hsp.FramePosition(axes="xz"), lambda frame: frame.position[[0, 2]]),
        (hsp.FrameOrientation(), lambda frame: frame.rotation),
        (hsp.FramePose(trajectory=hsp.StreamPose(delay=0.02)), pose_of),
    ],
)
def test_a_target_is_set_at_any_time(task: hsp.Task, frame_value: Any) -> None:
    """Before the first step and after it, and again in a copy; nothing jumps."""
    robot = panda()
    q, v = robot.home(), REST
    near = robot.state(0.0, robot.home() + 0.1, REST).frame("panda_tcp")
    target = frame_value(near)
    law = hsp.Controller(robot, [replace(task, name="hand")], limits=None)
    law.set_target("hand", frame_value(robot.state(0.0, q, v).frame("panda_tcp")))
    before = law.compute(0.0, q, v).tau
    for k in range(1, 1500):
        if k == 100:
            stream = law.set_target("hand", target)
        if k == 200:
            law = pickle.loads(pickle.dumps(law))
            assert type(law.set_target("hand", target)) is type(stream)
            assert len(law.changes) == (not isinstance(task.followed, hsp.StreamPose))
        out = law.compute(1e-3 * k, q, v)
        assert np.abs(out.tau - before).max() < 2.0
        before = out.tau
        v = v + 1e-3 * robot.forward_dynamics(q, v, out.tau)
        q = robot.integrate(q, 1e-3 * v)
    assert np.linalg.norm(out.error("hand")) < 1e-3
    reference, actual = law.tasks[0].measure(law.state)
    np.testing.assert_allclose(actual, reference, atol=1e-3)
    here = frame_value(robot.state(0.0, q, v).frame("panda_tcp"))
    np.testing.assert_allclose(np.array(here), np.array(target), atol=1e-3)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("hnd", REST, "there is no task 'hnd'; did you mean 'hand'"),
        ("hand", [1, 2, 3], "'hand' is a pin.SE3, x, y, z and a quaternion .* got"),
        ("point", [1, 2], r"target of task 'point' is 3 numbers; got \[1, 2\]"),
        ("turned", "up", "is a quaternion .*, or roll, pitch and yaw; got 'up'"),
    ],
)
def test_a_target_of_another_kind_is_refused(
    name: str, value: Any, message: str
) -> None:
    tasks = [
        hsp.FramePose(name="hand", priority=1),
        hsp.FramePosition(name="point", priority=2),
        hsp.FrameOrientation(name="turned", priority=3),
    ]
    with pytest.raises(ControllerError, match=message):
        hsp.Controller(panda(), tasks).set_target(name, value)


def test_errors_by_name_and_their_text() -> None:
    law = holding(null_space_gain=8.0)
    reported = "Controller of panda: 'panda_tcp' ... field rest, K_N = 8 ... no limits"
    assert re.search(wording(reported), repr(law))
    out = law.compute(0.0, panda().home(), REST)
    np.testing.assert_array_equal(out.error("panda_tcp"), out.task.error)
    np.testing.assert_array_equal(out.error_rate("panda_tcp"), out.task.error_rate)
    length = np.linalg.norm(out.task.error)
    assert f", EXACT; |e of panda_tcp| = {length:.3g}, |e_N| = " in repr(out)
    with pytest.raises(
        ControllerError, match="no task 'tcp' is active now; did you mean"
    ):
        out.error("tcp")


# --- the first effort ---------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.sampled_from(["panda", "iiwa14", "ur5"]))
def test_a_jump_of_a_tenth_of_a_limit_is_warned_of(seed: int, name: str) -> None:
    """The joint with the largest share is named; none below, none in motion."""
    robot, rng = load(name), np.random.default_rng(seed)
    q, rest = robot.random_configuration(rng), np.zeros(robot.nv)
    limit = np.asarray(robot.model.effortLimit)
    gravity = robot.inverse_dynamics(q, rest, rest)
    jump = rng.uniform(-0.999, 0.999, robot.nv) * JUMP * limit
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_jump(robot, q, rest, gravity + jump)
    j = int(rng.integers(robot.nv))
    jump[j] = rng.choice([-1.0, 1.0]) * 1.001 * JUMP * limit[j]
    with pytest.warns(StartWarning, match=f"joint '{robot.dof_names[j]}' is"):
        warn_of_jump(robot, q, rest, gravity + jump)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_jump(robot, q, rest + 0.1, gravity + jump)


FIRST_EFFORT = wording(
    "... joint 'panda_joint2' ... 21.1 N·m ... -3.99 N·m ... 29 % ... 87 N·m ... blend"
)


def test_a_user_s_loop_is_warned_once_when_it_sends() -> None:
    """`compute` alone moves no robot; after a restart the check runs again."""
    circle = hsp.Circle(radius=0.1, angular_rate=2.0)
    hand = hsp.FramePose("panda_tcp", circle)
    law = hsp.Controller(panda(), [hand], hsp.JointCentering(), limits=None)
    noise = np.full(7, 0.9 * REST_SPEED)

    def send(v: np.ndarray) -> None:
        law.applied(law.compute(0.0, panda().home(), v).tau, 0.001)

    for _ in range(2):
        with pytest.warns(StartWarning, match="^the first effort of joint") as said:
            send(noise)
        assert [each.filename for each in said] == [__file__]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            send(noise)
            law.restart()
            law.compute(0.0, panda().home(), REST)


@pytest.mark.parametrize("command", ["check", "run"])
def test_the_commands_warn_of_the_first_effort(
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (
        "robot: {name: panda}\n"
        "tasks: {hand: {type: frame_pose, trajectory: {type: circle, radius: 0.1, "
        "angular_rate: 2}}}\n"
        "null_space: {fields: [{type: joint_centering}]}\n"
        "simulation: {duration: 0.01, control_period: 0.001}\n"
    )
    Path("mine.yaml").write_text(text, encoding="utf-8")
    assert main([command, "mine.yaml"]) == 0
    (line,) = [
        each for each in capsys.readouterr().err.splitlines() if "first effort" in each
    ]
    assert re.search("^hsp: .*" + FIRST_EFFORT, line)
    assert main([command, "mine.yaml", "--set", "tasks.hand.blend=1"]) == 0
    assert "first effort" not in capsys.readouterr().err


# --- one thread at a time -----------------------------------------------------------

CALLS = wording("... calls the same controller ... controller.preview()")


@pytest.mark.parametrize(
    "call",
    [
        lambda law, s: law.compute(s.t, s.q, s.v),
        lambda law, s: law.flow(s.t, s.q),
        lambda law, s: law.at(1.0).null_space_gain(3.0),
    ],
)
def test_a_field_that_calls_its_controller_raises(call: Any) -> None:
    armed = False

    def cost(state: Any) -> float:
        if armed:
            call(law, state)
        return float(state.q @ state.q)

    law = holding(field=hsp.FunctionCost(cost))
    t, q, v = states(1)[0]
    before = contents(law.compute(t, q, v))
    for form in ((t, q, v), (panda().state(t, q, v),)):
        armed = True
        with pytest.raises(ControllerError, match=CALLS):
            law.compute(*form)
        armed = False
        assert_same(contents(law.compute(t, q, v)), before)  # the lock is free again


def test_another_thread_waits() -> None:
    """It finds the lock held, also through `flow`, and gets its own effort."""
    entered, go = threading.Event(), threading.Event()

    def cost(state: Any) -> float:
        if threading.current_thread().name == "slow" and not go.is_set():
            entered.set()
            go.wait(60.0)
        return float(state.q @ state.q)

    law = holding(field=hsp.TargetPosture("home") + hsp.FunctionCost(cost))
    first, second = states(2)
    expected = contents(law.compute(*second))
    found: list[Any] = []
    slow = threading.Thread(target=lambda: law.compute(*first), name="slow")
    quick = [
        threading.Thread(target=lambda: found.append(contents(law.compute(*second)))),
        threading.Thread(target=lambda: found.append(law.flow(*second[:2]))),
    ]
    slow.start()
    assert entered.wait(60.0)
    for thread in quick:
        thread.start()
    time.sleep(0.05)
    assert not found
    go.set()
    for thread in (slow, *quick):
        thread.join(60.0)
        assert not thread.is_alive()
    assert len(found) == 2
    (one,) = [each for each in found if not isinstance(each, np.ndarray)]
    assert_same(one, expected)


def test_a_base_without_an_arm_is_driven(tmp_path: Path) -> None:
    """It has no reach, from which bounds of errors would follow."""
    urdf = tmp_path / "cart.urdf"
    urdf.write_text(
        '<robot name="cart"><link name="world"/><link name="cart"><inertial>'
        '<mass value="10"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link><joint name="base" type="planar"><parent link="world"/>'
        '<child link="cart"/><axis xyz="0 0 1"/></joint></robot>'
    )
    robot = hsp.Robot.load(urdf)
    task = hsp.FramePosition("cart", hsp.Hold([1.0, 0.0]), axes="xy")
    run = hsp.simulate(hsp.Controller(robot, [task]), robot.home(), duration=2.0)
    assert np.abs(run["task.cart.error"][-1]).max() < 1e-6
