"""A leg's effect on the centre of pressure, against Pinocchio's inverse dynamics."""

import numpy as np
import pinocchio as pin
import pytest

from hsp_control import load_experiment
from hsp_control.companions.walking.footsteps import Footstep
from hsp_control.companions.walking.leg_reaction import LegReaction
from hsp_control.companions.walking.swing import Swing

pytest.importorskip("example_robot_data")
W, H = 3.3, 1e-5
FRAMES = {1.0: "left_sole_link", -1.0: "right_sole_link"}


@pytest.fixture(scope="module")
def talos():
    """Talos with one foot ahead and rotated, and its legs' reaction."""
    experiment = load_experiment("walking/talos_walk")
    robot, step = experiment.robot, np.zeros(experiment.robot.nv)
    for joint, angle in (("left_1", 0.3), ("left_3", -0.4), ("right_3", 0.3)):
        step[robot.velocity_index(f"leg_{joint}_joint")] = angle
    q = robot.integrate(experiment.q0, step)
    state = robot.state(0.0, q, np.zeros(robot.nv))
    legs = LegReaction(experiment.controller, "base_link", FRAMES)
    return experiment, state, legs


def pressed(state, rows, wanted):
    """Return the centre of pressure of the smallest motion with accelerations, (2,).

    From the wrench at the root, by inverse dynamics; relative to the centre of
    mass, on the ground 1 m below it.
    """
    a = np.linalg.lstsq(rows, wanted)[0]
    model, data = state.robot.model, state.robot.model.createData()
    root = pin.rnea(model, data, state.q, state.v, a)[:6]
    center = pin.centerOfMass(model, data, state.q)
    wrench = data.oMi[1].act(pin.Force(root))
    force, ground = wrench.linear, center - np.array([0.0, 0.0, 1.0])
    moment = wrench.angular - np.cross(ground, force)
    return np.array([-moment[1], moment[0]]) / force[2]


def rows_of(state, side):
    return np.vstack(
        [
            state.frame(FRAMES[side]).jacobian,
            state.frame(FRAMES[-side]).jacobian,
            state.centroidal.jacobian,
            state.frame("base_link").jacobian[3:],
        ]
    )


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_leg_that_swings_moves_the_centre_of_pressure(talos, side, axis):
    experiment, state, legs = talos
    legs.lifts(state, side, 0.0)
    legs.lands(state, side, 0.0)
    rows = rows_of(state, side)
    wanted = np.zeros(18)
    wanted[axis] = 2.0
    moved = pressed(state, rows, wanted)
    # K is in axes of the stance foot, whose yaw is zero here.
    assert legs._first[side][:, axis] * -2.0 == pytest.approx(moved, abs=1e-9)
    if axis == 0:  # forward: the centre of pressure moves ahead by centimetres
        assert moved[0] > 0.01
    turned, yaw = LegReaction(experiment.controller, "base_link", FRAMES), 0.7
    turned.lifts(state, side, yaw)
    R = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    whole = np.eye(3)
    whole[:2, :2] = R
    assert R @ turned._first[side] @ whole.T == pytest.approx(legs._first[side])


def test_the_reaction_to_a_swing_obeys_the_pendulum(talos):
    """η' = ω (η - δ), zero at touchdown, with δ = K a and varying K."""
    _, state, legs = talos
    yaw = 0.4
    legs.begin(state, yaw, 0.6, W)
    bent = np.zeros(state.robot.nv)
    bent[state.robot.velocity_index("leg_left_4_joint")] = 0.8
    q = state.robot.integrate(state.q, bent)
    landed = state.robot.state(0.0, q, np.zeros(state.robot.nv))
    legs.lands(landed, 1.0, yaw)
    standing, target = Footstep(0.0, 0.0, yaw), Footstep(0.5, 0.3, yaw)
    place = np.array([-0.1, 0.1, 0.1])
    swing = Swing(2.0, 0.6, place, np.eye(3), target, np.eye(3), 0.1, 0.05)
    reaction = legs.of(swing, 2.0, 1.0, standing)
    times = np.linspace(2.0, 2.6, 13)[1:-1]
    sampled = np.array([swing.position(t).acceleration for t in times])
    assert swing.accelerations(times) == pytest.approx(sampled, abs=1e-12)
    first, last = (legs._gain(each, 1.0, 0.0) for each in (state, landed))  # in world
    assert np.abs(last - first).max() > 0.1 * np.abs(first).max()
    assert np.abs(reaction.points).max() > 0.01
    for t, a in zip(times, sampled, strict=True):
        K = first + (t - 2.0) / 0.6 * (last - first)
        # Linear between 49 samples of a motion of 0.6 s.
        assert reaction.point(t) == pytest.approx(K @ a, abs=5e-4)
        rate = (reaction.shift(t + H) - reaction.shift(t - H)) / (2 * H)
        expected = W * (reaction.shift(t) - reaction.point(t))
        assert rate == pytest.approx(expected, abs=0.02)
    assert not reaction.shift(2.6).any()
    way = np.array([*(target.point - place[:2]), 0.05])
    assert legs.lead(1.0, standing, way) == pytest.approx(
        reaction.shift(2.0), abs=1e-12
    )
