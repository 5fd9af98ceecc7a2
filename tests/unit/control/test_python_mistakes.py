"""What is mistyped in Python is named: arguments, numbers, and names of modules."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.errors import (
    ControllerError,
    GainError,
    LiveError,
    LogError,
    NonFiniteError,
    SceneError,
    SimulationError,
    StreamError,
    TaskError,
)
from hsp_control.live import InProcessRobot, SimulatedRobot

Made = Callable[[hsp.Controller], Any]


def controller(**options: Any) -> hsp.Controller:
    task = hsp.FramePosition("panda_hand", hsp.Stream())
    return hsp.Controller(hsp.Robot.load("panda"), [task], **options)


def turned() -> hsp.Controller:
    return hsp.Controller(hsp.Robot.load("panda"), [hsp.FramePose("panda_hand")])


def pointing() -> hsp.Controller:
    eye = hsp.Pointing(direction=[0, 0, -1], name="eye")
    made = hsp.Controller(hsp.Robot.load("panda"), [eye])
    made.compute(0.0, made.robot.home(), np.zeros(7))
    return made


def still(c: hsp.Controller) -> InProcessRobot:
    """Return a robot at rest."""
    model, rk4 = hsp.plants.RigidBodyPlant(c.robot), hsp.integrators.Rk4(0.001)
    plant, rest = hsp.plants.IntegratedPlant(model, rk4), np.zeros(c.robot.nv)
    return InProcessRobot(SimulatedRobot(plant, c.robot.home(), rest, 0.001))


@pytest.mark.parametrize(("mistake", "error", "message"), [
    (lambda c: hsp.simulate(c, c.robot.home(), duration="1"),
     SimulationError, r"duration is '1'; needs a positive number \[s\]"),
    (lambda c: c.applied(np.zeros(7), "1ms"), ControllerError, "period is '1ms'"),
    (lambda c: c.applied(np.zeros(7), True), ControllerError, "period is True"),
    (lambda c: c.applied(np.zeros(7), np.nan), ControllerError, "period is nan s"),
    (lambda c: hsp.run_loop(c, still(c), duration="1"), LiveError, "duration is '1'"),
    (lambda c: c.prepare("home"), ControllerError, "state is 'home', a str"),
    (lambda c: c.at("1"), ControllerError, "at is '1'; needs a number"),
    (lambda c: c.at(1).ramp("1"), ControllerError, "ramp is '1'; needs a number"),
    (lambda c: c.at(1).payload("panda_hand", mas=1), TypeError, "did you mean 'mass'"),
    (lambda c: c.at(1).payload(), TypeError, "payload: missing .*'frame'"),
    (lambda c: c.stream("panda_hand").send(vel=[1, 0, 0]),
     TypeError, "did you mean 'velocity'"),
    (lambda c: c.stream("panda_hand").send([1, 0]),
     StreamError, "^tasks.panda_hand: value has 2 numbers; .* needs 3"),
    (lambda c: controller(null_space_gain=True), GainError, "is True; needs numbers"),
    (lambda c: hsp.Stream(source="upd://127.0.0.1:5000"),
     StreamError, "did you mean 'udp://'"),
    (lambda c: hsp.Controller(c.robot, [
        hsp.FramePosition("panda_hand", hsp.Stream(source="nosuch.jsonl"))]),
     StreamError, r"^tasks.panda_hand.trajectory: nosuch.jsonl: .* be read"),
    (lambda c: controller(scene=[hsp.Obstacle("o", hsp.Sphere(0.1), [1, 1, 1])]).at(
        1.0).obstacle("o", hsp.Stream(messages=[{"at": 0, "value": [1, 2]}])),
     StreamError, r"^center: message 0 of the recording: value has 2 .* needs 3"),
    (lambda c: c.at(1).reference(
        "panda_hand", hsp.Stream(messages=[{"at": 0, "value": [1, 2]}])),
     StreamError, r"^trajectory: message 0 of the recording: value has 2 .* needs 3"),
    (lambda c: controller(scene=[hsp.Obstacle("o", hsp.Sphere(0.1), [1, 1, 1])]).at(
        1.0).obstacle("o", [0.3, 0.3]), SceneError, r"^center: its dimension is 2"),
    (lambda c: turned().at(1).gains("panda_hand", hsp.Gains(1.0, [1.0, 2.0])),
     GainError, "^gains: kv"),
    (lambda c: c.at(1).impedance("panda_hand", hsp.Impedance(stiffness=9.0)),
     ControllerError, "^task: 'panda_hand' has no impedance"),
    (lambda c: c.at(1).add(hsp.FramePose("panda_hand")),
     ControllerError, "^task: two tasks"),
    (lambda c: hsp.FramePosition("panda_hand", along="tool"),
     TaskError, "unknown argument 'along'; FramePose has it"),
    (lambda c: hsp.Recorder(c, 3), LogError, "^path is 3; needs a file"),
    (lambda c: c.at(1).limits("tight"),
     ControllerError, r"limits is 'tight', a str; needs a Limits\("),
    (lambda c: c.at(1).limits("none"), ControllerError, "in Python it is None"),
    (lambda c: c.at(1).remove("panda_hnad"), ControllerError, "^task: .*'panda_hand'"),
    (lambda c: c.change("gravity"), ControllerError, "change is 'gravity'.*ChangeGrav"),
    (lambda c: c.change(hsp.changes.ChangeGravity),
     ControllerError, "change is ChangeGravity, a class"),
    (lambda c: c.preview(["x"]), ControllerError, "changes contains 'x'"),
    (lambda c: c.restart(origin="now"), NonFiniteError, "origin is 'now'"),
    (lambda c: c.prepare(lifted=["foot"]), ControllerError, "no contact 'foot'"),
    (lambda c: c.prepare(without=["panda_hnad"]),
     ControllerError, "no task 'panda_hnad'; did you mean 'panda_hand'"),
    (lambda c: c.stack_at(c.robot.home()), ControllerError, "needs a RobotState"),
    (lambda c: c.at(0.9).gains("panda_hand", hsp.Gains(natural_frequency=9.0))
        and c.at(0.5).remove("panda_hand"),
     ControllerError, "ChangeGains at t = 0.9 s would not fit .*'panda_hand'"),
    (lambda c: pointing().set_target("eye", [0, 0, 0]),
     ControllerError, r"direction is \[0.0, 0.0, 0.0\]; must be non-zero"),
    (lambda c: turned().set_target("panda_hand", [0.4, 0, 0.5, 2, 0, 0, 0]),
     ControllerError, "^a target of task 'panda_hand': rotation: .* norm 1; it has 2"),
])  # fmt: skip
def test_it_is_named(mistake: Made, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        mistake(controller())


@pytest.mark.parametrize(("look_up", "meant"), [
    (lambda: hsp.FramPose, "FramePose"),
    (lambda: hsp.plots.draw_eforts, "draw_efforts"),
])  # fmt: skip
def test_python_says_which_name_was_meant(
    look_up: Callable[[], Any], meant: str
) -> None:
    """A traceback suggests names of the object that an AttributeError carries."""
    with pytest.raises(AttributeError) as raised:
        look_up()
    assert meant in dir(raised.value.obj)
    assert raised.value.name not in dir(raised.value.obj)


def test_an_error_inside_a_method_stays_what_it_is() -> None:
    """A TypeError of the body is not taken for one of the call."""

    def on_row(*_: Any) -> None:
        raise TypeError("mine")

    made = controller()
    with pytest.raises(TypeError, match=r"^mine$"):
        hsp.simulate(made, made.robot.home(), duration=0.1, on_row=on_row)


def test_a_command_that_ends_a_source_says_so() -> None:
    listening = hsp.Stream(messages=[{"at": 0.0, "value": [0.3, 0.0, 0.6]}])
    robot = hsp.Robot.load("panda")
    made = hsp.Controller(robot, [hsp.FramePosition("panda_hand", listening)])
    made.compute(0.0, robot.home(), np.zeros(7))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing is taken over by what is refused
        with pytest.raises(StreamError, match="velocity has 2 numbers"):
            made.set_velocity("panda_hand", [0.1, 0.0])
    with pytest.warns(UserWarning, match=r"'panda_hand' follows a recording no longer"):
        made.set_target("panda_hand", [0.4, 0.0, 0.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is said once: this stream is sent to
        made.set_target("panda_hand", [0.4, 0.0, 0.6])
