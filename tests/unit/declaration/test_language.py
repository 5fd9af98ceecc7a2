"""Mistakes, in Python and in YAML: each message speaks the language that was typed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hsp_control as hsp
from hsp_control.cli import main

HOME = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.4, 0.0, 0.5]))
YAML = """\
robot: {name: panda}
tasks: {hand: {type: frame_pose, blend: 1.0}}
simulation: {duration: 0.01, control_period: 0.001}
"""


@pytest.fixture(scope="module")
def panda() -> hsp.Robot:
    return hsp.Robot.load("panda")


def compose(robot: Any, **others: Any) -> hsp.Controller:
    """Return a controller with one task."""
    return hsp.Controller(robot, [hsp.FramePose("panda_hand", HOME)], **others)


def run(robot: hsp.Robot, **times: float) -> hsp.Rollout:
    """Run a controller with one task."""
    return hsp.simulate(compose(robot), robot.home(), **times)


# What is typed in Python, and its message; what is given to --set, and its message.
MISTAKES: list[tuple[Callable[[Any], Any], str, str, str]] = [
    (lambda _: hsp.FramePose("hand", "circle"), "'circle', a str; needs a Trajectory "
     "or a PoseTrajectory; did you mean hsp.trajectories.Circle(...)?",
     "tasks.hand.trajectory=circle",
     "'circle' is text; expected a mapping; did you mean {type: circle}?"),
    (lambda _: hsp.FramePose("hand", lambda t: t), "the function <lambda>; needs a "
     "Trajectory or a PoseTrajectory, such as hsp.trajectories.CallableTrajectory of",
     "tasks.hand.trajectory=sin(t)", "'sin(t)' is text; expected a mapping"),
    (lambda _: hsp.FramePosition("hand", HOME), "trajectory: an SE3; needs a Trajectory"
     ": give its .translation", "tasks.hand.trajectory=[0.4, 0, 0.5]", "is a list; "
     "expected a mapping; did you mean {type: 'hold', point: [0.4, 0.0, 0.5]}?"),
    (lambda _: hsp.FramePose("hand", HOME, gains=100), "gains: 100, an int; needs a "  # type: ignore[arg-type]
     "Gains(kp, kv, natural_frequency, damping_ratio)", "tasks.hand.gains=100",
     "100 is an integer; expected a mapping of kp, kv, natural_frequency, damping_"),
    (lambda _: hsp.Gains(kp=True), "kp: True is a bool; expected a number, ",
     "tasks.hand.gains={kp: True}", "true is a boolean; expected a number, "),
    (lambda _: hsp.Circle(None, 1.0), "radius: None; expected a number",  # type: ignore[arg-type]
     "tasks.hand.trajectory={type: circle, radius: , angular_rate: 1}",
     "radius: nothing given; expected a number"),
    (lambda _: hsp.ObstacleClearance("ball"), "'ball' is a str; expected a list of te",
     "null_space.fields=[{type: obstacle_clearance, obstacles: ball}]",
     "'ball' is text; expected a list of texts"),
    (lambda _: hsp.FunctionCost("height"), "'height' is a str; needs the function it",  # type: ignore[arg-type]
     "null_space.fields=[{type: function_cost, function: height}]",
     "no function 'height' was imported (there is none); --import FILE.py runs"),
    (lambda r: compose(r, metric="mass_matrix"), "metric is 'mass_matrix', a str; "
     "needs a Metric; did you mean hsp.metrics.MassMatrixMetric(...)?",
     "null_space.metric=mass_matrix", "did you mean {type: mass_matrix}?"),
    (lambda r: compose(r, field=hsp.Rest), "field is Rest, a class; give an instance",
     "null_space.fields=[{type:rest}]", "unknown key 'type:rest'; write a space after"),
    (lambda r: compose(r, limits=False), "limits is False, a bool; needs a Limits(eff",
     "limits=None", "'None' is text; expected a mapping or 'none'; did you mean 'none"),
    (lambda r: compose(r, null_space_gain="10"), "null_space_gain is '10'; needs num",
     "null_space.gain='10'", "'10' is text; expected a number"),
    (lambda r: hsp.Controller(r, {"hand": hsp.FramePose()}), "tasks is {'hand': Frame",
     "tasks.hnad.blend=1", "tasks.hnad: missing key 'type'; type is one of: "),
    (lambda r: compose(r.model), "needs Robot.from_pinocchio(model)", "robot=panda",
     "'panda' is text; expected a mapping of name, "),
    (lambda r: compose(r).compute(0.0, np.rad2deg(r.home()), np.zeros(7)),
     "is at -45 rad, but its range is from -1.7628 to 1.7628 rad: degrees?",
     "start={joints: {panda_joint2: -45}}", "-45"),
    (lambda r: compose(r).compute(r.home(), np.zeros(7)), "RobotState; v is missing",
     "null_space=rest", "'rest' is text; expected a mapping of "),
    (lambda r: run(r, duration=2.0, control_period=1.0), "control_period: a row is "
     "logged every 0.01 s by default, which is not a whole "
     "multiple of 1 s; give log_period, too, for example 1",
     "simulation.control_period=1", "give log_period, too, for example 1"),
    (lambda _: hsp.load_experiment("panda"), "'panda' is a robot, and this needs a conf"
     "iguration; Robot.load('panda') loads", "simulation.integrator=rk4",
     "'rk4' is text; expected a mapping; did you mean {type: rk4}?"),
    (lambda _: hsp.load_experiment("panda_obstacle", "view=3"), "'view=3': view: 3 is",
     "view=3", "--set view=3: view: 3 is an integer; expected a mapping of "),
    (lambda _: hsp.Rollout.load("mine.yaml"), "mine.yaml: a configuration, not a log; "
     "load_experiment(...).run() makes one", "view.title", "--set view.title: needs "),
]  # fmt: skip


@pytest.mark.parametrize("row", MISTAKES, ids=[row[1][:40] for row in MISTAKES])
def test_a_message_speaks_the_language_that_was_typed(
    row: tuple[Callable[[Any], Any], str, str, str],
    panda: hsp.Robot,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed, python, override, yaml = row
    with pytest.raises(hsp.HspControlError) as caught:
        typed(panda)
    assert python in str(caught.value)
    file = tmp_path / "mine.yaml"
    file.write_text(YAML)
    assert main(["check", str(file), "--set", override]) == 2
    said = capsys.readouterr().err
    assert yaml in said
    assert said.count("hsp: ") == 1


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["run", "panda"], "'panda' is a robot, and this needs a configuration; hsp "
         "play panda drives the robot"),
    ],
)  # fmt: skip
def test_a_command_says_which_one_was_meant(
    command: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    assert message in capsys.readouterr().err


def test_a_singular_start_is_told_after_the_run_as_by_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stretched = ["paper/4_moving_obstacle", "--set", "start.coordinates=[0, 0, 0]"]
    assert main(["check", *stretched]) == 0
    advice = capsys.readouterr().out.splitlines()[-5:-1]
    short = ["--set", "simulation.duration=0.1", "--out", str(tmp_path)]
    assert main(["run", *stretched, *short]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[-len(advice) :] == [f"hsp: {line}" for line in advice]
