"""Changes at states where limits bind: efforts are continuous, to some 1e-6 N·m."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from binding_limits import EVENTS, FINEST, RAMP, START, Case
from compensators import only
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from loaded_robots import load
from places import THOROUGH, further

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation import Status, actuation
from hsp_control.control.compensation import CompensatedController, FrictionFeedForward
from hsp_control.trajectories import HoldOrientation, Schedule

# With 4 joints more than the hand has directions; with 1, 3, 4 and 4.
ROBOTS = ["panda", *further("planar3r", "ur5", "iiwa14", "xarm7")]

many = settings(
    max_examples=40 if THOROUGH else 2, deadline=None, derandomize=not THOROUGH
)
seeds = st.integers(0, 2**32 - 1)


def changed(controller: hsp.Controller, act: Callable[[Any], Any]) -> hsp.Controller:
    act(controller.at(START).ramp(RAMP))
    return controller


def a_task_is_added(case: Case) -> hsp.Controller:
    return changed(case.controller(), lambda at: at.add(case.other()))


def a_task_has_a_schedule(case: Case) -> hsp.Controller:
    schedule = Schedule([(START, START + RAMP)], ramp=0.1)
    return case.controller(case.hand(), case.other(schedule=schedule))


def several_fade_at_a_time(case: Case) -> hsp.Controller:
    controller = case.controller(case.hand(), case.other())
    changed(controller, lambda at: at.remove("other").limits(case.limits()))
    controller.at(START + 0.1).ramp(0.1).add(case.other(name="third"))
    return controller


def limits_change(case: Case) -> hsp.Controller:
    new = case.limits(acceleration=20.0)
    return changed(case.controller(), lambda at: at.limits(new))


def limits_come(case: Case) -> hsp.Controller:
    controller = case.controller(limits=None)
    return changed(controller, lambda at: at.limits(case.limits()))


def limits_go_and_others_come(case: Case) -> hsp.Controller:
    controller = changed(case.controller(), lambda at: at.limits(None))
    controller.at(START + 0.1).ramp(RAMP).limits(case.limits())
    return controller


CHANGES: dict[str, Callable[[Case], hsp.Controller]] = {
    each.__name__: each
    for each in (
        *(a_task_is_added, a_task_has_a_schedule, several_fade_at_a_time),
        *(limits_change, limits_come, limits_go_and_others_come),
    )
}


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("change", CHANGES)
@given(seed=seeds)
@many
def test_efforts_are_continuous(change: str, name: str, seed: int) -> None:
    case = Case(name, seed)
    case.assert_continuous(CHANGES[change](case))


@given(seed=seeds)
@many
def test_efforts_and_forces_of_legs_are_continuous(seed: int) -> None:
    """On contacts, efforts are affine in acceleration and forces together."""
    pytest.importorskip("example_robot_data")
    rng, robot = np.random.default_rng(seed), load("solo12")
    feet = [name for name in robot.frame_names if name.endswith("_FOOT")]
    point = hsp.Hold(0.1 * rng.standard_normal(3), origin="start")
    controller = hsp.Controller(
        robot,
        [hsp.FramePosition("base_link", point, name="trunk")],
        contacts=[hsp.contacts.PointContact(foot) for foot in feet],
        start=robot.home(),
        limits=hsp.Limits(effort={"scale": 0.6}),
    )
    turned = HoldOrientation(0.5 * rng.standard_normal(3))
    new = hsp.Limits(effort={"scale": 0.7})
    task = hsp.FrameOrientation("base_link", turned, name="turned")
    controller.at(START).ramp(RAMP).add(task).limits(new)
    q, v = robot.home(), 0.1 * rng.standard_normal(robot.nv)
    statuses = []
    for edge in (START, START + RAMP):
        for t in edge + np.linspace(-1e-6, 1e-6, 21):
            before = controller.compute(robot.state(t, q, v))
            after = controller.compute(robot.state(t + 1e-9, q, v))
            statuses.append(before.status)
            for old, now in ((before.tau, after.tau), (before.forces, after.forces)):
                np.testing.assert_allclose(now, old, rtol=0, atol=1e-6)
    assume(Status.LIMITED in statuses)
    # The unactuated rows are those of the contact forces, in between as well.
    out = controller.compute(robot.state(START + 0.5 * RAMP, q, v))
    support, state = controller.active_stack.support, controller.state
    wanted = state.inverse_dynamics(out.acceleration)
    np.testing.assert_allclose(out.tau + support.map @ out.forces, wanted, atol=1e-7)
    assert (support.cone @ out.forces >= -1e-9).all()  # friction, to rounding


def lifted(controller: hsp.Controller, contact: str) -> None:
    controller.at(START).ramp(0.1).contact(contact, active=False)
    controller.at(START + RAMP - 0.1).ramp(0.1).contact(contact, active=True)


ABOUT = np.append(np.linspace(-1e-6, 1e-6, 20), -0.5 * FINEST)
"""Sample times around a change's begin or end, which is in the last 1e-9 s [s]."""
OF_LEGS = 5e-6
"""Changes of efforts on legs [N·m]. Internal forces of the feet move nothing, and cost
1e-6 of a motion, so that rounding decides their last 1e-6 N·m."""
HANDED = (START, START + RAMP)
"""Interval in which a task moves a foot that is in contact before and after it [s]."""


def handed_over() -> tuple[Schedule, Schedule]:
    """Return the schedules of a contact, and of the task that takes its place."""
    contact = Schedule([(None, START), (START + RAMP, None)], ramp=0.1)
    return contact, Schedule([HANDED], ramp=0.0)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("moves", [False, True])
@given(seed=seeds)
@many
def test_a_contact_with_a_schedule(moves: bool, name: str, seed: int) -> None:
    """A contact ends and begins without a jump; so does the task in between."""
    case = Case(name, seed)
    off, on = handed_over()
    tip = hsp.contacts.SlidingContact(
        case.robot.end_effector,
        force=hsp.contacts.CommandedForce(20.0),
        schedule=off,
        name="tip",
    )
    tasks = [case.other(), case.hand(schedule=on)][: 1 + moves]
    case.assert_continuous(case.controller(*tasks, contacts=[tip]))


def standing(seed: int, **schedules: Schedule) -> tuple[hsp.Controller, Array, Array]:
    """Return Solo's controller with a foot that a task moves, and a state."""
    pytest.importorskip("example_robot_data")
    rng, robot = np.random.default_rng(seed), load("solo12")
    feet = [name for name in robot.frame_names if name.endswith("_FOOT")]
    first = feet.pop(seed % 4)
    away = hsp.Hold(0.1 * rng.standard_normal(3), origin="start")
    controller = hsp.Controller(
        robot,
        [
            hsp.FramePose("base_link", name="trunk"),
            hsp.FramePosition(first, away, schedule=schedules["task"], name="foot"),
        ],
        contacts=[
            hsp.contacts.PointContact(first, schedule=schedules["contact"]),
            *map(hsp.contacts.PointContact, feet),
        ],
        start=robot.home(),
        limits=hsp.Limits(effort={"scale": 0.6}),
    )
    return controller, robot.home(), 0.2 * rng.standard_normal(robot.nv)


@given(seed=seeds)
@many
def test_a_foot_that_a_plan_switches(seed: int) -> None:
    """For any lift-off and touch-down times, also touch-down during the lift-off."""
    walking = pytest.importorskip("hsp_control.companions.walking.contact_switch")
    foot = walking.Switched()
    foot.contact, foot.task = walking.Switch(), walking.Switch(on=False)
    controller, q, v = standing(seed, contact=foot.contact, task=foot.task)

    def effort(t: float) -> Array:
        return controller.compute(controller.robot.state(t, q, v)).tau

    foot.unload(START, 0.1)
    for t in START + 0.1 + ABOUT:
        np.testing.assert_allclose(effort(t + FINEST), effort(t), rtol=0, atol=OF_LEGS)
    t = START + 0.2
    for begins in (t, t + 0.01, t + 0.02):  # in the last two it carries load
        before = effort(begins - 1e-9)
        foot.set_down(begins, 0.1)
        np.testing.assert_allclose(effort(begins), before, rtol=0, atol=OF_LEGS)
        end = begins + 0.1
        np.testing.assert_allclose(
            effort(end), effort(end - 1e-9), rtol=0, atol=OF_LEGS
        )
    early = t + 0.2
    foot.unload(t + 0.15, 0.1)
    before = effort(early + 0.04)  # a part of its motion is free
    foot.set_down(early + 0.04, 0.1)
    np.testing.assert_allclose(effort(early + 0.04), before, rtol=0, atol=OF_LEGS)


@given(seed=seeds)
@many
def test_a_foot_that_is_lifted_while_it_moves(seed: int) -> None:
    """Also in the forces, whose index among those of all contacts is unchanged."""
    pytest.importorskip("example_robot_data")
    rng, robot = np.random.default_rng(seed), load("solo12")
    feet = [name for name in robot.frame_names if name.endswith("_FOOT")]
    away = np.r_[np.zeros(6), 0.1 * rng.standard_normal(12)]
    controller = hsp.Controller(
        robot,
        [hsp.FramePose("base_link", name="trunk")],
        hsp.TargetPosture(robot.integrate(robot.home(), away)),
        contacts=[hsp.contacts.PointContact(foot) for foot in feet],
        start=robot.home(),
    )
    lifted(controller, feet[seed % 4])
    q, v = robot.home(), 0.2 * rng.standard_normal(robot.nv)
    for edge in EVENTS:
        for t in edge + np.linspace(-1e-6, 1e-6, 21):
            before = controller.compute(robot.state(t, q, v))
            after = controller.compute(robot.state(t + 1e-9, q, v))
            np.testing.assert_allclose(after.tau, before.tau, rtol=0, atol=OF_LEGS)
    out = controller.compute(robot.state(START + 0.02, q, v))
    support, state = controller.active_stack.support, controller.state
    np.testing.assert_allclose(
        out.tau + support.map @ out.forces,
        state.inverse_dynamics(out.acceleration),
        atol=1e-7,
    )


@pytest.mark.parametrize(
    "change", ["limits_change", "limits_go_and_others_come", "limits_come"]
)
def test_a_change_of_limits_is_compiled_when_it_is_made(
    change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No step builds a QP, for any set of limits."""
    case = Case("panda", 0)
    controller = CHANGES[change](case)
    case.effort(controller, 0.0)
    controller.at(START + RAMP).limits(case.limits())
    monkeypatch.setattr(actuation, "LimitedStep", None)
    for t in (START, START + 0.5 * RAMP, START + 1.5 * RAMP):
        case.effort(controller, t)
    assert case.binds


@pytest.mark.parametrize("name", ROBOTS)
@given(seed=seeds)
@many
def test_a_mixture_keeps_the_limits(name: str, seed: int) -> None:
    """The effort for each set of tasks is within the limits, and so is their mean."""
    case = Case(name, seed)
    controller = a_task_is_added(case)
    for t in START + RAMP * case.rng.uniform(0.0, 1.0, 5):
        out = controller.compute(case.robot.state(t, case.q, case.v))
        assume(out.status == Status.LIMITED)
        limits = controller.limits
        bounds = controller._in_force.limits.sets[-1][0].bounds
        assert limits is not None
        assert (np.abs(out.tau) <= limits.effort).all()
        assert (out.acceleration >= bounds.a_lower - 1e-6).all()
        assert (out.acceleration <= bounds.a_upper + 1e-6).all()


def test_friction_compensation_fades_with_the_tasks() -> None:
    """Friction opposes the velocity that each set of tasks commands."""
    case = Case("panda", 0)
    controller = a_task_is_added(case)
    friction = FrictionFeedForward(coulomb=1.0, viscous=0.5)
    command = CompensatedController(controller, only(friction_feed_forward=friction))
    columns = command.log_channels
    times = START + np.array([-1e-9, 1e-9, RAMP - 1e-9, RAMP + 1e-9])
    tau, sent = [], []
    for t in times:
        # otherwise the rate limit ties the effort to the previous one
        controller.restart(origin=0.0)
        tau.append(command.effort(t, case.q, case.v, 1e-3).copy())
        sent.append(np.array(columns()["friction.feed_forward"].value))
    for found in (tau, sent):
        np.testing.assert_allclose(found[0], found[1], atol=1e-6)
        np.testing.assert_allclose(found[2], found[3], atol=1e-6)
    assert np.abs(sent[0] - sent[2]).max() > 0.1
