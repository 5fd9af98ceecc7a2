"""A user's MuJoCo scene as a plant: the robot, its motors, and objects."""

import re
from typing import Any

import numpy as np
import pytest
from mjcf_texts import ARM, CELL

from hsp_control import Controller, FramePosition, Gains, Robot, simulate
from hsp_control.common.errors import (
    FrameNotFoundError,
    JointNotFoundError,
    SimulationError,
)
from hsp_control.companions.mujoco import MujocoScenePlant
from hsp_control.companions.mujoco.plant import Mujoco, MujocoPlant
from hsp_control.simulation.plants import Push
from hsp_control.trajectories import Circle

mujoco = pytest.importorskip("mujoco")

BALL = 5  # the first degree of freedom of the ball in qvel
EFFORT = np.array([3.0, 40.0, -2.0, 5.0])


def cell(text: str = CELL) -> tuple[Robot, Any, Any]:
    """Return the cell's arm, the scene, and the state at its keyframe."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    joints = [name for name in ARM if f'joint name="{name}"' in text]
    keyframe = "home" if model.nkey else None
    return Robot.from_mujoco(model, "base", joints, keyframe=keyframe), model, data


def at_home(robot: Robot, plant: MujocoScenePlant) -> None:
    plant.reset(0.0, robot.home(), np.zeros(robot.nv))


def without_gripper() -> str:
    """Return the cell with only moving joints in its robot."""
    text = re.sub(r'<joint name="f".*?/>', "", CELL)
    text = re.sub(r"<position.*?/>", "", text)
    return re.sub(r"<keyframe>.*</keyframe>", "", text, flags=re.DOTALL)


def test_it_moves_like_the_plant_that_is_made_of_the_robot() -> None:
    """The same engine with two models: one from the scene, one from the robot."""
    robot, model, data = cell(without_gripper())
    ours = MujocoScenePlant(robot, model, data)
    theirs = MujocoPlant(robot, Mujoco(timestep=0.001, friction="urdf"))
    q, v = np.array([0.1, 0.5, -0.2, 1.0]), np.array([0.3, -0.2, 0.5, 0.1])
    ends = []
    for plant in (ours, theirs):
        plant.reset(0.0, q, v)
        x = q, v
        for k in range(100):
            x = plant.advance(0.001 * k, 0.001 * (k + 1), EFFORT)
        ends.append(np.concatenate(x))
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-9)


def test_efforts_go_through_the_motors_and_their_limits() -> None:
    robot, model, data = cell()
    plant = MujocoScenePlant(robot, model, data)
    at_home(robot, plant)
    plant.advance(0.0, 0.001, EFFORT)
    np.testing.assert_allclose(data.qfrc_actuator[:4], EFFORT, rtol=1e-12)
    np.testing.assert_allclose(data.ctrl[:4], EFFORT / [50.0, 100.0, -20.0, 10.0])
    np.testing.assert_array_equal(data.qfrc_applied, 0.0)
    plant.advance(0.001, 0.002, np.array([60.0, 0.0, 30.0, -11.0]))
    np.testing.assert_allclose(data.qfrc_actuator[:4], [50.0, 0.0, 20.0, -10.0])


def test_the_rest_of_the_scene_lives_on() -> None:
    """The ball falls freely; the gripper's servo follows its own control."""
    robot, model, data = cell()
    data.qpos[7] = 1.0  # the ball's height
    data.ctrl[4] = 0.035
    plant = MujocoScenePlant(robot, model, data)
    at_home(robot, plant)
    end = 0.2
    plant.advance(
        0.0, end, robot.state(0.0, robot.home(), np.zeros(4)).nonlinear_effects
    )
    # Semi-implicit Euler: v = g t, and half a step more than ½ g t².
    assert data.qvel[BALL + 2] == pytest.approx(-9.81 * end, rel=1e-9)
    fallen = 0.5 * 9.81 * end * (end + 0.001)
    assert data.qpos[7] == pytest.approx(1.0 - fallen, rel=1e-9)
    assert data.qpos[4] > 0.02
    assert data.time == pytest.approx(end)


def test_two_bodies_of_the_scene_push_each_other_equally() -> None:
    """The hand is pushed down on the ball: action equals reaction."""
    robot, model, data = cell()
    state = robot.state(0.0, robot.home(), np.zeros(4))
    finger = state.position("finger")
    data.qpos[5:8] = finger
    data.qpos[5] += 0.03
    model.opt.gravity[:] = 0.0
    model.geom_contype[0] = model.geom_conaffinity[0] = 0  # no floor
    plant = MujocoScenePlant(robot, model, data, contacts=["ball", "finger", "hand"])
    at_home(robot, plant)
    channels = plant.log_channels(0.0, robot.home(), np.zeros(4), np.zeros(4))
    names = ("ball", "finger", "hand")
    forces = [channels[f"plant.contact.{name}.force"].value for name in names]
    assert np.linalg.norm(forces[0]) > 0.1
    np.testing.assert_allclose(np.sum(forces, axis=0), 0.0, atol=1e-12)


def test_pushes_are_applied_besides_the_motors() -> None:
    robot, model, data = cell()
    push = Push("tip", force=(0.0, 10.0, 0.0), start=0.0, duration=1.0)
    plant = MujocoScenePlant(robot, model, data, pushes=[push])
    at_home(robot, plant)
    plant.advance(0.0, 0.001, EFFORT)
    state = robot.state(0.0, robot.home(), np.zeros(4))
    expected = state.frame("tip").jacobian[:3].T @ [0.0, 10.0, 0.0]
    np.testing.assert_allclose(data.qfrc_applied[:4], expected, atol=1e-12)
    np.testing.assert_allclose(data.qfrc_actuator[:4], EFFORT, rtol=1e-12)


def test_a_controller_tracks_in_the_scene() -> None:
    """With the scene's model: half a millimetre, mostly due to held efforts.

    Without compensation of the joint's damping, which the controller's model lacks.
    """
    robot, model, data = cell(CELL.replace('damping=".5"', ""))
    plant = MujocoScenePlant(robot, model, data)
    circle = Circle(0.05, 2.0)
    task = FramePosition("tip", circle, gains=Gains(natural_frequency=20.0))
    q = robot.home()
    rollout = simulate(
        Controller(robot, [task], start=q),
        q,
        np.zeros(4),
        duration=1.5,
        control_period=0.001,
        plant=plant,
    )
    late = rollout.t > 1.0
    assert np.abs(rollout["task.tip.error"][late]).max() < 5e-4
    assert rollout.meta["plant"]["type"] == "MujocoScenePlant"


def test_a_motion_that_diverges_is_an_error() -> None:
    robot, model, data = cell(re.sub(r'ctrllimited.*ctrlrange="-1 1"', "", CELL))
    plant = MujocoScenePlant(robot, model, data)
    at_home(robot, plant)
    with pytest.raises(SimulationError, match=r"diverged before t = 0\.1 s"):
        plant.advance(0.0, 0.1, np.full(4, 1e12))
    at_home(robot, plant)  # a new run forgets it
    plant.advance(0.0, 0.001, EFFORT)


# --- servos and mistakes -------------------------------------------------------------

SERVO = CELL.replace('<motor name="m4"', '<position name="p4" kp="50"')


def test_servos_on_the_robots_joints_are_refused_or_switched_off() -> None:
    robot, model, data = cell(SERVO)
    data.ctrl[4] = 0.04
    message = r"^actuators p4 of the scene are no torque motors .* set disable_servos$"
    with pytest.raises(SimulationError, match=message):
        MujocoScenePlant(robot, model, data)
    plant = MujocoScenePlant(robot, model, data, disable_servos=True)
    at_home(robot, plant)
    plant.advance(0.0, 0.001, EFFORT)
    assert data.qfrc_actuator[3] == 0.0
    assert data.qfrc_applied[3] == EFFORT[3]
    assert data.actuator_force[4] != 0.0  # the gripper's is the user's
    MujocoScenePlant(robot, model, data)  # now inactive


@pytest.mark.parametrize("servo", [
    "<position joint='j4' kp='9'/>",
    "<velocity joint='j4' kv='3'/>",
    "<damper joint='j4' kv='2' ctrlrange='0 1'/>",
    "<muscle joint='j4' lengthrange='.1 2'/>",
    "<general joint='j4' dyntype='filter' dynprm='.1' gainprm='4'/>",
    "<general joint='j4' gaintype='affine' gainprm='1 2 3'/>",
])  # fmt: skip
def test_every_kind_of_servo_can_be_switched_off(servo: str) -> None:
    text = without_gripper().replace("</actuator>", f"{servo}</actuator>")
    robot, model, data = cell(re.sub(r'<motor name="m4".*?/>', "", text))
    data.ctrl[3], data.qvel[:4] = 0.5, 1.0
    data.act[:] = 0.5
    mujoco.mj_forward(model, data)
    assert abs(data.qfrc_actuator[3]) > 0.1
    with pytest.raises(SimulationError, match="are no torque motors"):
        MujocoScenePlant(robot, model, data)
    MujocoScenePlant(robot, model, data, disable_servos=True)
    mujoco.mj_forward(model, data)
    assert data.qfrc_actuator[3] == 0.0


def test_a_robot_in_self_collision_is_reported_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """MuJoCo enables collisions of parent and child if the parent is static."""
    scene = """<mujoco><worldbody>
      <body name="stand"><geom size="0.1"/>
        <body name="arm" pos="0 0 {height}">
          <joint name="turn"/>{deeper}<geom size="0.1" pos="0.1 0 0.02"/>{last}
        </body>
      </body></worldbody></mujoco>"""
    # Of two contacts the deeper one is reported, in any order.
    deeper, told = '<geom size="0.1"/>', ["stand and arm (50 mm)"]
    for height, order, reported in (
        (0.15, {"deeper": deeper, "last": ""}, told),
        (0.15, {"deeper": "", "last": deeper}, told),
        (0.2001, {"deeper": deeper, "last": ""}, []),
    ):
        model = mujoco.MjModel.from_xml_string(scene.format(height=height, **order))
        robot = Robot.from_mujoco(model, "stand", ["turn"])
        plant = MujocoScenePlant(robot, model, mujoco.MjData(model))
        caplog.clear()
        for _ in range(2):
            plant.reset(0.0, np.zeros(1), np.zeros(1))
        found = [each.getMessage() for each in caplog.records]
        assert len(found) == len(reported)
        assert all(pair in line for pair, line in zip(reported, found, strict=True))


def test_mistakes() -> None:
    robot, model, data = cell()
    with pytest.raises(FrameNotFoundError, match=r"^contacts: no body 'bal'; did you"):
        MujocoScenePlant(robot, model, data, contacts=["bal"])
    other = mujoco.MjModel.from_xml_string(CELL.replace('"j1"', '"k1"'))
    with pytest.raises(JointNotFoundError, match=r"no joint 'j1'"):
        MujocoScenePlant(robot, other, mujoco.MjData(other))
