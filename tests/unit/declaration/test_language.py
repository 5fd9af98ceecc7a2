"""Mistakes in Python and in YAML: a message uses the syntax of the input."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from wording import wording

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


# Input in Python and its message; input of --set and its message.
MISTAKES: list[tuple[Callable[[Any], Any], str, str, str]] = [
    (lambda _: hsp.FramePose("hand", "circle"),
     "'circle', a str ... hsp.trajectories.Circle(",
     "tasks.hand.trajectory=circle", "'circle' is text ... {type: circle}"),
    (lambda _: hsp.FramePose("hand", lambda t: t),
     "function <lambda> ... hsp.trajectories.CallableTrajectory",
     "tasks.hand.trajectory=sin(t)", "'sin(t)' is text ... a mapping"),
    (lambda _: hsp.FramePosition("hand", HOME), "trajectory: an SE3 ... .translation",
     "tasks.hand.trajectory=[0.4, 0, 0.5]",
     "is a list ... {type: 'hold', point: [0.4, 0.0, 0.5]}"),
    (lambda _: hsp.FramePose("hand", HOME, gains=100), "gains: 100, an int ... Gains(",  # type: ignore[arg-type]
     "tasks.hand.gains=100", "100 is an integer ... a mapping of kp"),
    (lambda _: hsp.Gains(kp=True), "kp: True is a bool ... a number",
     "tasks.hand.gains={kp: True}", "true is a boolean ... a number"),
    (lambda _: hsp.Circle(None, 1.0), "radius: None ... a number",  # type: ignore[arg-type]
     "tasks.hand.trajectory={type: circle, radius: , angular_rate: 1}",
     "radius: nothing given ... a number"),
    (lambda _: hsp.ObstacleClearance("ball"), "'ball' is a str ... a list",
     "null_space.fields=[{type: obstacle_clearance, obstacles: ball}]",
     "'ball' is text ... a list of texts"),
    (lambda _: hsp.FunctionCost("height"), "'height' is a str ... function",  # type: ignore[arg-type]
     "null_space.fields=[{type: function_cost, function: height}]",
     "no function 'height' ... --import FILE.py"),
    (lambda r: compose(r, metric="mass_matrix"),
     "metric is 'mass_matrix', a str ... hsp.metrics.MassMatrixMetric(",
     "null_space.metric=mass_matrix", "{type: mass_matrix}"),
    (lambda r: compose(r, field=hsp.Rest), "field is Rest, a class ... an instance",
     "null_space.fields=[{type:rest}]", "unknown ... 'type:rest' ... a space"),
    (lambda r: compose(r, limits=False), "limits is False, a bool ... Limits(",
     "limits=None", "'None' is text ... 'none'"),
    (lambda r: compose(r, null_space_gain="10"), "null_space_gain is '10' ... number",
     "null_space.gain='10'", "'10' is text ... a number"),
    (lambda r: hsp.Controller(r, {"hand": hsp.FramePose()}), "tasks is {'hand': Frame",
     "tasks.hnad.blend=1", "tasks.hnad: missing ... 'type'"),
    (lambda r: compose(r.model), "Robot.from_pinocchio(model)",
     "robot=panda", "'panda' is text ... a mapping of name"),
    (lambda r: compose(r).compute(0.0, np.rad2deg(r.home()), np.zeros(7)),
     "-45 rad ... -1.7628 to 1.7628 rad: degrees?",
     "start={joints: {panda_joint2: -45}}", "-45"),
    (lambda r: compose(r).compute(r.home(), np.zeros(7)), "RobotState ... v is missing",
     "null_space=rest", "'rest' is text ... a mapping of"),
    (lambda r: run(r, duration=2.0, control_period=1.0),
     "control_period: 1 s ... milliseconds ... 0.001 ... log_period ... 1",
     "simulation.control_period=1", "log_period ... 1"),
    (lambda _: hsp.load_experiment("panda"), "'panda' is a robot ... Robot.load(",
     "simulation.integrator=rk4", "'rk4' is text ... {type: rk4}"),
    (lambda _: hsp.load_experiment("panda_obstacle", "view=3"), "'view=3': view: 3",
     "view=3", "--set view=3: view: 3 ... a mapping of"),
    (lambda _: hsp.Rollout.load("mine.yaml"), "mine.yaml: ... load_experiment(",
     "view.title", "--set view.title: needs"),
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
    assert re.search(wording(f"... {python}"), str(caught.value))
    file = tmp_path / "mine.yaml"
    file.write_text(YAML)
    assert main(["check", str(file), "--set", override]) == 2
    reported = capsys.readouterr().err
    assert re.search(wording(f"... {yaml}"), reported)
    assert reported.count("hsp: ") == 1


def test_a_command_suggests_the_likely_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "panda"]) == 2
    assert re.search("'panda' is a robot.* hsp play panda", capsys.readouterr().err)
