"""Rigid contacts: against Pinocchio's solver, and by conserved quantities."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load
from wording import wording

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    FrameNotFoundError,
    ScheduleError,
    SimulationError,
)
from hsp_control.robot.integrators import Dop853
from hsp_control.simulation.plants import ContactPlant, RigidBodyPlant, RigidContact

FEET = {
    "talos": ("surface", ["left_sole_link", "right_sole_link"]),
    "g1": ("surface", ["left_ankle_roll_link"]),
    "solo12": ("point", ["FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"]),
    "go2": ("point", ["FL_foot", "FR_foot", "RL_foot"]),
}


def plant_of(name: str, **options: Any) -> ContactPlant:
    kind, feet = FEET[name]
    contacts = [RigidContact(foot, kind) for foot in feet]  # type: ignore[arg-type]
    return ContactPlant(load(name), contacts, **options)


def contact_rows(plant: ContactPlant, q: Array, v: Array) -> tuple[Array, Array]:
    """Return J and J'v of all contacts."""
    state = plant.robot.state(0.0, q, v)
    frames = [(state.frame(c.frame), c.rows) for c in plant.contacts]
    J = np.vstack([frame.jacobian[:rows] for frame, rows in frames])
    return J, np.concatenate([frame.drift[:rows] for frame, rows in frames])


def stance(plant: ContactPlant, seed: int, speed: float = 1.0) -> tuple[Array, Array]:
    """Return a random configuration, and a velocity with J v = 0 at contacts."""
    robot, rng = plant.robot, np.random.default_rng(seed)
    q = robot.integrate(robot.home(), 0.4 * rng.normal(size=robot.nv))
    v = speed * rng.normal(size=robot.nv)
    J, _ = contact_rows(plant, q, v)
    return q, v - np.linalg.pinv(J) @ J @ v


def joint_effort(robot: Robot, seed: int) -> Array:
    tau = np.random.default_rng(seed).normal(size=robot.nv)
    tau[:6] = 0.0
    return tau


def wrench(plant: ContactPlant, frame: str, at: Any) -> tuple[Array, Array]:
    """Return the force and the moment on a frame at (t, q, v, tau), as logged."""
    channels = plant.log_channels(*at)
    force, moment = (
        np.asarray(channels[f"plant.contact.{frame}.{part}"].value)
        for part in ("force", "moment")
    )
    return force, moment


@pytest.mark.parametrize("name", FEET)
def test_the_equations_of_motion_hold(name: str) -> None:
    """M v' + N = tau + Σ Jᵀ wrench, and J v' + J'v = -k J v for any velocity.

    No other acceleration and no other forces solve both, where J has full rank.
    """
    plant = plant_of(name, damping=30.0)
    robot = plant.robot
    for seed in range(3):
        q, _ = stance(plant, seed)
        v = np.random.default_rng(10 + seed).normal(size=robot.nv)
        tau = joint_effort(robot, 20 + seed)
        a = plant.acceleration(0.0, q, v, tau)
        state = robot.state(0.0, q, v)
        rest = state.inverse_dynamics(a) - tau
        for contact in plant.contacts:
            force, moment = wrench(plant, contact.frame, (0.0, q, v, tau))
            assert contact.kind == "surface" or not moment.any()
            jacobian = state.frame(contact.frame).jacobian
            rest -= jacobian.T @ np.concatenate([force, moment])
        np.testing.assert_allclose(rest, 0.0, atol=1e-7)
        J, drift = contact_rows(plant, q, v)
        assert np.linalg.matrix_rank(J) == len(J)
        np.testing.assert_allclose(J @ a + drift, -30.0 * J @ v, rtol=0, atol=1e-7)


def test_a_contact_holds_and_does_no_work() -> None:
    """Solo12 falls about four fixed feet for 0.3 s: feet and energy stay constant."""
    plant = plant_of("solo12")
    robot = plant.robot
    q, v = stance(plant, 0, speed=0.5)
    tau = np.zeros(robot.nv)

    def energy(q: Array, v: Array) -> float:
        data = robot.model.createData()
        return float(pin.computeMechanicalEnergy(robot.model, data, q, v))

    before = {
        c.frame: robot.state(0, q, v).position(c.frame).copy() for c in plant.contacts
    }
    q_end, v_end = Dop853(1e-11, 1e-11).advance(
        robot, lambda t, q, v: plant.acceleration(t, q, v, tau), 0.0, 0.3, q, v
    )
    assert np.abs(robot.difference(q, q_end)).max() > 0.1
    assert energy(q_end, v_end) == pytest.approx(energy(q, v), abs=1e-8)
    after = robot.state(0.0, q_end, v_end)
    for frame, place in before.items():
        np.testing.assert_allclose(after.position(frame), place, rtol=0, atol=1e-9)


def test_contacts_are_switched_by_the_clock() -> None:
    robot = load("solo12")
    contacts = [
        RigidContact("FL_FOOT", "point", on=[(0.0, 1.0), (2.0, 3.0)]),
        RigidContact("FR_FOOT", "point", on=[(100.0, None)]),
    ]
    plant = ContactPlant(robot, contacts)
    q, v = stance(plant, 0)
    tau = joint_effort(robot, 0)
    free = RigidBodyPlant(robot).acceleration(0.0, q, v, tau)
    held = {-0.1: False, 0.0: True, 0.9: True, 1.0: False, 2.5: True}
    for t, holds in held.items():
        a = plant.acceleration(t, q, v, tau)
        at = (t, q, v, tau)
        assert wrench(plant, "FL_FOOT", at)[0].any() == holds
        assert not wrench(plant, "FR_FOOT", at)[0].any()
        assert np.allclose(a, free, atol=1e-9) != holds


MISTAKES: list[tuple[Callable[[], object], type, str]] = [
    (lambda: RigidContact("FL_FOOT", "line"), SimulationError,  # type: ignore[arg-type]
     "RigidContact: kind: unknown ... 'line'"),
    (lambda: RigidContact("FL_FOOT", on=[(2, 1)]), ScheduleError,
     "RigidContact: on: ... from 2 to 1 s is empty"),
    (lambda: ContactPlant(load("solo12"), [RigidContact("FL_FOO")]), FrameNotFoundError,
     "contacts.FL_FOO: no ... 'FL_FOO'"),
    (lambda: ContactPlant(load("solo12"), 2 * [RigidContact("FL_FOOT")]),
     SimulationError, "two contacts ... 'FL_FOOT'"),
    (lambda: ContactPlant(load("solo12"), [], damping=-1.0), SimulationError,
     "contacts: damping is -1.0; must not be"),
    (lambda: ContactPlant(load("solo12"), []).acceleration(
        0.0, load("solo12").home(), np.zeros(18), np.ones(18)),
     SimulationError, "... t = 0 s ... floating root"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "error", "message"), MISTAKES)
def test_contacts_that_are_none(
    make: Callable[[], object], error: type, message: str
) -> None:
    with pytest.raises(error, match=wording(message)):
        make()
