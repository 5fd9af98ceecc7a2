"""Commanded contact forces: in the allocation alone, balanced by the other contacts.

The closed form against its optimality conditions; the law with and without a command;
motions of plants that solve the contact independently, where errors and null space
obey their equations and the force is the commanded one.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import load, panda, talos
from places import further
from runs import check_null_space, continuous
from wording import wording

import hsp_control as hsp
from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ContactError, ControllerError
from hsp_control.constraints.contacts import (
    CommandedForce,
    Contact,
    PointContact,
    SlidingContact,
    SurfaceContact,
)
from hsp_control.control.actuation import Status
from hsp_control.simulation.plants import ContactPlant, ContinuousPlant, RigidContact
from hsp_control.trajectories import CallableTrajectory, Hold, Schedule, Stream

pytest.importorskip("example_robot_data")
seeds = st.integers(0, 2**32 - 1)
GAINS = hsp.Gains(natural_frequency=8.0)
HAND, TIP = "gripper_right_base_link", "panda_tcp"
SOLES = ("left_sole_link", "right_sole_link")


def wall(force: CommandedForce | None, **options: Any) -> PointContact:
    return PointContact(HAND, normal=[-1.0, 0.0, 0.0], force=force, **options)


def leaning(
    *contacts: Contact, friction: float = 0.7, **options: Any
) -> hsp.Controller:
    """Return Talos on two soles with further contacts."""
    soles = [
        SurfaceContact(frame, length=0.16, width=0.1, friction=friction)
        for frame in SOLES
    ]
    tasks = [
        hsp.CenterOfMass(gains=GAINS),
        hsp.FrameOrientation("torso_2_link", gains=GAINS),
    ]
    return hsp.Controller(
        talos(),
        tasks,
        hsp.TargetPosture("home"),
        null_space_gain=6.0,
        contacts=[*soles, *contacts],
        start=talos().home(),
        **({"limits": None} | options),
    )


def random_state(robot: hsp.Robot, seed: int) -> hsp.RobotState:
    rng = np.random.default_rng(seed)
    q = robot.integrate(robot.home(), 0.02 * rng.standard_normal(robot.nv))
    return robot.state(0.0, q, 0.01 * rng.standard_normal(robot.nv))


# --- the closed form -----------------------------------------------------------------


@pytest.mark.parametrize("without_support", [0, 1, 2])
@given(seeds)
@settings(max_examples=20)
def test_the_closed_form_is_the_optimum(without_support: int, seed: int) -> None:
    """A f = w, and E⁻¹(f - r) lies in the range of Aᵀ: the conditions of Lagrange.

    Also where contacts transmit no effort along some base motions, as with point feet.
    """
    rng = np.random.default_rng(seed)
    n, size, nv = 6, 15, 10
    F, r, wanted = (
        rng.standard_normal((nv, size)),
        *map(rng.standard_normal, (size, nv)),
    )
    e = rng.uniform(0.1, 1.0, size)
    base = np.arange(n)
    lost = np.linalg.qr(rng.standard_normal((n, n)))[0][:, :without_support]
    F[:n] -= lost @ (lost.T @ F[:n])
    wanted[:n] -= lost @ (lost.T @ wanted[:n])
    forces, tau = np.zeros(size), np.zeros(nv)
    engine.MinimumNormForces(
        F=F,
        base=base,
        inverse_cost=e,
        reference=r,
        wanted=wanted,
        forces=forces,
        tau=tau,
    )()
    A = F[:n]
    np.testing.assert_allclose(A @ forces, wanted[:n], atol=1e-9)
    multipliers = np.linalg.lstsq(A.T, (forces - r) / e, rcond=None)[0]
    np.testing.assert_allclose(A.T @ multipliers, (forces - r) / e, atol=1e-9)
    np.testing.assert_allclose(tau, wanted - F @ forces, atol=1e-12)


# --- the law is unchanged ------------------------------------------------------------


def test_an_unbalanced_force_is_reduced_before_the_law() -> None:
    """60 N with soles on ice: the hand presses less, the acceleration is the law's."""
    state = talos().state(0.0, talos().home(), np.zeros(talos().nv))
    controller = leaning(wall(CommandedForce([0.0, 0.0, 60.0])), friction=0.2)
    out = controller.compute(state)
    law = leaning(wall(CommandedForce([0.0, 0.0, 0.0])), friction=0.2).compute(state)
    assert out.status == Status.REDISTRIBUTED
    assert 20.0 < out.forces[-1] < 50.0
    np.testing.assert_array_equal(out.acceleration, law.acceleration)
    soles = out.forces[:-3].reshape(-1, 3)
    assert (np.abs(soles[:, :2]).max(axis=1) <= 0.15 * soles[:, 2] + 1e-5).all()


# --- motions -------------------------------------------------------------------------


def pressing(contact: Contact, **options: Any) -> hsp.Controller:
    """Return a Panda that presses, with the hand's orientation free."""
    return hsp.Controller(
        panda(),
        [hsp.FrameOrientation(TIP, gains=GAINS, name="turn")],
        hsp.TargetPosture(panda().home()),
        null_space_gain=5.0,
        contacts=[contact],
        **({"limits": None} | options),
    )


def test_a_fixed_base_presses_as_commanded() -> None:
    """tau = M a + N - Jᵀλ: in motion a rigid contact reacts with λ, to rounding."""

    def command(t: float) -> Array:
        return np.array([3.0 * np.sin(4.0 * t), 2.0, 20.0 + 5.0 * np.cos(3.0 * t)])

    contact = PointContact(TIP, force=CommandedForce(
        trajectory=CallableTrajectory(command, 3)), damping=40.0)  # fmt: skip
    controller = pressing(contact)
    J = controller.robot.state(0.0, panda().home(), np.zeros(7)).frame(TIP).jacobian
    v0 = 0.3 * np.linalg.svd(J)[2][-1]  # self-motion
    plant = ContactPlant(panda(), [RigidContact(TIP, "point")], damping=40.0)
    how: dict[str, Any] = {"duration": 0.4, "log_period": 0.05, "plant": plant}
    log = continuous(controller, panda().home(), v0, **how)
    expected = np.array([command(t) for t in log.t])
    for column in (f"plant.contact.{TIP}.force", f"contact.{TIP}.force",
                   f"contact.{TIP}.commanded"):  # fmt: skip
        np.testing.assert_allclose(log[column], expected, atol=1e-9)
    check_null_space(log, 5.0, least=0.1, rtol=1e-7)
    assert np.abs(log["task.turn.error"]).max() < 1e-9


class SlidingPlant(ContinuousPlant):
    """A point on a plane: one rigid row, and unreported kinetic friction."""

    def __init__(self, robot: hsp.Robot, contact: SlidingContact) -> None:
        super().__init__(robot)
        self._contact = contact
        self.pressed = 0.0

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        contact, state = self._contact, self.robot.state(t, q, v)
        frame, n = state.frame(contact.frame), contact.axes[:, 2]
        J, J_dot = frame.jacobian[:3], frame.jacobian_dot[:3]
        slip = (np.eye(3) - np.outer(n, n)) @ J @ v
        speed = float(np.linalg.norm(slip))
        along = np.tanh(speed / contact.smoothing) * slip / max(speed, 1e-12)
        force = J.T @ (n - contact.friction * along)
        M = np.triu(state.mass_matrix)
        M = M + np.triu(M, 1).T
        free, response = np.linalg.solve(
            M, np.column_stack([tau - state.nonlinear_effects, force])
        ).T
        missing = -n @ (J_dot @ v + 40.0 * J @ v) - n @ J @ free
        self.pressed = float(missing / (n @ J @ response))
        return np.asarray(free + response * self.pressed)


@pytest.mark.parametrize("normal", [[0.3, -0.2, 1.0], *further([0.0, 0.0, 1.0])])
def test_a_sliding_point_keeps_force_and_path(normal: list[float]) -> None:
    """Hybrid control: the path and the null space are exact, the force is commanded."""
    contact = SlidingContact(
        TIP, friction=0.3, normal=normal, force=CommandedForce(20.0)
    )
    state = panda().state(0.0, panda().home(), np.zeros(7))
    here = state.position(TIP)[:2].copy()
    path = hsp.Circle(0.05, 2.0, here - [0.05, 0.0])
    tasks = [
        hsp.FramePosition(TIP, path, axes="xy", gains=GAINS, name="path"),
        hsp.FrameOrientation(TIP, gains=GAINS, name="upright"),
    ]
    controller = hsp.Controller(
        panda(),
        tasks,
        hsp.TargetPosture(panda().home() + 0.1),
        null_space_gain=5.0,
        contacts=[contact],
        limits=None,
    )
    plant = SlidingPlant(panda(), contact)
    q0 = panda().home()
    v0 = controller.flow(0.0, q0)
    log = continuous(controller, q0, v0, duration=0.5, log_period=0.05, plant=plant)
    assert np.abs(log["task.path.error"]).max() < 1e-8
    norm = log["null_space_norm"]
    assert norm.max() < 1e-7
    for t, q, v, tau in zip(log.t, log.q, log.v, log.tau, strict=True):
        plant.acceleration(t, q, v, tau)
        assert plant.pressed == pytest.approx(20.0, abs=1e-6)
    used = log[f"contact.{TIP}.friction_used"]
    np.testing.assert_allclose(used, np.tanh(0.1 / contact.smoothing), atol=0.2)


# --- commands in time ----------------------------------------------------------------


def test_a_change_ramps_and_a_schedule_fades_the_force() -> None:
    q, v = panda().home(), np.zeros(7)
    contact = PointContact(
        TIP, force=CommandedForce(20.0), schedule=Schedule([(0.0, 4.0)], ramp=0.5)
    )
    controller = pressing(contact)
    controller.at(1.0).ramp(1.0).force(TIP, CommandedForce(30.0))
    expected = {0.25: 10.0, 0.8: 20.0, 1.5: 25.0, 2.5: 30.0, 3.75: 15.0}
    for t, force in expected.items():
        output = controller.compute(panda().state(t, q, v))
        assert output.forces[-1] == pytest.approx(force, abs=1e-4)


def test_a_wrench_of_a_surface() -> None:
    """Six numbers: the forces at the corners have this sum and these moments."""
    wrench = np.array([2.0, -1.0, 30.0, 0.4, -0.5, 0.1])
    contact = SurfaceContact(TIP, length=0.1, width=0.08, force=CommandedForce(wrench))
    controller = hsp.Controller(
        panda(),
        [hsp.FramePosition(TIP, axes="x", gains=GAINS)],
        contacts=[contact],
        limits=None,
    )
    state = random_state(panda(), 1)
    out = controller.compute(state)
    arms = contact.arms_in_axes(state.frame(TIP))
    forces = out.forces.reshape(-1, 3)
    np.testing.assert_allclose(forces.sum(axis=0), wrench[:3], atol=1e-9)
    moments = np.cross(arms, forces).sum(axis=0)
    np.testing.assert_allclose(moments, wrench[3:], atol=1e-9)


# --- refusals -----------------------------------------------------------------------


def press(**options: Any) -> PointContact:
    return PointContact(TIP, force=CommandedForce(**options))


TIPPING = SurfaceContact(
    TIP, length=0.1, width=0.1, force=CommandedForce([0.0, 0.0, 10.0, 0.0, 5.0, 0.0])
)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: CommandedForce(trajectory=Stream()),
            "... trajectory: a stream cannot command a force",
        ),
        (
            lambda: CommandedForce(trajectory=Hold()),
            "... trajectory: point is missing",
        ),
        (
            lambda: pressing(press(value=-5.0)),
            "... contacts.panda_tcp.force.value: ... -5 N",
        ),
        (
            lambda: pressing(press(value=[6.0, 0.0, 10.0])),
            "... panda_tcp.force.value: ... (6, 0) N ... 10 N ... pyramid ... 4",
        ),
        (
            lambda: pressing(press(value=[0.0, 0.0, 10.0, 0.0, 0.0, 0.0])),
            "... type point ... no moment ... 1 or 3",
        ),
        (lambda: pressing(TIPPING), "... at point 1 of 4 ... -22.5 N"),
        (
            lambda: SlidingContact(TIP, force=CommandedForce([0.0, 0, 1, 0, 0, 0])),
            "... sliding contact ... 1 (it slides) or 3",
        ),
    ],
)
def test_impossible_commands(make: Any, message: str) -> None:
    with pytest.raises(hsp.HspControlError, match=wording(message)):
        make()


def test_changes_that_do_not_fit() -> None:
    controller = pressing(press(value=20.0))
    change = controller.at(1.0)
    with pytest.raises(ControllerError, match="did you mean 'panda_tcp'"):
        change.force("panda_tcq", CommandedForce(10.0))
    with pytest.raises(
        ContactError, match="it has 3 coordinates; the force of contact"
    ):
        change.force(TIP, CommandedForce([0.0, 0.0, 10.0]))
    with pytest.raises(ContactError, match=r"force\.value: the normal force is -1 N"):
        change.force(TIP, CommandedForce(-1.0))
    with pytest.raises(ContactError, match="has no commanded force from the start"):
        pressing(PointContact(TIP)).at(1.0).force(TIP, CommandedForce(10.0))


# --- where efforts are scarce --------------------------------------------------------


@pytest.mark.parametrize(
    ("arm", "seed"), [("iiwa14", 28), *further(("iiwa14", 3), ("ur5", 15), ("ur5", 24))]
)
def test_the_effort_is_continuous_where_forces_cease_to_suffice(
    arm: str, seed: int
) -> None:
    """A gain grows until no force of a wiper lets its arm accelerate as the law says.

    Up to there the wiper is pressed with up to ten times its command.
    """
    robot, rng = load(arm), np.random.default_rng(seed)
    n = robot.nv
    q = robot.integrate(robot.home(), 0.3 * rng.standard_normal(n))
    v = 0.2 * rng.standard_normal(n)
    held = np.abs(robot.state(0.0, q, np.zeros(n)).nonlinear_effects)
    effort = (0.6 + rng.uniform(0.0, 1.0, n)) * held + 2.0
    hand, force = robot.end_effector, CommandedForce(5.0)
    made = hsp.Controller(
        robot,
        [hsp.FramePosition(hand, axes="xy", name="hand")],
        hsp.TargetPosture("home"),
        null_space_gain=1.0,
        limits=hsp.Limits(
            effort=effort, velocity="none", position="none", static_effort="none"
        ),
        contacts=[hsp.contacts.SlidingContact(hand, friction=0.3, force=force)],
        start=q,
    )
    made.at(0.1).ramp(0.5).null_space_gain(15.0)
    found = set[Status]()

    def tau(t: float) -> Array:
        out = made.compute(robot.state(t, q, v))
        found.add(out.status)
        return out.tau

    times = np.linspace(0.1, 0.6, 101)
    steps = np.abs(np.diff([tau(t) for t in times], axis=0)).max(axis=1)
    k = int(steps.argmax())
    before, after = times[k], times[k + 1]
    while after - before > 1e-9:
        middle = 0.5 * (before + after)
        first, half, last = map(tau, (before, middle, after))
        left = np.abs(half - first).max() >= np.abs(last - half).max()
        before, after = (before, middle) if left else (middle, after)
    assert {Status.REDISTRIBUTED, Status.LIMITED} <= found
    # 100 N·m/s in a nanosecond, and 1e-6
    assert np.abs(tau(after) - tau(before)).max() < 1.1e-6
