"""Joint speeds that references require, as fractions of the joints' limits."""

import numpy as np
import pytest
from places import further

import hsp_control as hsp
from hsp_control.simulation.demand_check import not_followed
from hsp_control.simulation.speed_check import Passed, TooFast, _share, too_fast
from hsp_control.trajectories import Along


@pytest.mark.parametrize("seed", range(5))
def test_the_least_share_is_that_of_the_best_self_motion(seed: int) -> None:
    """A Panda's hand pose leaves one self-motion, over which fractions are
    minimised."""
    robot, rng = hsp.Robot.load("panda"), np.random.default_rng(seed)
    q = robot.home() + rng.normal(size=7) * 0.2
    limit, rate = rng.uniform(1.0, 3.0, 7), 3.0 * rng.normal(size=6)
    share, joint = _share(robot, "panda_tcp", q, rate, np.arange(6), limit)
    J = robot.state(0.0, q, np.zeros(7)).frame("panda_tcp").jacobian
    one = np.linalg.pinv(J) @ rate
    free = np.linalg.svd(J)[2][-1]
    scanned = one + np.linspace(-30.0, 30.0, 60001)[:, None] * free
    shares = np.abs(scanned / limit).max(axis=1)
    assert share == pytest.approx(shares.min(), rel=1e-3)
    best = scanned[shares.argmin()] / limit
    assert abs(best[joint]) == pytest.approx(share, rel=1e-3)


def reported(speed: float, rows: str) -> list[TooFast]:
    robot = hsp.Robot.load("panda")
    circle = Along(hsp.Circle(0.1, 1.0), speed, acceleration=200.0)
    task = hsp.FramePose("panda_tcp", circle)
    if rows != "pose":
        task = hsp.FramePosition("panda_tcp", circle)
    law = hsp.Controller(robot, [task], limits=hsp.Limits())
    requested = robot, law.tasks, robot.home(), 2.0, (), law.limits
    return [each for each in not_followed(*requested) if isinstance(each, TooFast)]


@pytest.mark.parametrize("rows", ["pose", *further("position")])
def test_a_reference_too_fast_is_reported_with_place_joint_and_speed(rows: str) -> None:
    (found,) = reported(4.0, rows)
    assert found.share > 1.01
    assert found.unit == "m/s"
    assert found.speed == pytest.approx(4.0)  # constant, except for the ramp
    assert f"moves at 4 m/s at t = {found.t:.3g} s, for which 'panda_joint" in (
        found.message
    )
    assert f"; {4.0 / found.share:.3g} m/s would do there" in found.message
    assert reported(0.5 * 4.0 / found.share, rows) == []
    assert reported(0.2, rows) == []


def test_the_worst_time_is_reported() -> None:
    """A line is fastest in its middle: 1.875 times its mean speed."""
    robot = hsp.Robot.load("panda")
    line = hsp.Line([5.0, 0.0, 0.0], 1.0, start=[0.0, 0.0, 0.0])
    task = hsp.FramePosition("panda_tcp", line)
    passed = [Passed(t, robot.home(), 0.0) for t in (0.3, 0.5, 0.8)]
    found = too_fast(robot, task, passed, np.full(7, 2.0))
    assert found is not None
    assert found.t == 0.5
    assert found.speed == pytest.approx(1.875 * 5.0)


def test_without_limits_nothing_is_reported() -> None:
    robot = hsp.Robot.load("panda")
    task = hsp.FramePose("panda_tcp", Along(hsp.Circle(0.1, 1.0), 9.0))
    law = hsp.Controller(robot, [task])
    requested = robot, law.tasks, robot.home(), 2.0, (), None
    assert list(not_followed(*requested)) == []


def test_joints_without_a_limit_may_be_as_fast_as_they_need() -> None:
    """Two of three joints can move the tip alone, also beside a slow one."""
    robot = hsp.Robot.load("planar3r")
    line = hsp.Line([0.0, 9.0], 1.0, start=[0.0, 0.0])
    task = hsp.FramePosition("tip", line, axes="xy")
    passed = [Passed(0.5, robot.home(), 0.0)]
    for limit in ([np.inf] * 3, [np.inf, np.inf, 0.1]):
        assert too_fast(robot, task, passed, np.array(limit)) is None
    assert too_fast(robot, task, passed, np.array([np.inf, 0.1, 0.1])) is not None


def test_a_slow_joint_counts_beside_one_without_a_limit() -> None:
    """It is a thousandth of a rad/s fast, and the line needs a hundred of them."""
    robot = hsp.Robot.load("planar3r")
    line = hsp.Line([0.0, 0.1], 1.0, start=[0.0, 0.0])
    task = hsp.FramePosition("tip", line, axes="xy")
    limit = np.array([np.inf, 1e-3, 1e-3])  # one joint alone cannot follow a line
    assert too_fast(robot, task, [Passed(0.5, robot.home(), 0.0)], limit) is not None
