"""Frames and dynamics against Pinocchio, differences, energy and MuJoCo."""

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from oracles import slope
from robot_cases import BUNDLED, ROBOTS, draw

from hsp_control import Robot
from hsp_control.common.arrays import Array

LWA = pin.LOCAL_WORLD_ALIGNED


def frames(robot: Robot, rng: np.random.Generator) -> list[str]:
    """Return four random frames and the last, which is often on a mimic joint."""
    chosen = rng.choice(len(robot.frame_names), 4, replace=False)
    return [robot.frame_names[i] for i in chosen] + [robot.frame_names[-1]]


def step_of(v: Array) -> float:
    """Return a step [s] in which the joints together move by 0.01 rad.

    Differences by `oracles.slope` then have a truncation of 1e-14 and rounding of
    1e-13.
    """
    return 0.01 / max(1.0, float(np.abs(v).sum()))


# --- frames --------------------------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
def test_frames_equal_pinocchios(case: str) -> None:
    """Placement, J, J', velocity and classical acceleration (of v' = 0).

    Except J' with mimic joints, where Pinocchio is wrong (by 3.6 on tiago_pro); there
    the differences of the next tests decide.
    """
    robot, q, v, rng = draw(case, seed=1)
    model, data = robot.model, robot.model.createData()
    state = robot.state(0.3, q, v)
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.forwardKinematics(model, data, q, v, np.zeros(robot.nv))
    pin.updateFramePlacements(model, data)
    for name in frames(robot, rng):
        frame, index = state.frame(name), model.getFrameId(name)
        # 1e-13 of entries up to 10: the same sums in another order.
        expected = {
            "rotation": data.oMf[index].rotation,
            "position": data.oMf[index].translation,
            "jacobian": pin.getFrameJacobian(model, data, index, LWA),
            "jacobian_dot": pin.getFrameJacobianTimeVariation(model, data, index, LWA),
            "velocity": pin.getFrameVelocity(model, data, index, LWA).vector,
            "drift": pin.getFrameClassicalAcceleration(model, data, index, LWA).vector,
        }
        if robot.mimics:
            del expected["jacobian_dot"]
        for what, value in expected.items():
            np.testing.assert_allclose(
                getattr(frame, what), value, rtol=1e-13, atol=1e-13, err_msg=what
            )


@pytest.mark.parametrize("case", ROBOTS)
def test_frame_rates_are_derivatives_along_the_flow(case: str) -> None:
    """J', velocity and drift by differences along q ⊕ s v."""
    robot, q, v, rng = draw(case, seed=3)
    state, step = robot.state(0.0, q, v), step_of(v)
    for name in frames(robot, rng):
        frame = state.frame(name)

        def ahead(s: float, name: str = name) -> Any:
            return state.ahead(s).frame(name)

        # Rounding: 2e-16 of J (5 m) over 0.01/Σ|v| s, up to 3e-4 s for 48 joints.
        scale = np.abs(v).sum()
        J_dot = slope(lambda s: ahead(s).jacobian, step)
        np.testing.assert_allclose(
            frame.jacobian_dot, J_dot, rtol=0, atol=1e-12 * scale
        )
        velocity = slope(lambda s: ahead(s).position, step)
        np.testing.assert_allclose(frame.velocity[:3], velocity, rtol=0, atol=2e-11)
        drift = slope(lambda s: ahead(s).velocity, step)
        np.testing.assert_allclose(frame.drift, drift, rtol=0, atol=1e-12 * scale**2)
        np.testing.assert_allclose(
            frame.velocity, frame.jacobian @ v, rtol=1e-13, atol=1e-13
        )


# --- dynamics ------------------------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
def test_mass_matrix_rate_is_the_derivative_along_the_flow(case: str) -> None:
    robot, q, v, _ = draw(case, seed=6)
    state = robot.state(0.0, q, v)
    expected = slope(lambda s: state.ahead(s).mass_matrix, step_of(v))
    # Rounding: 2e-16 of M over 0.01/Σ|v| s.
    atol = 1e-12 * np.abs(state.mass_matrix).max() * np.abs(v).sum()
    np.testing.assert_allclose(state.mass_matrix_rate, expected, rtol=0, atol=atol)
    assert np.abs(expected).max() > 1e3 * atol  # the term is not zero


@pytest.mark.parametrize("case", ROBOTS)
def test_inverse_dynamics_is_m_a_plus_n_and_forward_dynamics_undoes_it(
    case: str,
) -> None:
    robot, q, v, rng = draw(case, seed=9)
    state, a = robot.state(0.0, q, v), rng.standard_normal(robot.nv)
    tau = state.inverse_dynamics(a)
    expected = state.mass_matrix @ a + state.nonlinear_effects
    scale = np.abs(expected).max()
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(
        robot.inverse_dynamics(q, v, a), tau, rtol=0, atol=1e-13 * scale
    )
    # Solving loses digits by the condition number: at most 1e6 here.
    back = robot.forward_dynamics(q, v, tau)
    cond = np.linalg.cond(state.mass_matrix)
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-14 * cond + 1e-12)


def test_mimic_fingers_carry_both_fingers_inertia() -> None:
    """G = ∂(free joints)/∂(own freedoms) gives M = GᵀM_f G, N = GᵀN_f, J = J_f G."""
    robot, q, v, _ = draw("panda_fingers", seed=11)
    free = Robot.load("panda", locked={}, mimic=False)
    G = np.vstack([np.eye(8), np.eye(8)[7]])
    state = robot.state(0.0, q, v)
    other = free.state(0.0, np.append(q, q[7]), G @ v)
    frame, same = (s.frame("panda_rightfinger") for s in (state, other))
    pairs = [
        (state.mass_matrix, G.T @ other.mass_matrix @ G),
        (state.mass_matrix_rate, G.T @ other.mass_matrix_rate @ G),
        (state.nonlinear_effects, G.T @ other.nonlinear_effects),
        (frame.jacobian, same.jacobian @ G),
        (frame.jacobian_dot, same.jacobian_dot @ G),
        (frame.drift, same.drift),
    ]
    for actual, expected in pairs:
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12)


# --- a second engine -----------------------------------------------------------------


def mujoco_model(robot: Robot) -> Any:
    """Return the URDF as MuJoCo reads it, without MuJoCo's additions."""
    mujoco = pytest.importorskip("mujoco")
    tree = ElementTree.parse(robot.source.urdf)
    for link in tree.getroot().findall("link"):
        for tag in ("visual", "collision"):
            for shape in link.findall(tag):
                link.remove(shape)
    text = ElementTree.tostring(tree.getroot(), encoding="unicode")
    model = mujoco.MjModel.from_xml_string(text)
    model.dof_damping[:] = 0.0
    model.dof_frictionloss[:] = 0.0
    model.jnt_limited[:] = 0
    model.eq_active0[:] = 0
    return model


@pytest.mark.parametrize("name", BUNDLED)
@pytest.mark.parametrize("seed", range(3))
def test_dynamics_equal_mujocos(name: str, seed: int) -> None:
    """M, N, forward dynamics, J and J' of the last body, by another engine."""
    mujoco = pytest.importorskip("mujoco")
    robot = Robot.load(name, locked={}, mimic=False)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    names = [
        mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i)
        for i in range(model.njnt)
    ]
    assert names == list(robot.joint_names)
    rng = np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    v, tau = rng.standard_normal((2, robot.nv))
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = robot.joint_positions(q), v, tau
    mujoco.mj_forward(model, data)
    state = robot.state(0.0, q, v)

    # MuJoCo lifts the point masses' inertia to 1e-12 kg m²; the rest is rounding.
    M = np.zeros((robot.nv, robot.nv))
    if hasattr(data, "qM"):  # MuJoCo 3
        mujoco.mj_fullM(model, M, data.qM)
    else:
        mujoco.mj_fullM(model, data, M)
    np.testing.assert_allclose(state.mass_matrix, M, rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        state.nonlinear_effects, data.qfrc_bias, rtol=0, atol=1e-11
    )
    acceleration = robot.forward_dynamics(q, v, tau)
    scale = np.abs(acceleration).max()
    np.testing.assert_allclose(acceleration, data.qacc, rtol=0, atol=1e-9 * scale)

    body = model.nbody - 1
    link = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    frame, point = state.frame(link), data.xpos[body].copy()
    np.testing.assert_allclose(frame.position, point, rtol=0, atol=1e-13)
    for function, expected in (
        (mujoco.mj_jac, frame.jacobian),
        (mujoco.mj_jacDot, frame.jacobian_dot),
    ):
        linear, angular = np.zeros((2, 3, robot.nv))
        function(model, data, linear, angular, point, body)
        np.testing.assert_allclose(
            np.vstack([linear, angular]), expected, rtol=0, atol=1e-12
        )
