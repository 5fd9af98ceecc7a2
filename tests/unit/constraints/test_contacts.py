"""Contacts and floating bases: rows, forces, the law on constrained plants, schedules.

Rows against differences; the effort against a plant that solves the constraint
independently; the equations of errors and of the null space along motions of that
plant.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import talos
from numpy.testing import assert_allclose
from runs import check_errors, check_null_space, continuous, held

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ContactError, FrameNotFoundError
from hsp_control.constraints.contacts.contact import UnactuatedRows
from hsp_control.control.actuation import Status
from hsp_control.control.actuation.support import Support
from hsp_control.control.evolution import PRESENT
from hsp_control.control.planned import PlannedContact
from hsp_control.geometry.scene import Scene, Start
from hsp_control.simulation.plants import ContactPlant, RigidContact
from hsp_control.tasks import TaskSample
from hsp_control.trajectories import Blend, HoldOrientation

pytest.importorskip("example_robot_data")
seeds = st.integers(0, 2**32 - 1)
GAINS = hsp.Gains(natural_frequency=8.0)
SOLES = ("left_sole_link", "right_sole_link")
FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")


@cache
def solo() -> hsp.Robot:
    return hsp.Robot.load("solo12")


def sole(frame: str, **options: Any) -> hsp.contacts.SurfaceContact:
    return hsp.contacts.SurfaceContact(frame, length=0.16, width=0.1, **options)


def random_state(robot: hsp.Robot, seed: int, speed: float = 0.3) -> hsp.RobotState:
    rng = np.random.default_rng(seed)
    q = robot.integrate(robot.home(), 0.2 * rng.standard_normal(robot.nv))
    return robot.state(0.0, q, speed * rng.standard_normal(robot.nv))


def sample_of(contact: hsp.contacts.Contact, state: hsp.RobotState) -> TaskSample:
    return contact.evaluate(state, TaskSample.allocate(contact.rows, state.robot.nv))


def slope(function: Callable[[float], Array], h: float = 1e-3) -> Array:
    """Return f'(0) by six points."""
    weights = ((1, 45.0), (2, -9.0), (3, 1.0))
    total = sum(w * (function(k * h) - function(-k * h)) for k, w in weights)
    return np.asarray(total / (60.0 * h))


# --- rows ----------------------------------------------------------------------------

CONTACTS: dict[str, tuple[Callable[[], hsp.Robot], hsp.contacts.Contact]] = {
    "sole": (talos, sole(SOLES[0])),
    "point": (talos, hsp.contacts.PointContact(SOLES[1], point=[0.1, 0.02, -0.03])),
    "ball": (
        solo,
        hsp.contacts.BallContact(FEET[2], radius=0.02, normal=[0.1, 0.2, 1.0]),
    ),
    "sliding": (
        talos,
        hsp.contacts.SlidingContact(
            SOLES[0],
            point=[0.1, 0.02, -0.03],
            offset=[-0.02, 0.0, 0.01],
            normal=[0.1, 0.2, 1.0],
            force=hsp.contacts.CommandedForce(5.0),
        ),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", CONTACTS)
@given(seeds)
@settings(max_examples=10)
def test_rows_are_the_velocity_at_the_contact(kind: str, seed: int) -> None:
    load, contact = CONTACTS[kind]
    robot = load()
    state = random_state(robot, seed)
    q, v = state.q.copy(), state.v.copy()
    sample = sample_of(contact, state)
    data = robot.model.createData()
    index = robot.model.getFrameId(contact.frame)

    def place(s: float) -> pin.SE3:
        pin.framesForwardKinematics(robot.model, data, robot.integrate(q, s * v))
        return data.oMf[index].copy()

    here = place(0.0)
    turning = slope(lambda s: pin.log3(place(s).rotation @ here.rotation.T))
    if kind == "sole":
        moving = np.concatenate([slope(lambda s: place(s).translation), turning])
    elif kind == "point":
        moving = slope(lambda s: place(s).act(contact.points[0]))
    elif kind == "sliding":
        assert isinstance(contact, hsp.contacts.SlidingContact)
        point = slope(lambda s: place(s).act(contact.points[0]))
        point = point + np.cross(turning, np.asarray(contact.offset))
        moving = contact.axes[:, 2:].T @ point
    else:
        assert isinstance(contact, hsp.contacts.BallContact)
        arm = -contact.radius * contact.axes[:, 2]
        moving = slope(lambda s: place(s).translation) + np.cross(turning, arm)
    assert_allclose(sample.jacobian @ v, moving, rtol=0, atol=1e-9)
    assert_allclose(sample.acceleration, -40.0 * moving, atol=1e-7)

    def rows(s: float) -> Array:
        there = robot.state(0.0, robot.integrate(q, s * v), v)
        return sample_of(contact, there).jacobian.copy()

    assert_allclose(sample.jacobian_dot, slope(rows), rtol=0, atol=1e-8)


@given(seeds)
@settings(max_examples=10)
def test_unactuated_rows_demand_no_effort(seed: int) -> None:
    """Two point feet: Uᵀ(M a + N) = 0 is a row of the law, and J' is its derivative."""
    robot = solo()
    base = np.array(robot.unactuated)
    feet = [hsp.contacts.BallContact(foot, radius=0.016) for foot in FEET[::3]]
    rest = UnactuatedRows(robot, base, 1)
    state = random_state(robot, seed)
    q, v = state.q.copy(), state.v.copy()

    def rows(there: hsp.RobotState) -> TaskSample:
        held = TaskSample.allocate(6, robot.nv)
        for k, foot in enumerate(feet):
            foot.evaluate(there, held.rows(3 * k, 3 * k + 3))
        return rest.evaluate(there, held, TaskSample.allocate(1, robot.nv))

    sample = rows(state)
    a = np.random.default_rng(seed).standard_normal(robot.nv)
    effort = state.inverse_dynamics(a).copy()
    held = np.vstack([sample_of(foot, state).jacobian for foot in feet])
    u = np.linalg.svd(held[:, base])[2][-1]
    found = sample.jacobian @ a + sample.jacobian_dot @ v - sample.acceleration
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    assert abs(found[0]) == pytest.approx(abs(u @ effort[base]) / mass, rel=1e-9)

    def projector(s: float) -> Array:
        """Compare row spaces: they do not depend on U's sign."""
        row = rows(robot.state(0.0, robot.integrate(q, s * v), v)).jacobian
        held = np.vstack(
            [
                sample_of(f, robot.state(0.0, robot.integrate(q, s * v), v)).jacobian
                for f in feet
            ]
        )
        whole = np.vstack([held, row])
        return np.linalg.pinv(whole) @ whole

    # P' of the stacked rows from J' alone: P' = -(J⁺J'P + (J⁺J'P)ᵀ), P = I - J⁺J.
    J = np.vstack([held, sample.jacobian])
    J_dot = np.vstack(
        [*(sample_of(foot, state).jacobian_dot for foot in feet), sample.jacobian_dot]
    )
    P = np.eye(robot.nv) - np.linalg.pinv(J) @ J
    turned = np.linalg.pinv(J) @ J_dot @ P
    assert_allclose(turned + turned.T, slope(projector), atol=1e-6)


# --- the law on a constrained plant --------------------------------------------------


def standing(**options: Any) -> hsp.Controller:
    """Return Talos on two soles: centre of mass, hand, trunk, and a posture."""
    robot = talos()
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    com = state.centroidal.position.copy()
    hand = "gripper_right_base_link"
    at = state.position(hand).copy()
    up, offset = np.array([0.0, 0.0, 1.0]), np.array([0.05, 0.0, 0.1])
    tasks = [
        hsp.CenterOfMass(
            Blend(hsp.Circle(0.02, 2.0, com, normal=up), 0.5, start=com), gains=GAINS
        ),
        hsp.FrameOrientation(
            "torso_2_link",
            HoldOrientation(state.frame("torso_2_link").rotation.copy()),
            gains=GAINS,
            name="trunk",
            priority=1,
        ),
        hsp.FramePosition(
            hand,
            Blend(hsp.Circle(0.05, 3.0, at + offset, normal=[1, 0, 0]), 0.5, start=at),
            gains=GAINS,
            name="hand",
            priority=2,
        ),
    ]
    contacts = [sole(frame) for frame in SOLES]
    return hsp.Controller(
        robot,
        tasks,
        hsp.TargetPosture("home"),
        null_space_gain=6.0,
        contacts=contacts,
        **({"limits": None} | options),
    )


@given(seeds)
@settings(max_examples=20)
def test_effort_and_forces_are_one_solution(seed: int) -> None:
    """M a + N = Sᵀτ + Jcᵀλ, J_c a + J_c'v = -Kd J_c v, forces in their cones."""
    controller = standing(limits=hsp.Limits(velocity="none", position="none"))
    state = random_state(talos(), seed, speed=0.05)
    out = controller.compute(state)
    support = controller.active_stack.support
    rest = state.inverse_dynamics(out.acceleration) - out.tau
    rest = rest - support.map @ out.forces
    assert np.abs(rest).max() < 1e-6  # [N] of 900 N: the solver's residual
    assert not out.tau[:6].any()
    if out.status < Status.RELAXED:
        for contact in controller.contacts:
            sample = sample_of(contact, state)
            moved = sample.jacobian @ out.acceleration + sample.jacobian_dot @ state.v
            assert_allclose(moved, sample.acceleration, rtol=0, atol=1e-7)
    forces = out.forces.reshape(-1, 3)
    assert (forces[:, 2] >= 0.0).all()
    tangential = np.linalg.norm(forces[:, :2], axis=1)
    assert (tangential <= 0.7 * forces[:, 2] + 1e-5).all()
    assert (np.abs(out.tau) <= controller.limits.effort).all()  # type: ignore[union-attr]


def test_forces_are_permitted_up_to_the_friction_cone() -> None:
    """The edges of the inscribed pyramid lie on the cone, with each contact's μ."""
    frictions = (0.3, 0.9)
    contacts = [
        PlannedContact(hsp.contacts.PointContact(foot, friction=mu), PRESENT)
        for foot, mu in zip(FEET, frictions, strict=False)
    ]
    robot = solo()
    rest = np.zeros(robot.nv)
    support = Support(contacts, robot.state(0.0, robot.home(), rest))
    for k, mu in enumerate(frictions):
        for x, y in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
            support.forces[:] = 0.0, 0.0, 5.0, 0.0, 0.0, 5.0
            tangential = 5.0 * mu * np.array([x, y]) / np.sqrt(2.0)
            support.forces[3 * k : 3 * k + 2] = (1.0 - 1e-12) * tangential
            assert support.permits()
            support.forces[3 * k : 3 * k + 2] = (1.0 + 1e-9) * tangential
            assert not support.permits()
    support.forces[:] = 0.0, 0.0, -1.0, 0.0, 0.0, 5.0  # a pulling force
    assert not support.permits()


def test_the_log_has_the_used_friction() -> None:
    """The largest ‖f_t‖/(μ f_n) of a sole's corners, each sole with its own μ."""
    robot, frictions = talos(), (0.4, 0.9)
    contacts = [
        sole(frame, friction=mu) for frame, mu in zip(SOLES, frictions, strict=True)
    ]
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    aside = state.centroidal.position + np.array([0.002, 0.005, 0.0])
    controller = hsp.Controller(
        robot,
        [hsp.CenterOfMass(hsp.Hold(aside), gains=GAINS)],
        contacts=contacts,
        limits=None,
    )
    plant = ContactPlant(robot, [RigidContact(frame) for frame in SOLES])
    log = held(controller, robot.home(), duration=0.002, plant=plant)
    for k in range(len(log)):
        out = controller.compute(robot.state(log.t[k], log.q[k], log.v[k]))
        for frame, mu, forces in zip(
            SOLES, frictions, out.forces.reshape(2, 4, 3), strict=True
        ):
            ratios = [np.hypot(x, y) / (mu * z) for x, y, z in forces if z > 1e-3]
            assert 0.01 < max(ratios) <= 1.0
            used = log[f"contact.{frame}.friction_used"][k]
            assert used == pytest.approx(max(ratios), rel=1e-6)


def test_propositions_hold_for_a_humanoid() -> None:
    """On the constrained plant the errors of both levels obey their equations."""
    controller = standing()
    robot = controller.robot
    plant = ContactPlant(robot, [RigidContact(f) for f in SOLES], damping=40.0)
    q0 = robot.integrate(
        robot.home(), np.r_[np.zeros(6), 0.02 * np.cos(np.arange(robot.nv - 6))]
    )
    v0 = controller.flow(0.0, q0)  # a start that is consistent with the contacts
    how: dict[str, Any] = {"duration": 0.3, "log_period": 0.02, "plant": plant}
    rollout = continuous(controller, q0, v0, tolerance=1e-9, **how)
    assert not rollout["damped"].any()
    check_errors(rollout, 8.0, "center_of_mass", "trunk", "hand", atol=1e-6)
    assert rollout["singular_values"].shape[1] == 9


def test_null_space_decays_on_the_constrained_plant() -> None:
    """Self-motion other than the field's decays like exp(-K_N t)."""
    controller = standing()
    robot = controller.robot
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    controller.compute(state)
    J = controller.active_stack.rows.jacobian
    rng = np.random.default_rng(3)
    v0 = 0.3 * rng.standard_normal(robot.nv)
    v0 -= np.linalg.pinv(J) @ (J @ v0)  # self-motion: no task and no contact moves
    plant = ContactPlant(robot, [RigidContact(f) for f in SOLES], damping=40.0)
    how: dict[str, Any] = {"duration": 0.3, "log_period": 0.02, "plant": plant}
    rollout = continuous(controller, robot.home(), v0, **how)
    check_null_space(rollout, 6.0, least=0.5, rtol=1e-6)
    assert np.abs(rollout["task.hand.error"]).max() < 1e-7


# --- refusals -----------------------------------------------------------------------


def test_a_floating_base_needs_support() -> None:
    robot = solo()
    task = hsp.CenterOfMass(hsp.Hold(np.zeros(3)), gains=GAINS)
    with pytest.raises(
        ContactError, match="no motor moves the free-flyer root of solo12"
    ):
        hsp.Controller(robot, [task])
    with pytest.raises(ContactError, match="base='driven' needs no contacts"):
        hsp.Controller(
            robot,
            [task],
            base="driven",
            contacts=[hsp.contacts.BallContact(FEET[0], radius=0.016)],
            limits=None,
        )
    foot = hsp.contacts.BallContact(FEET[0], radius=0.016)
    with pytest.raises(ContactError, match="two contacts are called 'FL_FOOT'"):
        hsp.Controller(robot, [task], contacts=[foot, foot])
    panda = hsp.Robot.load("panda")
    still = hsp.JointPosture("home", gains=GAINS)
    with pytest.raises(ContactError, match="panda has no free-flyer root"):
        hsp.Controller(panda, [still], base="flying")


def test_a_contact_at_a_frame_that_does_not_exist() -> None:
    robot = solo()
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    foot = hsp.contacts.BallContact(FEET[0], radius=0.016)
    assert foot.placed(Start(state, Scene())) is foot
    wrong = hsp.contacts.BallContact("FL_FOTO", radius=0.016, name="left")
    with pytest.raises(FrameNotFoundError, match="did you mean 'FL_FOOT'") as raised:
        wrong.placed(Start(state, Scene()))
    assert raised.value.path == ("frame",)
    task = hsp.CenterOfMass(hsp.Hold(np.zeros(3)), gains=GAINS)
    with pytest.raises(FrameNotFoundError, match=r"^contacts\.left\.frame: no frame"):
        hsp.Controller(robot, [task], contacts=[wrong])
