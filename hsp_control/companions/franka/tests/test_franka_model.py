"""The arm's own model as a URDF, and its comparison with the controller's."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError, ModelError
from hsp_control.companions.franka.model_check import difference, postures
from hsp_control.companions.franka.robot_model import calibrated, own_model

TOOL = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.8), np.array([0.0, 0.01, 0.1]))
CARRIED = pin.Inertia(0.9, np.array([0.01, -0.02, 0.06]), np.diag([3e-3, 2e-3, 2e-3]))


def reported(body: pin.Inertia = CARRIED) -> dict[str, Any]:
    """Return a load as a Franka reports it."""
    inertia = body.inertia.ravel().tolist()
    return {"mass": body.mass, "center": body.lever.tolist(), "inertia": inertia}


def arm_alone() -> str:
    """Return a URDF as from the control box: the arm up to its flange.

    Its masses are a third larger than the bundled ones.
    """
    top = ElementTree.parse(Robot.load("panda").source.urdf).getroot()
    for each in list(top):
        name = each.get("name", "")
        if name.removeprefix("panda_")[:-1] not in {"link", "joint"}:
            top.remove(each)
            continue
        each.set("name", name.removeprefix("panda_"))
        for end in ("parent", "child"):
            for link in each.findall(end):
                link.set("link", link.get("link", "").removeprefix("panda_"))
        for mass in each.iter("mass"):
            mass.set("value", repr(float(mass.get("value", "")) * 4.0 / 3.0))
    return ElementTree.tostring(top, encoding="unicode")


def reference() -> pin.Model:
    """Return the same with the load, built by Pinocchio alone."""
    model = pin.buildModelFromXML(arm_alone())
    flange = model.frames[model.getFrameId("link8")].placement
    model.inertias[7] += flange.act(CARRIED)
    return model


def loaded(text: str, tmp_path: Path) -> Robot:
    file = tmp_path / "arm.urdf"
    file.write_text(text)
    return Robot.load(file)


def masses_and_gravities(model: pin.Model, q: Array) -> tuple[Array, Array]:
    data = model.createData()
    masses = [np.array(pin.crba(model, data, each)) for each in q]
    upper = [np.triu(M) + np.triu(M, 1).T for M in masses]
    rest = np.zeros(7)
    return np.array(upper), np.array([pin.rnea(model, data, e, rest, rest) for e in q])


@pytest.mark.parametrize("like", [False, True])
def test_a_saved_model_is_the_robot_s(like: bool, tmp_path: Path) -> None:
    text = (
        calibrated(arm_alone(), reported(), Robot.load("panda"))
        if like
        else own_model(arm_alone(), reported(), TOOL.homogeneous.T.ravel().tolist())
    )
    robot = loaded(text, tmp_path)
    q = postures(robot)
    found = difference(robot, q, *masses_and_gravities(reference(), q))
    assert found.gravity < 1e-12
    np.testing.assert_allclose([found.slowest, found.fastest], 1.0, rtol=1e-10)
    found.check(CARRIED.mass)
    state = robot.state(0.0, q[0], np.zeros(7))
    model, bundled = reference(), Robot.load("panda")
    if like:  # names, frames and shapes are the bundled ones
        assert robot.dof_names == bundled.dof_names
        hand = bundled.state(0.0, q[0], np.zeros(7)).position("panda_tcp")
        np.testing.assert_allclose(state.position("panda_tcp"), hand, atol=1e-12)
    else:
        data = model.createData()
        pin.framesForwardKinematics(model, data, q[0])
        tool = data.oMf[model.getFrameId("link8")] * TOOL
        np.testing.assert_allclose(
            state.position("end_effector"), tool.translation, atol=1e-12
        )


def test_a_forgotten_load_is_refused() -> None:
    robot = Robot.load("panda")
    q = postures(robot)
    own = robot.model
    found = difference(robot, q, *masses_and_gravities(own, q))
    assert found.gravity < 1e-12
    light = own.copy()
    light.inertias[7] += pin.Inertia(0.7, np.array([0.0, 0.0, 0.2]), np.zeros((3, 3)))
    found = difference(robot, q, *masses_and_gravities(light, q))
    with pytest.raises(
        HardwareError, match=r"differs .* N·m in g\(q\).*carries 0.7 kg"
    ):
        found.check(0.7)


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_wrong_inertia_is_refused(factor: float) -> None:
    """With Kp = ω² and Kv = 2 ω, M_r = M / λ gives the poles of λ (s² + 2 ω s + ω²)."""
    robot = Robot.load("panda")
    q = postures(robot)
    M, g = masses_and_gravities(robot.model, q)
    found = difference(robot, q, M / factor, g)
    poles = np.roots([1.0, factor * 2.0 * 10.0, factor * 10.0**2])
    frequency = np.sqrt(np.prod(poles).real) / 10.0
    np.testing.assert_allclose([found.slowest, found.fastest], frequency, rtol=1e-10)
    with pytest.raises(HardwareError, match=r"natural frequencies .* 0\.5 to 2"):
        found.check(0.0)


def test_another_robot_is_no_franka() -> None:
    with pytest.raises(ModelError, match="no link link8"):
        own_model("<robot name='a'><link name='b'/></robot>", reported(), [0.0] * 16)
    with pytest.raises(ModelError, match="3 moving joints; needs seven"):
        calibrated(arm_alone(), reported(), Robot.load("planar3r"))
    for text, reason in (
        ("<robot", r"the robot's description:1:\d: malformed XML"),
        ("<!DOCTYPE robot><robot/>", "the robot's description:1: a document type"),
        ("<?xml version='1.0' encoding='ebcdic-9'?><robot/>", "unknown encoding"),
    ):
        with pytest.raises(ModelError, match=reason):
            own_model(text, reported(), [0.0] * 16)


def test_the_joint_of_the_largest_difference_is_named() -> None:
    """At any posture, not only at the first."""
    robot = Robot.load("panda")
    q = postures(robot)
    M, g = masses_and_gravities(robot.model, q)
    g[0, 1] += 0.5
    g[3, 2] -= 1.5
    found = difference(robot, q, M, g)
    assert found.gravity == pytest.approx(1.5)
    assert found.joint == "panda_joint3"
