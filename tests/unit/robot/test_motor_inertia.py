"""Rotor inertia in the model: given, bundled or from a URDF, and kept in copies."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from wording import wording

import hsp_control as hsp
from hsp_control.common.errors import (
    JointNotFoundError,
    ModelError,
    SimulationError,
)
from hsp_control.robot.description.robot_description import RobotDescription
from hsp_control.robot.integrators import Rk4
from hsp_control.robot.recorded import recorded_robot, robot_record
from hsp_control.simulation.plants import RigidBody

ARM = """<robot name="arm">
  <link name="base"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="one"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="3"/></joint>
  <link name="one"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
  <joint name="b" type="prismatic"><origin xyz="0 0 0.4"/><parent link="one"/>
    <child link="two"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="2" effort="9" velocity="3"/></joint>
  <link name="two"><inertial><mass value="0.5"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
  {}
</robot>"""
PLAIN = """<transmission name="t"><type>SimpleTransmission</type><joint name="b"/>
  <actuator name="m"><mechanicalReduction>-50</mechanicalReduction>
  <rotorInertia>2e-5</rotorInertia></actuator></transmission>"""
DRAKE = """<transmission name="t"><type>SimpleTransmission</type><joint name="b"/>
  <actuator name="m"><drake:gear_ratio xmlns:drake="http://drake.mit.edu" value="50"/>
  <drake:rotor_inertia xmlns:drake="http://drake.mit.edu" value="2e-5"/></actuator>
  </transmission>"""
OUTSIDE = """<transmission name="t"><joint name="b"/><actuator name="m">
  <motorInertia>2e-5</motorInertia></actuator>
  <mechanicalReduction>50</mechanicalReduction></transmission>"""
SILENT = """<transmission name="t"><joint name="b"/><actuator name="m">
  <mechanicalReduction>50</mechanicalReduction></actuator></transmission>"""


def arm(tmp_path: Path, transmission: str = "") -> str:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(transmission), encoding="utf-8")
    return str(path)


def armature(robot: hsp.Robot) -> list[float]:
    return [float(each) for each in robot.model.armature]


def test_a_rotor_of_no_joint_is_named_when_the_robot_is_loaded(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    armature(hsp.Robot.load(arm(tmp_path, PLAIN)))
    assert not caplog.text
    path = arm(tmp_path, PLAIN.replace('joint name="b"', 'joint name="bb"'))
    assert armature(hsp.Robot.load(path)) == [0.0, 0.0]
    assert (
        f"{path}: transmission 't': its rotor is assigned to no joint: there is no "
        "joint 'bb'; did you mean 'b'?"
    ) in caplog.text


@pytest.mark.parametrize(
    ("transmission", "expected"),
    [("", 0.0), (PLAIN, 0.05), (DRAKE, 0.05), (OUTSIDE, 0.05), (SILENT, 0.0)],
)
def test_a_urdf_declares_it_in_its_transmissions(
    transmission: str, expected: float, tmp_path: Path
) -> None:
    """I k², for a reduction of any sign; the other joint has none."""
    path = arm(tmp_path, transmission)
    assert armature(hsp.Robot.load(path)) == pytest.approx([0.0, expected])
    given = hsp.Robot.load(path, motor_inertia={"a": 0.2})
    assert armature(given) == pytest.approx([0.2, expected])
    assert armature(hsp.Robot.load(path, motor_inertia=0.3)) == [0.3, 0.3]


def test_a_rotor_that_would_not_turn_is_refused(tmp_path: Path) -> None:
    path = arm(tmp_path, PLAIN.replace("-50", "0"))
    with pytest.raises(ModelError, match="transmission of 'b': its reduction is 0"):
        hsp.Robot.load(path)


@pytest.mark.parametrize("name", ["panda", "iiwa14", "planar3r"])
def test_it_is_the_diagonal_of_m_in_every_algorithm(name: str) -> None:
    rng = np.random.default_rng(0)
    bare = hsp.Robot.load(name)
    own = rng.uniform(0.1, 1.0, bare.nv)
    robot = hsp.Robot.load(name, motor_inertia=own)
    q, v, a = robot.random_configuration(rng), *rng.normal(size=(2, robot.nv))
    state, other = robot.state(0.0, q, v), bare.state(0.0, q, v)
    M = state.mass_matrix
    np.testing.assert_allclose(M, other.mass_matrix + np.diag(own), atol=1e-12)
    np.testing.assert_allclose(
        state.nonlinear_effects, other.nonlinear_effects, atol=1e-12
    )
    np.testing.assert_allclose(
        state.mass_matrix_rate, other.mass_matrix_rate, atol=1e-9
    )
    tau = robot.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(tau, M @ a + state.nonlinear_effects, atol=1e-10)
    np.testing.assert_allclose(robot.forward_dynamics(q, v, tau), a, atol=1e-9)


@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_bundled_arms_have_rotors_on_request(name: str) -> None:
    bare, whole = hsp.Robot.load(name), hsp.Robot.load(name, motor_inertia="bundled")
    assert not bare.model.armature.any()
    assert (whole.model.armature >= 0.1).all()
    first = next(iter(whole.dof_names))
    locked = {**whole.source.locked, first: 0.0}
    fewer = hsp.Robot.load(name, motor_inertia="bundled", locked=locked)
    assert armature(fewer) == armature(whole)[1:]
    again = recorded_robot(robot_record(whole))
    assert armature(again) == armature(whole)

    def condition(robot: hsp.Robot) -> float:
        rest = np.zeros(robot.nv)
        return float(np.linalg.cond(robot.state(0.0, robot.home(), rest).mass_matrix))

    assert condition(whole) < 0.1 * condition(bare)


def test_locking_combining_and_copying_keep_it() -> None:
    from copy import deepcopy

    own = {"panda_joint3": 0.3, "panda_joint7": 0.7}
    locks = ("panda_joint1", "panda_finger_joint1", "panda_finger_joint2")
    locked = hsp.Robot.load(
        "panda",
        locked=dict.fromkeys(locks, 0.0),
        motor_inertia=own,
    )
    assert armature(locked) == [0.0, 0.3, 0.0, 0.0, 0.0, 0.7]
    assert armature(deepcopy(locked)) == armature(locked)
    first = hsp.Robot.load("panda", motor_inertia=0.1)
    second = hsp.Robot.load("iiwa14", motor_inertia=[*range(1, 8)])
    away = pin.SE3(np.eye(3), np.array([0.0, 2.0, 0.0]))
    both = hsp.Robot.combine({"l": (first, pin.SE3.Identity()), "r": (second, away)})
    assert armature(both) == [0.1] * 7 + [*range(1, 8)]
    rest = np.zeros(14)
    M = both.state(0.0, both.home(), rest).mass_matrix
    for robot, place in ((first, slice(0, 7)), (second, slice(7, 14))):
        alone = robot.state(0.0, robot.home(), rest[:7]).mass_matrix
        np.testing.assert_allclose(M[place, place], alone, atol=1e-12)


def test_a_plant_has_the_controller_s_rotors_and_further_ones() -> None:
    robot = hsp.Robot.load("panda", motor_inertia=0.1)
    for part, expected in (
        (RigidBody(), 0.1),
        (RigidBody(motor_inertia=0.05), 0.15),
        (RigidBody(robot=RobotDescription("panda")), 0.1),
        (RigidBody(robot=RobotDescription("panda", motor_inertia=0.0)), 0.0),
    ):
        plant = part.build(robot, Rk4(1e-3))
        np.testing.assert_allclose(plant.robot.model.armature, expected)


def test_a_plant_s_rotors_are_those_of_a_robot() -> None:
    robot = hsp.Robot.load("panda")
    message = r"motor_inertia: 1e\+06 kg m² \(or kg\); a rotor behind its gear has 0 to"
    with pytest.raises(SimulationError, match=message):
        RigidBody(motor_inertia=1e6).build(robot, Rk4(1e-3))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("published", "'published' ... 'bundled'"),
        (-0.1, "-0.1 ... at least 0"),
        ([0.1, 0.2], "... 2 numbers ... 7 joints"),
        ({"panda_joint": 0.1}, "no joint 'panda_joint'"),
        (1e6, "... 'panda_joint1' ... 1e+06 ... 1000"),
    ],
)
def test_mistakes_are_named(given: Any, message: str) -> None:
    with pytest.raises(
        (ModelError, JointNotFoundError), match=wording(f"... motor_inertia: {message}")
    ):
        hsp.Robot.load("panda", motor_inertia=given)


def test_missing_names_are_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="planar3r comes without motor inertias; give"):
        hsp.Robot.load("planar3r", motor_inertia="bundled")
    wrong = PLAIN.replace("2e-5", "much")
    with pytest.raises(ModelError, match="of 'b': <rotorInertia> is 'much'; must be a"):
        hsp.Robot.load(arm(tmp_path, wrong))
    with pytest.raises(ModelError, match="motor_inertia is not for mjcf, whose joints"):
        RobotDescription(mjcf="scene.xml", motor_inertia=0.1)
