"""A pose along the axes of its tool: the error equation, by differences."""

import numpy as np
import pytest
from task_cases import SECOND, TIME, Case, Motion, Pose, ToolPose, place

import hsp_control as hsp
from hsp_control.common.arrays import Array

KP = np.array([20.0, 200.0, 500.0, 100.0, 50.0, 80.0])
KV = np.array([9.0, 20.0, 30.0, 20.0, 14.0, 18.0])
GAINS = hsp.Gains(KP, KV)


@pytest.mark.parametrize("robot", ["panda", "iiwa14"])
@pytest.mark.parametrize("seed", range(3))
def test_each_axis_of_the_tool_has_its_own_gains(robot: str, seed: int) -> None:
    """e'' + Kv e' + Kp e = 0 while the desired frame tumbles and its origin moves."""
    frame = {"panda": "panda_tcp", "iiwa14": "iiwa_link_ee"}[robot]
    motion = place(Case(robot, ToolPose(frame)), seed)
    task = ToolPose(frame).build(motion.robot, motion, 0.4, GAINS, seed)
    controller = hsp.Controller(motion.robot, [task], limits=None)
    state = motion.robot.state(TIME, motion.q, motion.v)
    output = controller.compute(state)
    assert not output.damped

    def error(s: float) -> Array:
        q, still = moving.configuration(s), np.zeros(motion.robot.nv)
        state = motion.robot.state(TIME + s, q, still)
        return task.evaluate(state, feedback=task.feedback()).error

    moving = Motion(motion.robot, motion.q, motion.v, output.acceleration)
    e, e_dot = error(0.0), moving.derivative(error)
    scale = np.abs(KP * e).max()
    np.testing.assert_allclose(output.error(task.name), e, rtol=0, atol=1e-14)
    np.testing.assert_allclose(output.error_rate(task.name), e_dot, atol=1e-8 * scale)
    residual = moving.derivative(error, SECOND) + KV * e_dot + KP * e
    assert np.abs(residual).max() < 1e-7 * scale


def test_it_is_the_error_in_the_world_turned() -> None:
    frame, seed = "panda_tcp", 1
    motion = place(Case("panda", Pose(frame)), seed)
    state = motion.robot.state(TIME, motion.q, motion.v)
    world, tool = (
        family.build(motion.robot, motion, 0.4, GAINS, seed)
        for family in (Pose(frame), ToolPose(frame))
    )
    R_d = world.followed.sample(TIME).orientation.rotation
    seen = [task.evaluate(state, feedback=task.feedback()) for task in (world, tool)]
    np.testing.assert_allclose(seen[1].error[:3], R_d.T @ seen[0].error[:3], atol=1e-14)
    np.testing.assert_array_equal(seen[1].error[3:], seen[0].error[3:])
    turned = R_d.T @ seen[0].jacobian[:3]
    np.testing.assert_allclose(seen[1].jacobian[:3], turned, atol=1e-14)
    rate = R_d.T @ world.reference_rate(state)[:3]
    np.testing.assert_allclose(tool.reference_rate(state)[:3], rate, atol=1e-14)


def test_a_polishing_hand_is_soft_along_its_tool_alone() -> None:
    """A force along the tool displaces the hand by f/K, at any orientation."""
    robot = hsp.Robot.load("panda")
    spring = hsp.Impedance([4000.0, 4000.0, 200.0, 200.0, 200.0, 200.0])
    hand = hsp.FramePose("panda_tcp", impedance=spring, along="tool", name="hand")
    q0 = robot.integrate(robot.home(), np.array([0.2, 0.3, -0.2, 0.2, 0.5, -0.6, 0.4]))
    tool = robot.state(0.0, q0, np.zeros(7)).frame("panda_tcp").rotation[:, 2].copy()
    push = hsp.plants.Push("panda_tcp", (8.0 * tool).tolist(), duration=10.0)
    plant = hsp.plants.RigidBody(pushes=[push])
    run = hsp.simulate(
        hsp.Controller(robot, [hand], limits=None), q0, duration=3.0, plant=plant
    )
    moved = run["task.hand.error"][-1]
    np.testing.assert_allclose(moved[:3], [0.0, 0.0, -8.0 / 200.0], atol=1e-5)
