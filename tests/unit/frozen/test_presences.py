"""Tasks and fields of a frozen controller fade as on a time line."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frozen_library import OK, TOO_MANY, WRONG_NAME, WRONG_VALUE, Opened
from pydantic import InstanceOf

import hsp_control as hsp
from hsp_control.common.errors import FreezeError
from hsp_control.control.change import Change
from hsp_control.control.evolution import ABSENT
from hsp_control.control.planned import planned_task
from hsp_control.control.setup import Setup
from hsp_control.null_space.fields.weight import Ramp
from hsp_control.trajectories import StreamPose

H = 0.001
BARE = hsp.compensation.Compensation(momentum_observer=None)
ROBOT = hsp.Robot.load("panda")
Q = ROBOT.home()


class ChangePresence(Change):
    """A task fades in or out from its current weight."""

    task: InstanceOf[hsp.Task]
    """The task, placed."""
    place: int
    """Its index among all tasks, to which it returns after an absence."""
    presence: float
    """Its weight at the end."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this weight of the task."""
        at, ramp, x = self.at, self.ramp, self.presence
        for each in setup.tasks:
            if each.task.name == self.task.name:
                return setup.with_task(each, presence=each.presence.then(at, ramp, x))
        new = planned_task(setup.count, self.task, ABSENT.then(at, ramp, x))
        tasks = [*setup.tasks]
        tasks.insert(self.place, new)
        return replace(setup, tasks=tuple(tasks), count=setup.count + 1)


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
        self,
        declared: hsp.Controller,
        folder: Path,
        presences: Sequence[str],
        chain: hsp.compensation.Compensation = BARE,
    ) -> None:
        file = folder / "frozen.hsp"
        hsp.freeze(declared, file, presences=presences, compensation=chain)
        self.controller, self.opened = declared.preview(), Opened(file)
        command = hsp.compensation.CompensatedController
        self.command = command(self.controller, chain)
        start = declared.setup.start.state
        self.q, self.nv, self.k = start.q, start.robot.nv, 0
        self.tasks: list[hsp.Task] = []  # placed, with the streams of this run

    def presence(self, name: str, x: float, ramp: float) -> None:
        self.change(name, x, (self.k - 1) * H, ramp)
        assert self.opened.ramp(f"{name}.presence", x, ramp) == OK

    def change(self, name: str, x: float, at: float, ramp: float) -> None:
        """Add a task to the controller in Python from a time on."""
        tasks = self.tasks or [x.task for x in self.controller.setup.tasks]
        place = [each.name for each in tasks].index(name)
        task = tasks[place]
        self.controller.change(ChangePresence(task, place, x, at=at, ramp=ramp))

    def run(
        self,
        until: int,
        changes: Mapping[int, Sequence[tuple[str, float, float]]],
        fast: float = 0.1,
        rtol: float = 0.0,
    ) -> set[int]:
        """Step both, and compare the bits, or up to rounding; return the statuses."""
        met = set()
        robot = self.controller.robot
        while self.k < until:
            t, k = self.k * H, self.k
            q = robot.integrate(self.q, 0.02 * np.sin(0.1 * k + np.arange(self.nv)))
            v = fast * np.cos(0.1 * k + np.arange(self.nv))
            tau = self.command.effort(t, q, v, H)
            if not self.tasks:
                self.tasks = [x.task for x in self.controller.setup.tasks]
            status = self.command.output.status
            assert self.opened.step(t, q, v) == status, k
            np.testing.assert_allclose(
                self.opened.tau, tau, rtol=rtol, atol=0, err_msg=f"{k}"
            )
            met.add(int(status))
            self.k += 1
            for name, x, ramp in changes.get(k, ()):
                self.presence(name, x, ramp)
        return met


@pytest.mark.smoke
@pytest.mark.parametrize("ramp", [0.0, 0.03])
@pytest.mark.parametrize("level", [1, 2])
def test_tasks_come_and_go(level: int, ramp: float, tmp_path: Path) -> None:
    """Several at once, in either order, some partially; and again before the end."""
    tasks = [hand(), turn(priority=level), elbow(priority=2 * level - 1)]
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
    # A departure s, where the frozen presence is 1 - s.
    pair.run(80, {}, rtol=1e-13)
    pair.controller.at(79 * H).ramp(0.02).add(placed.task)
    assert pair.opened.ramp("turn.presence", 1.0, 0.02) == OK
    pair.run(140, {})


def test_within_limits_that_bind(tmp_path: Path) -> None:
    limits = hsp.Limits(effort=[30.0, 60.0, 30.0, 30.0, 8.0, 8.0, 8.0])
    declared = hsp.Controller(
        ROBOT, [hand(), turn(priority=2)], hsp.JointCentering(), limits=limits, start=Q
    )
    pair = Pair(declared, tmp_path, ["turn"])
    met = pair.run(
        200, {10: [("turn", 0.0, 0.08)], 120: [("turn", 1.0, 0.05)]}, fast=0.6
    )
    assert {0, 2} <= met


def test_where_the_law_is_damped(tmp_path: Path) -> None:
    """Python mixes part by part here."""
    given: dict[str, Any] = {"singularity_threshold": 0.5, "start": Q}
    declared = hsp.Controller(ROBOT, [hand(), turn(priority=2)], **given)
    pair = Pair(declared, tmp_path, ["turn"])
    pair.run(60, {10: [("turn", 0.0, 0.03)]})
    assert pair.opened.get("damped_level", 1)[0] > 0


def test_on_feet(tmp_path: Path) -> None:
    own = hsp.load_experiment("whole_body/solo12_trunk").controller
    start = own.setup.start.state.q
    given: dict[str, Any] = {"contacts": own.contacts, "start": start}
    declared = hsp.Controller(own.robot, own.tasks, own.field, **given)
    name = own.tasks[-1].name
    pair = Pair(declared, tmp_path, [name])
    pair.run(60, {5: [(name, 0.0, 0.02)], 40: [(name, 1.0, 0.01)]}, fast=0.05)


def test_a_stream_that_comes_and_goes(tmp_path: Path) -> None:
    """Its reference moves on while it is absent or nearly so."""
    stream = StreamPose(policy="latest", delay=0.03)
    task = hsp.FramePose("panda_tcp", stream, name="hand")
    declared = hsp.Controller(ROBOT, [task], hsp.JointCentering(), start=Q)
    pair = Pair(declared, tmp_path, ["hand"])
    at = ROBOT.state(0.0, Q, np.zeros(7)).position("panda_tcp")
    target = np.array([*at, 1.0, 0.0, 0.0, 0.0])
    changes = {
        30: [("hand", 0.2, 0.01)],
        50: [("hand", 1.0, 0.02)],
        80: [("hand", 0.0, 0.0)],
        100: [("hand", 1.0, 0.02)],
    }
    for k in (0, 7, 14, 29, 60, 79):
        pair.run(k, changes)
        target[:3] += 0.01
        pair.controller.stream("hand").send(target)
        assert pair.opened.set("hand.target", target) == OK
    pair.run(160, changes)


def test_before_the_first_step_it_is_not_there(tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], hsp.JointCentering(), start=Q)
    pair = Pair(declared, tmp_path, ["turn"])
    assert pair.opened.set("turn.presence", 0.0) == OK
    pair.change("turn", 0.0, -1.0, 0.0)
    pair.run(10, {})


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_a_field_whose_weight_is_a_ramp(ramp: float, tmp_path: Path) -> None:
    """A factor on its weight fades it, also during its own ramp."""
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
    assert "bounds" in pair.opened.error
    assert pair.opened.ramp("turn.presence", 0.0, -0.1) == WRONG_VALUE
    assert "duration" in pair.opened.error
    assert pair.opened.set("hand.presence", 1.0) == WRONG_NAME
    for _ in range(8):
        assert pair.opened.ramp("turn.presence", 0.5, 1.0) == OK
    assert pair.opened.ramp("turn.presence", 0.5, 1.0) == TOO_MANY


@pytest.mark.parametrize(
    ("tasks", "presences", "reason"),
    [
        ([hand(), turn()], ["hnad"], r"no task 'hnad'; did you mean 'hand'\?"),
        ([hand(), turn()], ["hand", "hand"], "task 'hand' is named twice"),
        ([hand(impedance=hsp.Impedance(300.0))], ["hand"], "has an impedance"),
    ],
)
def test_which_tasks_come_and_go(
    tasks: list[hsp.Task], presences: list[str], reason: str, tmp_path: Path
) -> None:
    declared = hsp.Controller(ROBOT, tasks, start=Q)
    with pytest.raises(FreezeError, match=rf"^presences: .*{reason}"):
        hsp.freeze(declared, tmp_path / "frozen.hsp", presences=presences)


def test_compensators_act_on_each_set_of_tasks(tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], hsp.JointCentering(), start=Q)
    chain = hsp.compensation.Compensation(
        velocity_filter=hsp.compensation.VelocityFilter(80.0),
        momentum_observer=hsp.compensation.MomentumObserver(30.0),
        start_up_ramp=hsp.compensation.StartUpRamp(0.05),
    )
    pair = Pair(declared, tmp_path, ["turn"], chain)
    pair.run(160, {10: [("turn", 0.0, 0.03)], 90: [("turn", 1.0, 0.02)]})


def test_no_error_is_integrated_while_tasks_come_and_go(tmp_path: Path) -> None:
    declared = hsp.Controller(ROBOT, [hand(), turn()], start=Q)
    action = hsp.compensation.IntegralAction(1.0, limit=1.0)
    chain = hsp.compensation.Compensation(integral_action=action)
    with pytest.raises(FreezeError, match=r"^compensation\.integral_action: .* turn"):
        hsp.freeze(declared, tmp_path / "x", compensation=chain, presences=["turn"])
