"""Frames move in their links during a tool change; the law stays exact."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from places import further

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.robot.kinematics import LocalMotion

ROBOT = hsp.Robot.load("panda")
FRAME, OTHER = "panda_tcp", "panda_link1"
AT, RAMP = 0.2, 0.4
"""Start and duration of the tool change [s]."""
TIP, TURN = np.array([0.03, -0.05, 0.12]), np.array([0.4, -0.7, 0.3])
H = 1e-4
"""Step of differences [s]: truncation of the order of H², rounding of 1e-16/H²."""

GAINS = hsp.Gains(natural_frequency=6.0, damping_ratio=0.8)
MOVING = hsp.trajectories.ComposedPose(
    hsp.Circle(0.05, 2.0), hsp.trajectories.Spin([0.3, 1.0, 0.2], 0.7)
)
TASKS: dict[str, Callable[[], hsp.Task]] = {
    "position": lambda: hsp.FramePosition(FRAME, hsp.Circle(0.05, 2.0), gains=GAINS),
    "orientation": lambda: hsp.FrameOrientation(FRAME, gains=GAINS),
    "pose": lambda: hsp.FramePose(FRAME, MOVING, gains=GAINS),
    "pose along the tool": lambda: hsp.FramePose(
        FRAME, MOVING, along="tool", gains=GAINS
    ),
    "relative pose": lambda: hsp.tasks.RelativePose(
        FRAME, reference=OTHER, gains=GAINS
    ),
    "pointing": lambda: hsp.tasks.Pointing(FRAME, [0.3, 0.2, -1.0], gains=GAINS),
}


def controller(task: hsp.Task) -> hsp.Controller:
    """Return a controller with two moving frames, the second twice, overlapping."""
    made = hsp.Controller(
        ROBOT,
        [task],
        hsp.TargetPosture("home", name="posture"),
        start=ROBOT.home(),
        limits=None,
    )
    made.at(AT).ramp(RAMP).tool(FRAME, TIP, TURN)
    made.at(0.1).ramp(0.3).tool(OTHER, -TIP, [0.2, 0.1, 0.0])
    made.at(0.25).ramp(0.3).tool(OTHER, 0.5 * TIP)
    made.restart(origin=0.0)
    return made


def motion(seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    q = ROBOT.integrate(ROBOT.home(), 0.1 * rng.standard_normal(7))
    return q, 0.5 * rng.standard_normal(7)


@pytest.mark.parametrize("seed", [0, *further(2)])
@pytest.mark.parametrize("kind", TASKS)
def test_the_law_is_exact_while_the_tool_moves(kind: str, seed: int) -> None:
    """e'' + Kv e' + Kp e = 0, and V' = -2 K_N V, by differences along the motion."""
    made = controller(TASKS[kind]())
    q, v = motion(seed)
    name = made.tasks[0].name
    for t in (0.15, 0.3, 0.37, 0.5):
        out = made.compute(t, q, v)
        assert not out.damped
        rows = made.stack_at(ROBOT.state(t, q, v)).rows
        e, rate = rows.error.copy(), rows.error_rate.copy()
        found, values = [], []
        for s in (-H, H):
            there = ROBOT.integrate(q, s * v + 0.5 * s * s * out.acceleration)
            ahead = copy.deepcopy(made)
            ahead.compute(t + s, there, v + s * out.acceleration)
            found.append(ahead.active_stack.rows.error.copy())
            values.append(0.5 * ahead.diagnose().null_space_norm ** 2)
        back, forth = found
        Kp, Kv, *_ = made.feedback(name)
        wanted = -Kv @ rate - Kp @ e
        scale = np.abs(wanted).max() + np.abs(rate).max()
        assert (forth - back) / (2.0 * H) == pytest.approx(rate, abs=1e-6 * scale)
        second = (forth - 2.0 * e + back) / H**2
        assert second == pytest.approx(wanted, abs=3e-5 * scale)
        V, decay = 0.5 * (values[0] + values[1]), (values[1] - values[0]) / (2.0 * H)
        assert decay == pytest.approx(-2.0 * made.null_space_gain[0, 0] * V, rel=1e-4)


@pytest.mark.parametrize("name", [FRAME, OTHER])
def test_a_frame_that_moves_in_its_joint_has_exact_rates(name: str) -> None:
    """Placement, J, J' and both accelerations, against differences of Pinocchio's."""
    made = controller(TASKS["pose"]())
    q, v = motion(3)
    model, index = ROBOT.model, ROBOT.frame_id(name)

    def placed(t: float, s: float) -> tuple[pin.SE3, Array]:
        """Return the frame's pose and Jacobian with the tool of a time."""
        data, there = model.createData(), ROBOT.integrate(q, s * v)
        pin.framesForwardKinematics(model, data, there)
        pin.computeJointJacobians(model, data, there)
        tool = next(each for each in made.setup.tools if each.frame == name)
        sample = tool.placement.sample(t)
        offset = pin.SE3(sample.orientation.rotation, sample.position.position)
        joint = model.frames[index].parentJoint
        pose = data.oMf[index] * offset
        J = pin.getJointJacobian(
            model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        arm = pose.translation - data.oMi[joint].translation
        J[:3] -= pin.skew(arm) @ J[3:]
        return pose, J

    for t in (0.3, 0.41, 0.9):
        made.compute(t, q, v)
        frame = made.state.frame(name)
        (pose, J), (before, J_b), (after, J_a) = (
            placed(t, 0.0),
            placed(t - H, -H),
            placed(t + H, H),
        )
        np.testing.assert_allclose(frame.position, pose.translation, atol=1e-14)
        np.testing.assert_allclose(frame.rotation, pose.rotation, atol=1e-14)
        np.testing.assert_allclose(frame.jacobian, J, atol=1e-14)
        np.testing.assert_allclose(
            frame.jacobian_dot, (J_a - J_b) / (2.0 * H), atol=1e-6
        )
        linear = (after.translation - before.translation) / (2.0 * H)
        turned = pin.log3(after.rotation @ before.rotation.T) / (2.0 * H)
        np.testing.assert_allclose(frame.velocity[:3], linear, atol=1e-6)
        np.testing.assert_allclose(frame.velocity[3:], turned, atol=1e-6)
        own = frame.velocity - frame.jacobian @ v
        np.testing.assert_allclose(frame.own_velocity, own, atol=1e-12)
        assert (np.abs(own).max() > 0.01) == (t < 0.6)
        second = after.translation - 2.0 * pose.translation + before.translation
        np.testing.assert_allclose(frame.drift[:3], second / H**2, atol=1e-5)
        step = [pin.log3(after.rotation @ pose.rotation.T)]
        step.append(pin.log3(pose.rotation @ before.rotation.T))
        turning = (step[0] - step[1]) / H**2
        np.testing.assert_allclose(frame.drift[3:], turning, atol=1e-5)


def test_efforts_stay_continuous_where_a_tool_comes_and_goes() -> None:
    made = controller(TASKS["pose"]())
    q, v = motion(5)
    edges = (0.1, 0.2, 0.25, 0.4, 0.55, 0.6)
    for edge in edges:
        low, high = edge - 1e-9, edge + 1e-9
        jump = made.compute(high, q, v).tau - made.compute(low, q, v).tau
        assert np.abs(jump).max() < 1e-6


def test_a_tip_stays_where_it_is_to_be_while_it_is_exchanged() -> None:
    """In closed loop the task error shows no effect of the moving tool."""
    made = hsp.Controller(ROBOT, [hsp.FramePosition(FRAME, name="hand")], limits=None)
    made.at(AT).ramp(RAMP).tool(FRAME, [0.0, 0.0, 0.1])
    run = hsp.simulate(made, ROBOT.home(), duration=1.0)
    assert np.abs(run["task.hand.error"]).max() < 1e-7
    state = ROBOT.state(1.0, run.q[-1], run.v[-1])
    moved = state.position(FRAME) - run["task.hand.actual"][0]
    assert np.linalg.norm(moved) == pytest.approx(0.1, abs=1e-6)


def test_a_target_is_relative_to_the_present_tool() -> None:
    """Relative values of a change refer to the tip, and so does a copy of the run."""
    made = hsp.Controller(ROBOT, [hsp.FramePosition(FRAME, name="hand")])
    q, v = ROBOT.home(), np.zeros(7)
    made.at(0.0).ramp(0.1).tool(FRAME, TIP)
    made.compute(0.0, q, v)
    made.compute(0.5, q, v)
    tip = made.state.position(FRAME).copy()
    made.at(0.5).ramp(0.1).reference("hand", hsp.Hold())
    twin = pickle.loads(pickle.dumps(made))
    for each in (made, twin):
        each.compute(3.0, q, v)
        np.testing.assert_allclose(each.active_stack.rows.error, 0.0, atol=1e-14)
        np.testing.assert_array_equal(each.state.position(FRAME), tip)
    home = ROBOT.state(0.0, q, v)
    rotation = home.frame(FRAME).rotation
    np.testing.assert_allclose(tip, home.position(FRAME) + rotation @ TIP, atol=1e-14)
    made.restart()
    made.compute(0.0, q, v)
    np.testing.assert_array_equal(made.state.position(FRAME), home.position(FRAME))


def test_only_the_controller_moves_its_frames() -> None:
    """Neither holders of the state nor user code can write it; a snapshot is a copy."""
    made = controller(TASKS["position"]())
    made.compute(0.0, *motion(0))
    there = LocalMotion.fixed(pin.SE3(np.eye(3), TIP))
    for state in (made.state, made.state.read_only):
        with pytest.raises(hsp.errors.ImmutableError, match=r"controller.at\(t\).tool"):
            state.move_frame(FRAME, there)
    before = made.state.position(FRAME).copy()
    own = made.state.snapshot()
    own.move_frame(FRAME, there)
    assert np.abs(own.position(FRAME) - before).max() > 0.01
    np.testing.assert_array_equal(made.state.position(FRAME), before)


def test_a_frame_that_there_is_not_is_named() -> None:
    made = hsp.Controller(ROBOT, [hsp.FramePosition(FRAME, name="hand")])
    with pytest.raises(hsp.HspControlError, match=r"frame: .*'panda_tpc'.*panda_tcp"):
        made.at(0.0).tool("panda_tpc", TIP)
