"""A frozen controller stands: contacts that are the same at all times."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frozen_library import (
    BRAKING,
    FAILED,
    HOLDING,
    OK,
    WRONG_NAME,
    WRONG_SIZE,
    WRONG_STATE,
    WRONG_VALUE,
    Opened,
)
from frozen_runs import computed, random_states, replayed

import hsp_control as hsp
from hsp_control.common.errors import FreezeError
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.live import LiveSettings, SafeStop, StopSettings
from hsp_control.live.safe_stop import StandingFeet

SEED = 61
H = 0.001


@pytest.mark.smoke
@pytest.mark.parametrize(
    ("name", "statuses"),
    [
        ("whole_body/solo12_trunk", {0, 1, 2}),  # forces are redistributed, too
        ("whole_body/talos_weak_arm", {0, 1, 2, 3, 4}),  # and static efforts
    ],
)
def test_the_same_bits_on_feet(
    name: str, statuses: set[int], replay: Path, tmp_path: Path
) -> None:
    experiment = hsp.load_experiment(name)
    controller = experiment.controller
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
    met: set[float] = set()
    for away, speed in ((0.02, 0.05), (0.2, 0.3), (0.5, 0.5)):
        given = controller.robot, experiment.q0, 50, SEED
        states = random_states(*given, away=away, speed=speed)
        expected = computed(controller, states)
        met |= {*expected[:, 0]}
        np.testing.assert_array_equal(replayed(replay, frozen, states), expected)
    assert met == statuses


@pytest.mark.parametrize("name", ["whole_body/solo12_trunk", "whole_body/talos_circle"])
def test_a_robot_on_feet_is_stopped_as_by_a_live_loop(
    name: str, tmp_path: Path
) -> None:
    experiment = hsp.load_experiment(name)
    controller, robot = experiment.controller, experiment.robot
    opened = Opened(hsp.freeze(controller, tmp_path / "frozen.hsp"))
    limits = LiveSettings().effort_limits(robot, controller.limits)
    feet = StandingFeet(robot, controller.contacts)
    expected = SafeStop(robot, StopSettings(), limits, H, feet)
    state, q = hsp.RobotState(robot), experiment.q0
    v = np.random.default_rng(SEED).normal(0.0, 0.2, robot.nv)
    assert opened.step(0.0, q, v) >= OK
    phases = []
    for k in range(1, 100):
        phases.append(opened.stop(k * H, q, v))
        tau = expected.effort(state.update(k * H, q, v))
        np.testing.assert_array_equal(opened.tau, tau)
        q, v = robot.integrate(q, H * v), 0.9 * v
    assert not tau[:6].any()
    assert sorted(phases) == phases
    assert {*phases} == {BRAKING, HOLDING}


def test_a_robot_on_feet_that_sees_nothing_any_more_is_stopped(tmp_path: Path) -> None:
    experiment = hsp.load_experiment("whole_body/solo12_trunk")
    robot, q = experiment.robot, experiment.q0
    opened = Opened(hsp.freeze(experiment.controller, tmp_path / "frozen.hsp"))
    v = np.zeros(robot.nv)
    v[6:] = np.linspace(-0.4, 0.4, robot.nv - 6)
    assert opened.step(0.0, q, v) >= OK
    last = opened.tau.copy()
    for k in range(1, 500):
        assert opened.step(k * H, np.nan * q, v) == WRONG_STATE
        if k <= 5:
            np.testing.assert_array_equal(opened.tau, last)
    feet = StandingFeet(robot, experiment.controller.contacts)
    rests = SafeStop(robot, StopSettings(), np.full(robot.nv, np.inf), H, feet)
    held = rests.effort(robot.state(0.0, q, np.zeros(robot.nv)))
    assert np.abs(last - held).max() > 0.02
    np.testing.assert_allclose(opened.tau, held, rtol=0.0, atol=1e-3)


def pressing(value: float | list[float]) -> hsp.Controller:
    """Return a standing robot with a commanded force at one foot."""
    own = hsp.load_experiment("whole_body/solo12_trunk").controller.contacts
    foot = replace(own[0], force=CommandedForce(value=value))
    return solo(contacts=(foot, *own[1:]))


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_a_commanded_force(ramp: float, tmp_path: Path) -> None:
    """Also with overlapping ramps, and to zero."""
    declared = pressing(6.0)
    foot = declared.contacts[0].name
    opened = Opened(hsp.freeze(declared, tmp_path / "frozen.hsp"))
    controller = declared.preview()
    q, v = declared.setup.start.state.q, np.zeros(18)
    changes = {4: 2.5, 11: 9.0, 20: 0.0, 50: 5.0}
    for k in range(90):
        v[6:] = 0.01 * np.sin(0.3 * k)
        output = controller.compute(k * H, q, v)
        controller.applied(output.tau, H)
        assert opened.step(k * H, q, v) == output.status
        np.testing.assert_array_equal(opened.tau, output.tau)
        if k in changes:
            force = CommandedForce(value=changes[k])
            controller.at(k * H).ramp(ramp).force(foot, force)
            assert opened.ramp(f"{foot}.force", changes[k], ramp) == OK
    assert output.forces.reshape(-1, 3)[0, 2] == pytest.approx(5.0, abs=0.01)
    np.testing.assert_array_equal(opened.get(f"{foot}.force", 1), 5.0)
    for wrong in (-1e-3, np.nan, 1e31):
        assert opened.set(f"{foot}.force", wrong) == WRONG_VALUE
    assert opened.set(f"{foot}.force", [1.0, 2.0]) == WRONG_SIZE
    assert opened.ramp(f"{foot}.force", 1.0, -0.1) == WRONG_VALUE
    other = declared.contacts[1].name
    assert opened.set(f"{other}.force", 1.0) == WRONG_NAME


def test_a_commanded_force_along_a_plane_is_frozen_as_it_is(
    replay: Path, tmp_path: Path
) -> None:
    controller = pressing([0.5, -0.3, 6.0])
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
    q = controller.setup.start.state.q
    states = random_states(controller.robot, q, 50, SEED, away=0.02, speed=0.05)
    expected = computed(controller, states)
    np.testing.assert_array_equal(replayed(replay, frozen, states), expected)


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_a_commanded_force_along_a_plane(ramp: float, tmp_path: Path) -> None:
    """Within its friction pyramid; bit for bit while ramps overlap."""
    declared = pressing([0.5, -0.3, 6.0])
    foot, side = declared.contacts[0].name, declared.contacts[0].side
    opened = Opened(hsp.freeze(declared, tmp_path / "frozen.hsp"))
    controller = declared.preview()
    q, v = declared.setup.start.state.q, np.zeros(18)
    new = {4: [1.0, 0.2, 9.0], 11: [-0.4, 0.0, 3.0], 40: [0.0, 0.0, 0.0]}
    for k in range(80):
        v[6:] = 0.01 * np.sin(0.3 * k)
        output = controller.compute(k * H, q, v)
        controller.applied(output.tau, H)
        assert opened.step(k * H, q, v) == output.status
        np.testing.assert_array_equal(opened.tau, output.tau)
        if k in new:
            force = CommandedForce(value=new[k])
            controller.at(k * H).ramp(ramp).force(foot, force)
            assert opened.ramp(f"{foot}.force", new[k], ramp) == OK
    most = side * 5.0
    assert opened.set(f"{foot}.force", [most, -most, 5.0]) == OK
    for wrong in (
        [1.001 * most, 0.0, 5.0],
        [0.0, -1.001 * most, 5.0],
        [0.0, 0.0, -1.0],
    ):
        assert opened.set(f"{foot}.force", wrong) == WRONG_VALUE


def in_step(declared: hsp.Controller, folder: Path, new: dict[int, Any]) -> Opened:
    """Change a commanded force of both by overlapping ramps; compare the bits."""
    opened = Opened(hsp.freeze(declared, folder / "frozen.hsp"))
    controller, robot = declared.preview(), declared.robot
    name = next(each.name for each in declared.contacts if each.force is not None)
    q, moving = declared.setup.start.state.q, slice(6 if robot.unactuated else 0, None)
    for k in range(60):
        v = np.zeros(robot.nv)
        v[moving] = 0.02 * np.sin(0.3 * k + np.arange(robot.nv)[moving])
        output = controller.compute(k * H, q, v)
        controller.applied(output.tau, H)
        assert opened.step(k * H, q, v) == output.status
        np.testing.assert_array_equal(opened.tau, output.tau)
        if k in new:
            force = CommandedForce(value=new[k])
            controller.at(k * H).ramp(0.015).force(name, force)
            assert opened.ramp(f"{name}.force", new[k], 0.015) == OK
    return opened


def test_a_commanded_moment(tmp_path: Path) -> None:
    """The force of a sole, distributed to corners that may only push."""
    own = hsp.load_experiment("whole_body/talos_circle").controller
    foot = own.contacts[0]
    wrench = CommandedForce(value=[0.0, 0.0, 400.0, 0.0, 0.0, 0.0])
    contacts = replace(foot, force=wrench), *own.contacts[1:]
    start = own.setup.start.state.q
    declared = hsp.Controller(own.robot, own.tasks, contacts=contacts, start=start)
    x, y = 0.5 * foot.length, 0.5 * foot.width  # type: ignore[attr-defined]
    tilted = [10.0, -5.0, 300.0, 2.0, -4.0, 1.0]
    new = {4: [5.0, 3.0, 450.0, 2.0, -4.0, 1.0], 12: tilted, 40: [0.0] * 6}
    opened = in_step(declared, tmp_path, new)
    port = opened.ports[f"{foot.name}.force"]
    assert (port.size, port.unit.decode()) == (6, "N, N·m")
    for edge in ([0, 0, 100, 100 * y, 0, 0], [0, 0, 100, 0, -100 * x, 0]):
        # beyond which the foot tilts
        for share, status in ((0.98, OK), (1.02, WRONG_VALUE)):
            moment = np.array(edge) * [1, 1, 1, share, share, 1]
            assert opened.set(f"{foot.name}.force", moment) == status
    assert "push" in opened.error


def test_the_force_of_a_sliding_contact(tmp_path: Path) -> None:
    """Kinetic friction opposes the velocity that the tasks command."""
    own = hsp.load_experiment("forces/panda_wipe").controller
    start = own.setup.start.state.q
    wiper = replace(own.contacts[0], force=CommandedForce(value=5.0))
    given: dict[str, Any] = {"contacts": (wiper,), "start": start}
    declared = hsp.Controller(own.robot, own.tasks, own.field, **given)
    opened = in_step(declared, tmp_path, {4: 20.0, 12: 7.0, 40: 15.0})
    assert opened.set("wiper.force", -1.0) == WRONG_VALUE
    assert opened.set("wiper.force", 0.0) == OK


def test_an_unsupported_robot_is_not_stopped(tmp_path: Path) -> None:
    controller = solo(contacts=(), base="driven")
    opened = Opened(hsp.freeze(controller, tmp_path / "frozen.hsp"))
    q, v = controller.setup.start.state.q, np.zeros(18)
    assert opened.step(0.0, q, v) >= OK
    last = opened.tau.copy()
    assert opened.stop(0.001, q, v) == FAILED
    assert "no contact carries" in opened.error
    np.testing.assert_array_equal(opened.tau, last)


def solo(**changes: Any) -> hsp.Controller:
    """Return a standing robot, with parts of its configuration changed."""
    own = hsp.load_experiment("whole_body/solo12_trunk").controller
    given = {"contacts": own.contacts, "start": own.setup.start.state.q} | changes
    return hsp.Controller(own.robot, [hsp.CenterOfMass()], **given)


@pytest.mark.parametrize(
    ("kept", "key"),
    [(2, "contacts"), (0, "base")],
)
def test_contacts_that_leave_the_base_free_are_refused(
    kept: int, key: str, tmp_path: Path
) -> None:
    own = hsp.load_experiment("whole_body/solo12_trunk").controller
    changes = {"contacts": own.contacts[:kept]}
    if not kept:
        changes["base"] = "flying"  # type: ignore[assignment]
    with pytest.raises(FreezeError, match=rf"^{key}: .*hold all of the base"):
        hsp.freeze(solo(**changes), tmp_path / "frozen.hsp")


def test_a_contact_that_comes_and_goes_is_refused(tmp_path: Path) -> None:
    own = hsp.load_experiment("walking/solo12_trot").controller
    controller = solo(contacts=own.contacts)
    with pytest.raises(FreezeError, match=r"^contacts\.front_left\.schedule: "):
        hsp.freeze(controller, tmp_path / "frozen.hsp")
