"""Check what is said of angles in degrees, and of a step that calls its controller."""

import re
import threading
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_cases import assert_same, contents, panda, states, track
from hypothesis import given
from hypothesis import strategies as st
from robot_cases import load

import hsp_control as hsp
from hsp_control.cli.main import main
from hsp_control.common.exceptions import ConfigurationError, ControllerError
from hsp_control.control.first_state import (
    JUMP,
    StartWarning,
    warn_of_jump,
)
from hsp_control.control.first_state import REST as REST_SPEED

REST = np.zeros(7)


def holding(**options: Any) -> hsp.Controller:
    return hsp.Controller(panda(), [track()], limits=None, **options)


# --- degrees ------------------------------------------------------------------------


def test_degrees_are_asked_about_at_the_first_state_and_after_a_restart() -> None:
    home = panda().home()
    degrees = np.rad2deg(home)
    message = (
        r"^joint 'panda_joint2' is at -45 rad, but its range is from -1.7628 to "
        r"1.7628 rad: degrees\? Angles are in rad$"
    )
    law = holding()
    with pytest.raises(ConfigurationError, match=message):
        law.compute(0.0, degrees, REST)
    with pytest.raises(ConfigurationError, match=message):
        holding(start=home).compute(panda().state(0.0, degrees, REST))
    with pytest.raises(ConfigurationError, match=message):
        hsp.simulate(law, degrees, duration=0.01, control_period=0.001)
    before = contents(law.compute(0.0, home, REST))
    law.compute(0.0, degrees, REST)  # later states are not looked at
    law.restart()
    with pytest.raises(ConfigurationError, match="degrees"):
        law.compute(0.0, degrees, REST)
    assert_same(contents(law.compute(0.0, home, REST)), before)


# --- the first effort ---------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.sampled_from(["panda", "iiwa14", "ur5"]))
def test_a_jump_of_a_tenth_of_a_limit_is_warned_of(seed: int, name: str) -> None:
    """Of the joint with the largest share, and nothing below; not if it moves."""
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


FIRST_EFFORT = (
    r"the first effort of joint 'panda_joint2' is 21 N·m, but gravity asks for "
    r"-3\.99 N·m: a jump of 29 % of its limit of 87 N·m; let tasks begin gently with "
    r"blend=1\.0 \(YAML blend: 1\.0\), or start on the trajectory with its velocity$"
)


def test_a_loop_of_ones_own_is_told_once_when_it_sends() -> None:
    """What is only computed moves nothing; a restart is another start."""
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
    assert re.fullmatch("hsp: " + FIRST_EFFORT, line)
    assert main([command, "mine.yaml", "--set", "tasks.hand.blend=1"]) == 0
    assert "first effort" not in capsys.readouterr().err


# --- one thread at a time -----------------------------------------------------------

CALLS = (
    "a step of a controller calls the same controller, for example within a field: it "
    "would wait for itself for ever; use the state that the field is given, or a copy, "
    r"controller\.preview\(\)$"
)


@pytest.mark.parametrize(
    "call",
    [
        lambda law, s: law.compute(s.t, s.q, s.v),
        lambda law, s: law.flow(s.t, s.q),
        lambda law, s: law.at(1.0).null_space_gain(3.0),
    ],
)
def test_a_field_that_calls_its_own_controller_is_told(call: Any) -> None:
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
    """It finds the lock taken, also by way of `flow`, and gets its own effort."""
    entered, go = threading.Event(), threading.Event()

    def cost(state: Any) -> float:
        if threading.current_thread().name == "slow" and not go.is_set():
            entered.set()
            go.wait(10.0)
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
    assert entered.wait(10.0)
    for thread in quick:
        thread.start()
    time.sleep(0.05)
    assert not found
    go.set()
    for thread in (slow, *quick):
        thread.join(10.0)
        assert not thread.is_alive()
    assert len(found) == 2
    (one,) = [each for each in found if not isinstance(each, np.ndarray)]
    assert_same(one, expected)
