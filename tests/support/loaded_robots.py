"""Robots shared by many tests, loaded once per process: no test may change one."""

from functools import cache

import pytest

from hsp_control import Robot
from hsp_control.common.resources import bundled_robots


@cache
def load(name: str, root: str | None = None) -> Robot:
    """Return a robot; skip if it needs example-robot-data and that is missing."""
    if name not in bundled_robots():
        pytest.importorskip("example_robot_data")
    return Robot.load(name, root=root)  # type: ignore[arg-type]


def panda() -> Robot:
    return load("panda")


@cache
def talos() -> Robot:
    """Return the humanoid, with its grippers locked."""
    pytest.importorskip("example_robot_data")
    grippers = {"gripper_left_joint": 0.0, "gripper_right_joint": 0.0}
    return Robot.load("talos", locked=grippers)
