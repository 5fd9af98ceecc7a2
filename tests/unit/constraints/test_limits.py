"""Limits as numbers of a robot, and distance limits.

``tests/unit/control/test_limits.py`` tests them in the control step.
"""

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from loaded_robots import panda
from places import further
from states import at_home

from hsp_control import Hold, Limits, Obstacle, Robot, Sphere
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    FieldError,
    HspControlError,
    JointNotFoundError,
    LimitError,
    SceneError,
)
from hsp_control.constraints.limits import (
    ByJoint,
    MinimumDistance,
    ObstacleDistance,
    PositionRange,
    PositionsByJoint,
    RobotLimits,
    Scaled,
    SelfDistance,
)
from hsp_control.geometry.shapes import Box, PointCloud
from hsp_control.trajectories import Lissajous


@cache
def fingers() -> Robot:
    """Return a Panda whose fingers mimic each other."""
    return Robot.load("panda", locked={})


@cache
def talos() -> Robot:
    pytest.importorskip("example_robot_data")
    return Robot.load("talos")


def of(robot: Robot, *scene: Obstacle, **options: Any) -> RobotLimits:
    return Limits(**options).placed(at_home(robot, *scene))


def test_a_joint_without_a_speed_has_the_largest_of_its_unit() -> None:
    """Otherwise this joint could be commanded any speed to keep the others' limits."""
    own = panda().model.velocityLimit
    assert own.max() > own[0]  # its joints have two degrees of freedom
    for missing in (0.0, np.finfo(np.float32).max):
        model = panda().model.copy()
        model.velocityLimit[0] = missing
        limits = of(Robot.from_pinocchio(model))
        np.testing.assert_array_equal(limits.velocity, [own.max(), *own[1:]])


# --- numbers -------------------------------------------------------------------------


def test_by_default_they_are_the_robots_own() -> None:
    robot = panda()
    limits = of(robot)
    assert limits.robot is robot
    np.testing.assert_array_equal(limits.effort, robot.model.effortLimit)
    np.testing.assert_array_equal(limits.velocity, robot.model.velocityLimit)
    lower, upper = robot.position_limits()
    np.testing.assert_array_equal(limits.lower, lower)
    np.testing.assert_array_equal(limits.upper, upper)
    np.testing.assert_array_equal(limits.motion.lower, lower + 0.005)
    np.testing.assert_array_equal(limits.motion.upper, upper - 0.005)
    np.testing.assert_array_equal(limits.motion.velocity, 0.98 * limits.velocity)
    np.testing.assert_array_equal(limits.effort_rate, np.full(7, 11.0 * 87.0))
    jerk = limits.effort_rate / robot.largest_inertias
    np.testing.assert_array_equal(limits.motion.jerk, jerk)
    assert np.isinf(limits.acceleration).all()
    assert limits.bandwidth == 10.0
    assert limits.barriers == ()


def test_by_default_gravity_may_overload_no_motor_of_an_arm() -> None:
    """The gain is limited where it could demand more than a motor's effort."""
    robot, rng, rest = panda(), np.random.default_rng(1), np.zeros(7)
    for _ in range(2000):
        requested = robot.inverse_dynamics(robot.random_configuration(rng), rest, rest)
        assert (np.abs(requested) < robot.largest_gravity).all()
    for none in ({}, {"effort": "none"}, {"effort": 1.0, "static_effort": "none"}):
        assert of(robot, **none).static_effort is None
    assert of(fingers(), effort=1.0).static_effort is not None
    held = of(robot, effort=[87.0, 87.0, 30.0, 50.0, 12.0, 12.0, 12.0]).static_effort
    assert held is not None
    assert held.share == 0.95
    np.testing.assert_array_equal(np.isfinite(held.effort), np.arange(7) == 2)


def test_the_rate_of_efforts_is_one_for_all_joints_of_a_unit() -> None:
    limits = of(fingers())
    sliding = np.array(fingers().units) == "m"
    assert 0 < sliding.sum() < fingers().nv
    np.testing.assert_array_equal(limits.effort_rate[~sliding], 11.0 * 87.0)
    largest = limits.effort[sliding].max()
    np.testing.assert_array_equal(limits.effort_rate[sliding], 11.0 * largest)


def test_one_number_or_one_for_each() -> None:
    numbers = np.arange(1.0, 8.0)
    some = [1.0, None, np.inf, 4.0, 5.0, 6.0, 7.0]
    limits = of(
        panda(), effort=3.0, effort_rate=1000.0, velocity=numbers, velocity_margin=0.5,
        acceleration=some, position=PositionRange(-1.0, numbers), position_margin=0.25,
        bandwidth=7.0,
    )  # fmt: skip
    np.testing.assert_array_equal(limits.effort, np.full(7, 3.0))
    np.testing.assert_array_equal(limits.effort_rate, np.full(7, 1000.0))
    np.testing.assert_array_equal(limits.velocity, numbers)
    np.testing.assert_array_equal(limits.motion.velocity, 0.5 * numbers)
    unlimited = [1.0, np.inf, np.inf, 4.0, 5.0, 6.0, 7.0]
    np.testing.assert_array_equal(limits.acceleration, unlimited)
    np.testing.assert_array_equal(limits.lower, np.full(7, -1.0))
    np.testing.assert_array_equal(limits.motion.upper, numbers - 0.25)
    assert limits.motion.bandwidth == limits.bandwidth == 7.0


def test_positions_of_some_joints() -> None:
    own = of(panda())
    limits = of(panda(), position=PositionsByJoint({"panda_joint4": (-2.5, -0.5)}))
    lower, upper = own.lower.copy(), own.upper.copy()
    lower[3], upper[3] = -2.5, -0.5
    np.testing.assert_array_equal(limits.lower, lower)
    np.testing.assert_array_equal(limits.upper, upper)
    assert limits.motion.upper[3] == -0.505
    # the robot's own limits are unchanged
    np.testing.assert_array_equal(of(panda()).lower, own.lower)


def test_a_range_without_limits_for_a_root() -> None:
    nv = talos().nv
    lower, upper = np.full((2, nv), -np.inf)
    lower[8], upper[:] = -0.1, np.inf
    limits = of(talos(), position=PositionRange(lower, upper))
    np.testing.assert_array_equal(limits.lower, lower)
    np.testing.assert_array_equal(limits.upper, upper)


NINTH, ROOT = {"panda_joint9": 0.5}, {"root_joint": 0.5}
MISFITS: list[tuple[Any, dict[str, Any], type[HspControlError], str, str]] = [
    (panda, {"effort": [1, 2]}, LimitError, "effort", "has 2 numbers; needs"),
    (
        *(panda, {"effort": Scaled(NINTH)}, JointNotFoundError),
        *("effort.scale.panda_joint9", "did you mean 'panda_joint"),
    ),
    (
        *(panda, {"velocity": ByJoint(NINTH)}, JointNotFoundError),
        *("velocity.joints.panda_joint9", "did you mean 'panda_joint"),
    ),
    (
        *(talos, {"effort": ByJoint(ROOT)}, LimitError),
        *("effort.joints.root_joint", "no motor moves root_joint"),
    ),
    (
        *(talos, {"velocity": Scaled(ROOT)}, LimitError),
        *("velocity.scale.root_joint", "root_joint has no limit that could be scaled"),
    ),
    (panda, {"acceleration": [1.0]}, LimitError, "acceleration", "needs one"),
    (
        *(panda, {"position": PositionRange(0.0, [1.0, 1.0])}, LimitError),
        *("position.upper", "has 2 numbers"),
    ),
    (
        *(talos, {"position": PositionsByJoint({"root_joint": (-1.0, 1.0)})}),
        *(LimitError, "position.joints.root_joint", "without a single coordinate .* i"),
    ),
    (
        *(talos, {"position": PositionRange(-1.0, 1.0)}, LimitError),
        *("position", "root_joint.x belongs to a joint without a single coordinate"),
    ),
    (
        *(panda, {"position": PositionRange(-1.0, 1.0), "position_margin": 1.0}),
        *(LimitError, "position", "panda_joint1 leave no room: -1 to 1 with a margin"),
    ),
    (
        *(panda, {"barriers": [SelfDistance(), ObstacleDistance(obstacles=["bal"])]}),
        *(SceneError, "barriers.1.obstacles.0", "obstacle 'bal'; did you mean 'ball'"),
    ),
    (
        *(panda, {"barriers": [ObstacleDistance(links=["panda_hnd"])]}, FieldError),
        *("barriers.0.links.0", "'panda_hnd' has no geometry; did you mean 'panda_h"),
    ),
]


@pytest.mark.parametrize(("robot", "options", "error", "path", "message"), MISFITS)
def test_parts_that_do_not_fit_the_robot(
    robot: Any,
    options: dict[str, Any],
    error: type[HspControlError],
    path: str,
    message: str,
) -> None:
    with pytest.raises(error, match=message) as raised:
        of(robot(), ball(), **options)
    assert ".".join(map(str, raised.value.path)) == path


# --- the start -----------------------------------------------------------------------


def test_start_outside_the_limits_names_the_joint() -> None:
    limits = of(panda())
    limits.check_start(panda().home(), np.zeros(7))
    q = panda().home()
    q[3] = 0.1
    with pytest.raises(LimitError, match=r"panda_joint4 is at 0.1, its limits are"):
        limits.check_start(q, np.zeros(7))
    fast = np.zeros(7)
    fast[0] = 3.0
    with pytest.raises(LimitError, match=r"joint1 moves at 3, its limit is 2.175"):
        limits.check_start(panda().home(), fast)


# --- distances -----------------------------------------------------------------------


def ball() -> Obstacle:
    """Return a ball that moves into the Panda's elbow and away again."""
    home = panda().state(0.0, panda().home(), np.zeros(7))
    center = home.position("panda_link4") + np.array([0.0, 0.35, 0.0])
    path = Lissajous([0.0, 0.28, 0.0], [1.0, 2.0, 1.0], [0.0, 3.14, 0.0], center)
    return Obstacle("ball", Sphere(0.08), path)


def table() -> Obstacle:
    return Obstacle("table", Box([1.0, 1.0, 0.1]), Hold([0.5, 0.0, 0.0]))


DISTANCES: dict[str, MinimumDistance] = {
    "all obstacles": ObstacleDistance(),
    "a ball": ObstacleDistance(0.01, obstacles=["ball"], links=["panda_link4"]),
    "a table": ObstacleDistance(0.1, obstacles=["table"]),
    "itself": SelfDistance(0.05),
}


@pytest.mark.parametrize("kind", DISTANCES)
def test_distance_rows_are_its_second_derivative(kind: str) -> None:
    """∇d·a + drift = d'' along q ⊕ (s v + ½ s² a) at t + s, by differences."""
    robot = panda()
    limit = DISTANCES[kind].placed(at_home(robot, ball(), table()))
    rng = np.random.default_rng(2)
    v, a = 0.3 * rng.standard_normal(7), rng.standard_normal(7)
    q = robot.integrate(robot.home(), 0.3 * rng.standard_normal(7))  # no parallel faces
    state = robot.state(0.4, q, v)

    def room(s: float, a: Array) -> Array:
        there = robot.state(0.4 + s, robot.integrate(q, s * v + 0.5 * s * s * a), v)
        distances: Array = limit.clearance.proximity(there).measure(there)
        return distances - limit.minimum

    def second(a: Array) -> Array:
        return (room(h, a) - 2.0 * near + room(-h, a)) / h**2

    h, rest = 1e-3, np.zeros(7)
    near = room(0.0, rest)
    rate = (room(h, rest) - room(-h, rest)) / (2.0 * h)
    least = -second(rest) - 20.0 * rate - 100.0 * near
    close = near + 0.5 * np.minimum(rate, 0.0) < 0.2
    # speeds that distant pairs permit, and speeds that they do not
    for wanted in (a, 1e3 * a):
        requested = second(wanted) - second(rest)
        chosen = close | (requested < 0.5 * least)
        A, b = limit.rows(state, 10.0, wanted)
        assert len(A) == chosen.sum() > 0
        scale = 1e-2 * np.linalg.norm(wanted)
        np.testing.assert_allclose(A @ wanted, requested[chosen], rtol=0, atol=scale)
        np.testing.assert_allclose(b, least[chosen], rtol=0, atol=2e-2)


@pytest.mark.parametrize("name", ["panda", "kinova", *further("solo12")])
def test_the_rows_are_those_of_single_pairs(name: str) -> None:
    """Also where q is not in a vector space, and with distances by Coal (the cloud)."""
    robot, rng = Robot.load(name), np.random.default_rng(4)
    points = rng.uniform(-0.05, 0.05, (20, 3))
    cloud = Obstacle("cloud", PointCloud(points, 0.01), Hold([0.4, 0.3, 0.4]))
    start = at_home(robot, Obstacle("ball", Sphere(0.08), Hold([0.4, -0.3, 0.4])))
    seen = at_home(robot, cloud)
    q = robot.integrate(robot.home(), 0.1 * rng.standard_normal(robot.nv))
    state = robot.state(0.4, q, 0.3 * rng.standard_normal(robot.nv))
    # so that distant pairs are active, too
    wanted = 1e4 * rng.standard_normal(robot.nv)
    for limit in (
        SelfDistance().placed(start),
        ObstacleDistance().placed(start),
        ObstacleDistance().placed(seen),
    ):
        A, b = limit.rows(state, 10.0, wanted)
        least = limit._least_acceleration(state, 10.0)
        gradients = limit.clearance.proximity(state).gradients(state, range(len(least)))
        chosen = [int(np.abs(least - each).argmin()) for each in b]
        assert len(b) > 0
        assert chosen == sorted(set(chosen))
        # second differences over 3 ms amplify rounding of the distance by 1e5
        np.testing.assert_allclose(b, least[chosen], rtol=0, atol=1e-9)
        np.testing.assert_allclose(A, gradients[chosen], rtol=0, atol=1e-14)


def test_a_row_turns_no_corner_in_one_step() -> None:
    """Where a capsule's side ends, d'' jumps by 3.3 m/s², and so must the efforts."""
    robot, rng = panda(), np.random.default_rng(6)
    limit = ObstacleDistance().placed(at_home(robot, ball(), table()))
    v = rng.standard_normal(7)
    q = robot.integrate(robot.home(), 0.2 * rng.standard_normal(7))
    way = [robot.integrate(q, s * v) for s in np.arange(-0.15, 0.15, 1e-3)]
    rows = [limit.rows(robot.state(0.4, at, v), 10.0, 1e2 * v)[1] for at in way]
    steps = [b - a for a, b in pairwise(rows) if len(a) == len(b)]
    assert max(np.abs(step).max() for step in steps) < 1.0
