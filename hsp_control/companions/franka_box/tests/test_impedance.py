"""The box's internal controllers: stable at any stiffness, springs in steady state."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from franka_boxes import home, panda

from hsp_control.companions.franka.layouts import PERIOD
from hsp_control.companions.franka_box import impedance
from hsp_control.companions.franka_box.impedance import ArmImpedance
from hsp_control.companions.franka_box.model import Model
from hsp_control.companions.franka_box.reflexes import Reference

REST = np.zeros(7)
STILL = Reference(home(), REST, REST)


def at(q: Any, v: Any = REST) -> Model:
    model = Model(panda())
    model.state.update(0.0, q, v)
    return model


def springs(kind: str, scale: float, model: Model) -> ArmImpedance:
    if kind == "joints":
        return impedance.of_joints(model, scale * impedance.JOINT_STIFFNESS)
    return impedance.of_hand(model, scale * impedance.CARTESIAN_STIFFNESS)


@pytest.mark.parametrize("scale", [0.0, 1e-3, 1.0, 1e3])
@pytest.mark.parametrize("kind", ["joints", "hand"])
def test_the_impedances_are_stable_for_every_stiffness(kind: str, scale: float) -> None:
    """With the exact model the linearised error does not grow: |eigenvalues| ≤ 1."""
    robot, q, h = panda().robot, home(), PERIOD
    fixed = springs(kind, scale, at(q))

    def after(x: Any) -> Any:
        model = at(q + x[:7], x[7:])
        effort = impedance.tracking_effort(model, STILL, fixed) + model.gravity
        v = x[7:] + h * robot.forward_dynamics(model.state.q, model.state.v, effort)
        return np.concatenate([x[:7] + h * v, v])

    step = 1e-6
    columns = [(after(step * e) - after(-step * e)) / (2 * step) for e in np.eye(14)]
    radius = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
    assert radius < 1.0 + 1e-6
    assert scale == 0.0 or radius < 1.0


def test_the_hand_is_a_spring_along_its_own_axes() -> None:
    """Under a small wrench in its axes it deflects by K_x⁻¹ times the wrench."""
    q, K_x = home(), np.array([400.0, 800.0, 1600.0, 20.0, 40.0, 80.0])
    model = at(q)
    model.EE_T_K = pin.SE3(pin.utils.rotate("z", 0.7), np.array([0.0, 0.02, 0.05]))
    K = impedance.of_hand(model, K_x).stiffness
    J, wrench = model.stiffness_jacobian(), 1e-3 * np.array([3, -2, 1, 0.2, 0.1, -0.3])
    yielded = np.linalg.solve(K, J.T @ wrench)
    np.testing.assert_allclose(J @ yielded, wrench / K_x, rtol=1e-9)
    moved = at(q + yielded)
    moved.EE_T_K = model.EE_T_K
    before, after = (m.O_T_EE * m.EE_T_K for m in (model, moved))
    np.testing.assert_allclose(
        pin.log6(before.actInv(after)).vector, wrench / K_x, rtol=1e-3, atol=1e-9
    )


def test_an_external_wrench_is_reported_in_base_and_frame_axes() -> None:
    model, in_K = at(home() + 0.2), np.array([3.0, -2.0, 1.0, 0.2, 0.1, -0.3])
    model.EE_T_K = pin.SE3(pin.utils.rotate("y", 0.7), np.array([0.0, 0.02, 0.05]))
    effort = model.gravity + model.stiffness_jacobian().T @ in_K
    for k in range(600):  # the arm is at rest and pushes
        model.measure(k * PERIOD, home() + 0.2, REST, effort)
    R = (model.O_T_EE * model.EE_T_K).rotation
    in_base, turned = model.external_wrench()
    np.testing.assert_allclose(turned, in_K, rtol=1e-9)
    np.testing.assert_allclose(
        in_base, np.append(R @ in_K[:3], R @ in_K[3:]), rtol=1e-9
    )


def test_an_axis_is_critically_damped_for_its_own_inertia() -> None:
    model, K_x = at(home()), impedance.CARTESIAN_STIFFNESS
    J, M = model.stiffness_jacobian(), np.array(model.state.mass_matrix)
    D = impedance.of_hand(model, K_x).damping
    yielding = J @ np.linalg.solve(D, J.T)  # to a wrench of the hand
    D_x = 2.0 * np.sqrt(K_x / np.diag(J @ np.linalg.solve(M, J.T)))
    np.testing.assert_allclose(yielding, np.diag(1.0 / D_x), atol=1e-12)
    K, D = impedance.of_joints(model, impedance.JOINT_STIFFNESS)
    M = np.diag(np.array(model.state.mass_matrix))
    np.testing.assert_allclose(np.diag(D) ** 2, 4.0 * np.diag(K) * M)
