"""Good postures: regular, within limits, collision-free, near the mid-range."""

import numpy as np
import pinocchio as pin
import pytest
from places import further

from hsp_control import Robot
from hsp_control.common.errors import ConfigurationError, FrameNotFoundError
from hsp_control.geometry import Obstacle, Sphere
from hsp_control.geometry.good_postures import PostureSearch
from hsp_control.null_space.fields import SelfClearance
from hsp_control.robot.inverse_kinematics import Target
from hsp_control.trajectories import Hold

POSE = tuple(range(6))
LEAST = 0.03


def hand(robot: Robot) -> list[tuple[str, tuple[int, ...]]]:
    return [(robot.end_effector, POSE)]


def sigma(robot: Robot, q: np.ndarray) -> float:
    """The smallest singular value of the end effector's Jacobian, by Pinocchio."""
    data = robot.model.createData()
    frame = robot.model.getFrameId(robot.end_effector)
    J = pin.computeFrameJacobian(robot.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    return float(np.linalg.svd(J, compute_uv=False)[-1])


def test_an_arm_that_is_straight_in_the_middle_bends_few_joints() -> None:
    robot = Robot.load("iiwa14")
    search = PostureSearch(robot, hand(robot))
    straight = search.judge(robot.neutral())
    assert straight.regularity < 1e-12
    assert straight.eccentricity == 0.0
    found = search.find(LEAST)
    assert found.regularity == pytest.approx(sigma(robot, found.q), rel=1e-9)
    assert found.regularity > LEAST
    assert np.count_nonzero(np.abs(found.q) > 1e-6) <= 3
    state = robot.state(0.0, found.q, np.zeros(7))
    assert SelfClearance().minimum_distance(state) > 0.0
    lower, upper = robot.position_limits()
    assert (np.abs(found.q - 0.5 * (lower + upper)) < 0.46 * (upper - lower)).all()


def test_it_keeps_clear_of_obstacles() -> None:
    """A ball at the hand's position in the posture chosen without it."""
    robot = Robot.load("iiwa14")
    free = PostureSearch(robot, hand(robot)).find(LEAST)
    there = robot.state(0.0, free.q, np.zeros(7)).position(robot.end_effector)
    ball = Obstacle("ball", Sphere(0.15), Hold(there))
    search = PostureSearch(robot, hand(robot), [ball])
    touched = search.judge(free.q)
    assert touched.distance < 0.0
    assert touched.pair.endswith("to ball")
    assert not touched.clear
    assert search.find(LEAST).clear


def test_a_pose_is_reached_in_a_good_posture() -> None:
    robot = Robot.load("iiwa14")
    search = PostureSearch(robot, hand(robot))
    target = Target(
        robot.end_effector, pin.SE3(np.eye(3), np.array([0.5, 0.1, 0.6])), 3
    )
    found, again = (search.find_with(target, LEAST) for _ in range(2))
    np.testing.assert_array_equal(found.q, again.q)
    there = robot.state(0.0, found.q, np.zeros(7)).position(robot.end_effector)
    np.testing.assert_allclose(there, [0.5, 0.1, 0.6], atol=1e-8)
    assert sigma(robot, found.q) > LEAST


def test_a_failed_search_is_reported_with_numbers() -> None:
    robot = Robot.load("planar3r")
    search = PostureSearch(robot, [("tip", (0, 1))])
    far = Target("tip", pin.SE3(np.eye(3), np.array([9.0, 0.0, 0.0])), 3)
    with pytest.raises(ConfigurationError, match=r"'tip' cannot reach .* came to \d"):
        search.find_with(far, LEAST)
    upward = PostureSearch(robot, [("tip", (0, 1, 2))])
    with pytest.raises(
        ConfigurationError, match=r"none is regular; .* at best \S+, ne"
    ):
        upward.find(LEAST)
    ball = Obstacle("ball", Sphere(0.5), Hold([0.0, 0.0, 0.0]))
    blocked = PostureSearch(robot, [("tip", (0, 1))], [ball])
    with pytest.raises(
        ConfigurationError, match=r"none is clear; at best .* to ball are"
    ):
        blocked.find(LEAST)
    with pytest.raises(FrameNotFoundError, match="did you mean 'tip'"):
        search.find_with(far._replace(frame="tpi"), LEAST)


def two_arms(name: str, apart: float) -> Robot:
    """Return two equal robots side by side."""
    pytest.importorskip("example_robot_data")
    arm = Robot.load(name)
    places = [pin.SE3(np.eye(3), np.array([0.0, y, 0.0])) for y in (apart, -apart)]
    return Robot.combine({"left": (arm, places[0]), "right": (arm, places[1])})


@pytest.mark.parametrize("apart", [0.2, *further(0.6)])
def test_two_equal_arms_side_by_side_begin_well(apart: float) -> None:
    """One in six postures of a UR10 is free of self-collision: none of 50 for both."""
    robot = two_arms("ur10", apart)
    frames = [f"{side}_tool0" for side in ("left", "right")]
    search = PostureSearch(robot, [(frame, POSE) for frame in frames])
    found = search.find(LEAST)
    assert found.clear
    assert found.regularity > LEAST
    depth, _ = search.overlap(found.q)
    assert depth == 0.0


def test_a_pose_of_one_of_two_equal_arms_is_reached_in_a_good_posture() -> None:
    """The other arm keeps the posture that is good for it alone."""
    robot = two_arms("ur10", 0.6)
    frames = [f"{side}_tool0" for side in ("left", "right")]
    search = PostureSearch(robot, [(frame, POSE) for frame in frames])
    found = search.find(LEAST)
    near = robot.state(0.0, found.q, np.zeros(12)).position("left_tool0")
    there = near + np.array([0.05, 0.0, 0.05])
    target = Target("left_tool0", pin.SE3(np.eye(3), there), 3)
    reached = search.find_with(target, LEAST)
    assert reached.clear
    np.testing.assert_allclose(
        robot.state(0.0, reached.q, np.zeros(12)).position("left_tool0"),
        there, atol=1e-8,
    )  # fmt: skip
