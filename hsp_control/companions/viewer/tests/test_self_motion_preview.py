"""A preview of self-motion: task errors are constant, and the elbow moves."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.companions.viewer import self_motion_preview
from hsp_control.companions.viewer.commands import unpack
from hsp_control.companions.viewer.self_motion_preview import (
    PreviewDrawing,
    SelfMotion,
    SelfMotionPreview,
)
from hsp_control.control.interface import Controller


@pytest.mark.parametrize("name", ["panda_obstacle", "iiwa_null_space", "ur5_position"])
def test_the_hand_rests_while_the_elbow_moves(name: str) -> None:
    experiment = load_experiment(name)
    controller = experiment.controller
    before = controller.compute(0.0, experiment.q0, experiment.v0).tau.copy()
    motion = SelfMotionPreview(controller).curve(0.0, experiment.q0)
    assert motion is not None
    assert np.linalg.norm(np.ptp(motion.elbow, axis=0)) > 0.3  # m
    probe = controller.preview()
    robot, errors = controller.robot, []
    for q in motion.configurations:
        output = probe.compute(0.0, q, np.zeros(robot.nv))
        errors.append(np.concatenate([output.error(t.name) for t in probe.tasks]))
        low, high = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
        assert ((q >= low) & (q <= high)).all()
    # Two Newton steps after every step of 0.1 rad.
    np.testing.assert_allclose(errors, np.tile(errors[0], (len(errors), 1)), atol=1e-5)
    steps = [
        robot.difference(one, other)
        for one, other in zip(
            motion.configurations, motion.configurations[1:], strict=False
        )
    ]
    assert np.linalg.norm(steps, axis=1).max() < 0.2
    assert any(np.array_equal(q, experiment.q0) for q in motion.configurations)
    again = controller.compute(0.0, experiment.q0, experiment.v0).tau
    np.testing.assert_array_equal(again, before)  # the controller has not moved


def test_where_tasks_leave_nothing_free_there_is_none() -> None:
    experiment = load_experiment(
        {
            "robot": {"name": "ur5"},
            "start": "auto",
            "tasks": {"hand": {"type": "frame_pose"}},
        }
    )
    controller = experiment.controller
    controller.compute(0.0, experiment.q0, experiment.v0)
    assert SelfMotionPreview(controller).curve(0.0, experiment.q0) is None


def test_a_preview_is_drawn_when_it_is_there_and_then_removed() -> None:
    experiment = load_experiment("panda_obstacle")
    controller = experiment.controller
    controller.compute(0.0, experiment.q0, experiment.v0)
    drawing = PreviewDrawing(experiment.robot)
    commands = list(drawing.draw(controller, on=True))
    assert commands == []  # a thread has started to compute it
    assert drawing._coming is not None
    drawing._coming.result()
    drawn = [unpack(each.packed) for each in drawing.draw(controller, on=True)]
    assert [each["type"] for each in drawn] == [
        "trail", "set_object", "set_transform", "ghosts",
    ]  # fmt: skip
    assert drawn[-1]["count"] == 5
    removed = [unpack(each.packed) for each in drawing.draw(controller, on=False)]
    assert [each["type"] for each in removed] == ["delete", "ghosts"]
    assert removed[-1]["count"] == 0
    assert list(drawing.draw(controller, on=False)) == []


def drawn(drawing: PreviewDrawing, controller: Controller) -> Iterator[dict[str, Any]]:
    for each in drawing.draw(controller, on=True):
        yield unpack(each.packed)


def test_after_a_new_beginning_the_controller_of_then_is_previewed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    previewed = list[Controller]()

    class Preview:
        def __init__(self, controller: Controller) -> None:
            previewed.append(controller)

        def curve(self, *_: object) -> None:
            pass

    monkeypatch.setattr(self_motion_preview, "SelfMotionPreview", Preview)
    experiments = [load_experiment("panda_obstacle") for _ in range(2)]
    drawing = PreviewDrawing(experiments[0].robot)
    for each in experiments:
        each.controller.compute(0.0, each.q0, each.v0)
        drawing.begin()
        assert list(drawn(drawing, each.controller)) == []
    assert previewed == [each.controller for each in experiments]


def test_a_ball_is_where_the_cost_is_least(monkeypatch: pytest.MonkeyPatch) -> None:
    experiment = load_experiment("panda_obstacle")
    controller, q = experiment.controller, experiment.q0
    controller.compute(0.0, q, experiment.v0)
    elbow = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]])
    motion = SelfMotion(np.tile(q, (3, 1)), elbow, np.array([2.0, 1.0, 3.0]))
    monkeypatch.setattr(SelfMotionPreview, "curve", lambda *_: motion)
    drawing = PreviewDrawing(experiment.robot)
    assert list(drawn(drawing, controller)) == []
    assert drawing._coming is not None
    drawing._coming.result()
    (ball,) = (
        each for each in drawn(drawing, controller) if each["type"] == "set_transform"
    )
    assert np.ravel(ball["matrix"])[12:15] == pytest.approx(elbow[1])
