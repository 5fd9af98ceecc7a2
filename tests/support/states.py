"""One state per robot, moved for differences; and starts at home."""

from functools import lru_cache

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.geometry.scene import Scene, Start
from hsp_control.robot.state import RobotState


def moved(robot: hsp.Robot, t: float, q: Array, v: Array | None = None) -> RobotState:
    """Return the robot's shared state at t, q and v; at rest if v is None.

    Making a state takes fifty times as long as moving one and would dominate a
    difference. Copy values read from it: the next call moves it.
    """
    state = _state(robot)
    state.update(t, q, np.zeros(robot.nv) if v is None else v)
    return state


def at_home(robot: hsp.Robot, *scene: hsp.Obstacle) -> Start:
    """Return a start at rest at home in a scene, for placing parts."""
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    return Start(state, Scene(scene))


@lru_cache(maxsize=32)
def _state(robot: hsp.Robot) -> RobotState:
    return robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
