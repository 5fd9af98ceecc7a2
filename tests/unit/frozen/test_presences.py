"""Tasks and fields of a frozen controller come and go as on a time line."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frozen_library import OK, TOO_MANY, WRONG_NAME, WRONG_VALUE, Opened

import hsp_control as hsp
from hsp_control.common.exceptions import FreezeError
from hsp_control.control.change import Change
from hsp_control.control.setup import Setup
from hsp_control.null_space.fields.weight import Ramp
from hsp_control.trajectories import StreamPose

H = 0.001
ROBOT = hsp.Robot.load("panda")
Q = ROBOT.home()


class ChangePresence(Change):
    """A task fades in or out, from however far it is present."""

    task: str
    """Its name."""
    presence: float
    """How far it is present then."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this presence of the task."""
        planned = next(each for each in setup.tasks if each.task.name == self.task)
        presence = planned.presence.then(self.at, self.ramp, self.presence)
        return setup.with_task(planned, presence=presence)


def hand(**given: Any) -> hsp.Task:
    circle = hsp.Circle(radius=0.1, angular_rate=2.0)
    return hsp.FramePosition("panda_tcp", circle, name="hand", **given)


def turn(**given: Any) -> hsp.Task:
    return hsp.FrameOrientation("panda_tcp", name="turn", **given)


def elbow(**given: Any) -> hsp.Task:
    return hsp.FramePosition("panda_link4", name="elbow", axes="y", **given)


class Pair:
    """A controller in Python, and the same without."""

    def __init__(
        self, declared: hsp.Controller, folder: Path, presences: Sequence[str]
    ) -> None:
        file = hsp.freeze(declared, folder / "frozen.hsp", presences=presences)
        self.controller, self.opened = declared.preview(), Opened(file)
        start = declared.setup.start.state
        self.q, self.nv, self.k = start.q, start.robot.nv, 0

    def presence(self, name: str, x: float, ramp: float) -> None:
        change = ChangePresence(name, x, at=(self.k - 1) * H, ramp=ramp)
        self.controller.change(change)
        assert self.opened.ramp(f"{name}.presence", x, ramp) == OK

    def run(
        self,
        until: int,
        changes: Mapping[int, Sequence[tuple[str, float, float]]],
        fast: float = 0.1,
    ) -> set[int]:
        """Step both, and compare the bits; return the statuses."""
        met = set()
        robot = self.controller.robot
        while self.k < until:
            t, k = self.k * H, self.k
            q = robot.integrate(self.q, 0.02 * np.sin(0.1 * k + np.arange(self.nv)))
            v = fast * np.cos(0.1 * k + np.arange(self.nv))
            output = self.controller.compute(t, q, v)
            self.controller.applied(output.tau, H)
            assert self.opened.step(t, q, v) == output.status, k
            np.testing.assert_array_equal(self.opened.tau, output.tau, err_msg=f"{k}")
            met.add(int(output.status))
            self.k += 1
            for name, x, ramp in changes.get(k, ()):
                self.presence(name, x, ramp)
        return met


@pytest.mark.smoke
@pytest.mark.parametrize("ramp", [0.0, 0.03])
@pytest.mark.parametrize("level", [0, 1])
def test_tasks_come_and_go(level: int, ramp: float, tmp_path: Path) -> None:
    """Several at once, in either order, some not wholly; and again before they went."""
    tasks = [hand(), turn(priority=level), elbow(priority=2 * level)]
    declared = hsp.Controller(ROBOT, tasks, hsp.JointCentering(), start=Q)
    pair = Pair(declared, tmp_path, ["hand", "elbow"])
    changes = {
        5: [("elbow", 0.0, ramp)],
        20: [("hand", 0.0, ramp)],
        30: [("elbow", 1.0, ramp)],
        70: [("hand", 0.4, ramp), ("elbow", 0.6, ramp)],
        110: [("hand", 0.6, ramp), ("elbow", 0.6, 2 * ramp)],
        190: [("hand", 0.0, ramp), ("elbow", 0.0, ramp)],
        240: [("hand", 1.0, ramp)],
    }
    pair.run(300, changes)
    np.testing.assert_array_equal(pair.opened.get("hand.presence", 1), 1.0)
    np.testing.assert_array_equal(pair.opened.get("elbow.presence", 1), 0.0)
    stack = pair.controller.active_stack
    here = stack.task_rows["hand"]
    np.testing.assert_array_equal(
        pair.opened.get("hand.error", 3), stack.rows.error[here]
    )


def test_a_task_is_removed_and_added_as_on_a_time_line(tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], hsp.JointCentering(), start=Q)
    pair = Pair(declared, tmp_path, ["turn"])
    placed = next(each for each in declared.setup.tasks if each.task.name == "turn")
    pair.run(4, {})
    pair.controller.at(3 * H).ramp(0.05).remove("turn")
    assert pair.opened.ramp("turn.presence", 0.0, 0.05) == OK
    pair.run(80, {})
    pair.controller.at(79 * H).ramp(0.02).add(placed.task)
    assert pair.opened.ramp("turn.presence", 1.0, 0.02) == OK
    pair.run(140, {})


def test_within_limits_that_bind(tmp_path: Path) -> None:
    limits = hsp.Limits(effort_scale=0.3)
    declared = hsp.Controller(
        ROBOT, [hand(), turn(priority=1)], hsp.JointCentering(), limits=limits, start=Q
    )
    pair = Pair(declared, tmp_path, ["turn"])
    met = pair.run(
        200, {10: [("turn", 0.0, 0.08)], 120: [("turn", 1.0, 0.05)]}, fast=1.5
    )
    assert {0, 2} <= met


def test_where_the_law_is_damped(tmp_path: Path) -> None:
    """Python mixes there part by part."""
    q = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 0.1, 0.0])  # stretched
    declared = hsp.Controller(ROBOT, [hand(), turn(priority=1)], start=q)
    pair = Pair(declared, tmp_path, ["turn"])
    pair.run(60, {10: [("turn", 0.0, 0.03)]})
    assert pair.opened.get("damped_level", 1)[0] > 0


def test_on_feet(tmp_path: Path) -> None:
    own = hsp.load_experiment("whole_body/solo12_trunk").controller
    given: dict[str, Any] = {"contacts": own.contacts}
    given |= {"start": own.setup.start.state.q, "limits": own.limits}
    declared = hsp.Controller(own.robot, own.tasks, own.field, **given)
    name = own.tasks[-1].name
    pair = Pair(declared, tmp_path, [name])
    pair.run(60, {5: [(name, 0.0, 0.02)], 40: [(name, 1.0, 0.01)]}, fast=0.05)


def test_a_stream_that_comes_and_goes(tmp_path: Path) -> None:
    """What is sent while it is absent is what it follows when it is there again."""
    stream = StreamPose(policy="latest", delay=0.03)
    task = hsp.FramePose("panda_tcp", stream, name="hand")
    declared = hsp.Controller(ROBOT, [task], hsp.JointCentering(), start=Q)
    pair = Pair(declared, tmp_path, ["hand"])
    at = ROBOT.state(0.0, Q, np.zeros(7)).position("panda_tcp")
    target = np.array([*at, 1.0, 0.0, 0.0, 0.0])
    pair.run(30, {5: [("hand", 0.0, 0.01)]})
    for k in range(5):
        target[:3] += 0.01
        pair.controller.stream("hand").send(target)
        assert pair.opened.set("hand.target", target) == OK
        pair.run(32 + k, {})
    pair.presence("hand", 1.0, 0.02)
    pair.run(150, {})


def test_before_the_first_step_it_is_not_there(tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], hsp.JointCentering(), start=Q)
    pair = Pair(declared, tmp_path, ["turn"])
    assert pair.opened.set("turn.presence", 0.0) == OK
    pair.controller.change(ChangePresence("turn", 0.0, at=-1.0, ramp=0.0))
    pair.run(10, {})


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_a_field_whose_weight_is_a_ramp(ramp: float, tmp_path: Path) -> None:
    """It fades by a factor of its weight, in the middle of its own ramp."""
    weight = Ramp(initial=0.5, final=3.0, start=0.01, duration=0.1)
    field = replace(hsp.JointCentering(), weight=weight)
    declared = hsp.Controller(ROBOT, [hand()], field, start=Q)
    pair = Pair(declared, tmp_path, [])
    pair.run(21, {})
    pair.controller.at(20 * H).ramp(ramp).field()
    assert pair.opened.ramp("joint_centering.presence", 0.0, ramp) == OK
    pair.run(60, {})
    assert pair.opened.set("joint_centering.presence", 1.1) == WRONG_VALUE
    assert pair.opened.set("joint_centering.weight", 1.0) == WRONG_NAME


@pytest.mark.parametrize("wrong", [-0.1, 1.1, np.nan, np.inf])
def test_a_presence_is_between_0_and_1(wrong: float, tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], start=Q)
    pair = Pair(declared, tmp_path, ["turn"])
    pair.run(2, {})
    assert pair.opened.set("turn.presence", wrong) == WRONG_VALUE
    assert pair.opened.ramp("turn.presence", 0.0, wrong - 1.1) == WRONG_VALUE
    assert pair.opened.set("hand.presence", 1.0) == WRONG_NAME
    for _ in range(8):
        assert pair.opened.ramp("turn.presence", 0.5, 1.0) == OK
    assert pair.opened.ramp("turn.presence", 0.5, 1.0) == TOO_MANY


@pytest.mark.parametrize(
    ("tasks", "presences", "says"),
    [
        ([hand(), turn()], ["hnad"], r"no task 'hnad'; did you mean 'hand'\?"),
        ([hand(), turn()], ["hand", "hand"], "task 'hand' is named twice"),
        ([hand(impedance=hsp.Impedance(300.0))], ["hand"], "has an impedance"),
    ],
)
def test_which_tasks_come_and_go(
    tasks: list[hsp.Task], presences: list[str], says: str, tmp_path: Path
) -> None:
    declared = hsp.Controller(ROBOT, tasks, start=Q)
    with pytest.raises(FreezeError, match=rf"^presences: .*{says}"):
        hsp.freeze(declared, tmp_path / "frozen.hsp", presences=presences)


def test_compensators_act_on_one_set_of_tasks(tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], start=Q)
    observed = hsp.compensation.Compensation()
    with pytest.raises(FreezeError, match=r"^compensation: .*turn come"):
        hsp.freeze(
            declared, tmp_path / "x.hsp", compensation=observed, presences=["turn"]
        )
