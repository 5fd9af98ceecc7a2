"""Robots, controllers and starts for tests of the simulation."""

from functools import cache

import numpy as np
import pytest

from hsp_control import Controller, FramePosition, Gains, Obstacle, Robot, TargetPosture
from hsp_control.common.arrays import Array
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import PointDistance
from hsp_control.robot.integrators import Dop853
from hsp_control.trajectories import Circle, Lissajous

EXACT = Dop853(rtol=1e-12, atol=1e-12)
ROBOTS: dict[str, tuple[str, str | None]] = {
    "planar3r": ("planar3r", None),
    "panda": ("panda", None),
    "rolling ur5": ("ur5", "planar"),
    "floating talos_arm": ("talos_arm", "free_flyer"),
}


@cache
def load(name: str, gravity: bool = True) -> Robot:
    """Return a robot, or skip if it needs example-robot-data and that is missing."""
    source, root = ROBOTS[name]
    if source not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    pull = None if gravity else (0.0, 0.0, 0.0)
    return Robot.load(source, root=root, gravity=pull)  # type: ignore[arg-type]


def start(robot: Robot, seed: int, speed: float = 0.5) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    q = robot.integrate(robot.home(), 0.3 * rng.normal(size=robot.nv))
    return q, speed * rng.normal(size=robot.nv)


def distance(robot: Robot, a: tuple[Array, Array], b: tuple[Array, Array]) -> float:
    """Return the distance of two states on the manifold."""
    apart = [robot.difference(a[0], b[0]), a[1] - b[1]]
    return float(np.abs(apart).max())


def order(steps: Array, errors: list[float]) -> float:
    """Return the slope of log error over log step."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@cache
def planar_controller(gain: float = 10.0) -> Controller:
    robot = load("planar3r", gravity=False)
    circle = Circle(0.9, 3.0, [1.0, 1.0])
    task = FramePosition("tip", circle, gains=Gains(natural_frequency=10.0), axes="xy")
    ball = Obstacle(
        "ball", Sphere(0.1), Lissajous([0, 0.7, 0], [1, 3, 1], center=[-1, 1.7, 0])
    )
    field = TargetPosture(planar_start()) + PointDistance(["link3"], ball)
    return Controller(robot, [task], field, null_space_gain=gain, limits=None)


def planar_start() -> Array:
    robot = load("planar3r", gravity=False)
    return robot.integrate(robot.neutral(), np.array([-0.4, 0.9, 0.8]))


@cache
def panda_controller() -> Controller:
    robot = load("panda")
    x = robot.state(0.0, robot.home(), np.zeros(7)).position("panda_tcp").copy()
    task = FramePosition(
        "panda_tcp",
        Lissajous([0.1, 0.1, 0.05], [3.0, 4.0, 5.0], center=x),
        gains=Gains(natural_frequency=10.0),
    )
    return Controller(robot, [task], TargetPosture(robot.home() + 0.2), limits=None)
