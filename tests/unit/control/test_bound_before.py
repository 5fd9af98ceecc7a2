"""Calls of steps are bound when a change is declared, not during a step."""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

import numpy as np
import pytest
from each_change import BACK, CHANGES, PERIOD, ROBOT, controller, step
from places import THOROUGH, covering

import hsp_control as hsp
from hsp_control import engine
from hsp_control.engine import plans
from hsp_control.robot import RobotState
from hsp_control.trajectories import Schedule, trajectory

H, AT, RAMP = PERIOD, 0.02, 0.005


@contextmanager
def nothing_bound(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make every binding of a call an error."""

    def refused(*_: object, **__: object) -> object:
        raise AssertionError("calls are bound in a step")

    with monkeypatch.context() as patched:
        for name in ("plan", "bind_move"):
            patched.setattr(RobotState, name, refused)
        for module in (plans, trajectory):  # binds all calls of plans
            patched.setattr(module, "bind", refused)
        # and those of the streams' planner
        patched.setattr(engine, "_BY_NAME", _Refused())
        yield


class _Refused(dict[str, object]):
    """Kinds of which a step makes no new call."""

    def __missing__(self, name: str) -> object:
        raise AssertionError(f"a call of {name} is bound in a step")


@pytest.mark.parametrize(("kind", "begun"), covering(CHANGES, [True, False]))
def test_no_step_around_a_change_binds(
    kind: str, begun: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first step, the ramp, the step after it, and the one that merges the
    change."""
    made = controller()
    if begun:
        step(made, 0)
    CHANGES[kind](made.at(AT).ramp(RAMP))
    step(made, 1)
    with nothing_bound(monkeypatch):
        for k in (*range(2, 40), *range(1010, 1060, 5)):
            step(made, k)
    made.at(2.0).null_space_gain(4.0)
    assert (
        len(made._in_force.time_line.open) == 1
    )  # the other change is over and forgotten


def test_the_sets_of_overlapping_changes_are_all_bound(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the weight of the incoming task exceeds that of the outgoing one."""
    made = controller()
    step(made, 0)
    posture = hsp.JointPosture("start", joints=["panda_joint1"], priority=2)
    made.at(0.010).ramp(0.020).remove("hand").add(posture)
    made.at(0.015).ramp(0.008).add(hsp.FrameOrientation(priority=2, name="turned"))
    made.at(0.018).ramp(0.004).limits(None).field(hsp.JointCentering())
    with nothing_bound(monkeypatch):
        for k in range(1, 60):
            step(made, k)


def test_changes_that_go_on_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """A change before the last one is forgotten: finished ones are dropped then."""
    made = controller()
    for k in range(0, 3000, 10):
        if k % 100 == 0:
            gains = hsp.Gains(natural_frequency=10.0 + k % 3)
            made.at(k * H).ramp(0.05).gains("hand", gains)
        step(made, k)
    assert len(made._in_force.time_line.open) < 15
    with nothing_bound(monkeypatch):
        step(made, 3010)


@pytest.mark.parametrize("kind", CHANGES)
def test_past_changes_are_forgotten(kind: str) -> None:
    """Many changes leave no more in memory than the first few."""

    def kept(number: int) -> tuple[int, str, int]:
        # the same number of steps for any number of changes: counters grow with steps
        made = controller()
        step(made, 0)
        for k in range(1, 1500 if THOROUGH else 500):
            if k % 40 == 1 and k < 40 * number:
                CHANGES[kind](made.at(k * H).ramp(0.02))
                if kind in BACK:
                    BACK[kind](made.at((k + 30) * H).ramp(0.005))
            step(made, k)
        for k in range(3000, 3003):
            step(made, k)
        assert not made.changes
        assert not made._in_force.time_line.open
        plan = str(made.step_plan)
        return len(pickle.dumps(made)), repr(made), len(plan)

    few, many = kept(2), kept(30 if THOROUGH else 10)
    assert many[1:] == few[1:]
    assert abs(many[0] - few[0]) < 50  # digits of counts and times


def test_a_schedule_is_bound_beforehand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Future changes are bound in the first step."""
    hand = hsp.FramePosition(name="hand")
    schedule = Schedule([(0.01, 0.02), (0.03, 0.04)], ramp=0.004)
    turned = hsp.FrameOrientation(schedule=schedule, priority=2, name="turned")
    made = controller(hand, turned)
    step(made, 0)
    with nothing_bound(monkeypatch):
        for k in range(1, 60):
            step(made, k)


@pytest.mark.parametrize("pose", [False, True])
def test_a_target_is_bound_when_it_is_set(
    pose: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A move that is planned when a target arrives binds nothing, either."""
    made = controller(*([hsp.FramePose(name="hand")] if pose else []))
    step(made, 0)
    for k in range(1, 40):
        if k % 10 == 1:
            turned = [np.cos(0.01 * k), np.sin(0.01 * k), 0.0, 0.0] if pose else []
            made.set_target("hand", [0.4, 0.1, 0.5, *turned])
        with nothing_bound(monkeypatch):
            step(made, k)


def test_a_velocity_is_bound_when_it_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """In tool axes, where Python integrates, too; and while the integral fades out."""
    made = controller(hsp.FramePose(name="hand"))
    step(made, 0)
    twist = np.array([0.02, 0.0, 0.01, 0.0, 0.1, 0.0])
    for k in range(1, 400):
        if k in (1, 10, 20):
            axes: Literal["tool", "world"] = "world" if k == 10 else "tool"
            made.set_velocity("hand", twist, axes=axes)
        with nothing_bound(monkeypatch):
            step(made, k)


def test_a_pickle_of_a_standing_robot_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The law is bound at the robot's state: elsewhere contacts permit other motions.

    No step binds, also while a foot is lifted.
    """
    pytest.importorskip("example_robot_data")
    robot = hsp.Robot.load("solo12")
    feet = [name for name in robot.frame_names if name.endswith("_FOOT")]
    made = hsp.Controller(
        robot,
        [hsp.FramePose("base_link", name="trunk")],
        contacts=[hsp.contacts.PointContact(foot) for foot in feet],
        changes=[hsp.changes.ChangeContact(feet[0], False, at=0.01, ramp=0.02)],
    )
    q, v = robot.home(), 0.01 * np.ones(robot.nv)
    made.applied(made.compute(0.0, q, v).tau, H)
    again = pickle.loads(pickle.dumps(made))
    again.applied(again.compute(H, q, v).tau, H)  # bound at this state
    made.applied(made.compute(H, q, v).tau, H)
    for k in (*range(2, 60), 1040, 1041):
        with nothing_bound(monkeypatch):
            found = [each.compute(k * H, q, v).tau for each in (made, again)]
        np.testing.assert_array_equal(*found)
        for each, tau in zip((made, again), found, strict=True):
            each.applied(tau, H)


@pytest.mark.parametrize(
    "kind", [k for k in CHANGES if k not in ("add", "remove", "replace")]
)
def test_a_change_of_numbers_leaves_the_step_one_call(kind: str) -> None:
    """The result equals that of law and limits with a modifier that adds nothing."""
    made, apart = controller(), controller()
    for k in range(1, 3):
        for each in (made, apart):
            step(each, k)
    for each in (made, apart):
        CHANGES[kind](each.at(AT).ramp(RAMP))
    swing = 0.3 * np.ones(7)
    for k in range(15, 30):
        q = ROBOT.integrate(ROBOT.home(), 1e-3 * k * swing)
        whole = made.compute(k * H, q, swing).tau
        out = apart.compute(k * H, q, swing, modifier=lambda _, __, a: (a, None))
        np.testing.assert_allclose(whole, out.tau, rtol=0, atol=1e-9)
        if "limits" not in kind:  # two sets of limits are mixed
            assert made.step_plan
        for each in (made, apart):
            each.applied(whole, H)
