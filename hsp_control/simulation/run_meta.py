"""The meta data of a run, as JSON data: what its log says besides its columns."""

import platform
from importlib.metadata import version
from typing import Any

import numpy as np

from hsp_control.common.version import __version__
from hsp_control.control.controller import Controller
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.shapes import shape_to_log
from hsp_control.null_space.metrics import FixedMetric
from hsp_control.robot import Robot
from hsp_control.tasks import Task


def robot_meta(robot: Robot, skeleton_parents: list[int]) -> dict[str, Any]:
    """Return what a log says of a robot, with the parents of the points to draw."""
    return {
        "name": robot.name,
        "nq": robot.nq,
        "nv": robot.nv,
        "dofs": list(robot.dof_names),
        "units": list(robot.units),
        "continuous": continuous_dofs(robot),
        "skeleton_parents": skeleton_parents,
        "joint_coordinates": robot.source.joint_coordinates,
    }


def continuous_dofs(robot: Robot) -> list[int]:
    """Return the dofs of continuous joints, whose configuration is (cos, sin)."""
    joints = robot.single_dof_joints
    return [int(i) for i in joints[joints[:, 2] == 2, 0]]


def task_meta(task: Task) -> dict[str, Any]:
    """Return what a log says of a task."""
    return {
        "type": type(task).__name__,
        "rows": task.rows,
        "error": [list(part) for part in task.error_parts],
        "drawn": list(task.drawn),
        "axes": getattr(task, "axes", None),
        "frame": getattr(task, "frame", None),
    }


def null_space_meta(controller: Controller) -> dict[str, Any]:
    """Return what a log says of the field, its gain and the metric."""
    field, metric = controller.field, controller.metric
    return {
        "field": field.name,
        "controls_null_space": field.controls,
        "null_space_gain": controller.null_space_gain.tolist(),
        "metric": type(metric).__name__,
        "metric_matrix": metric.W.tolist() if isinstance(metric, FixedMetric) else None,
    }


def obstacle_meta(obstacle: Obstacle) -> dict[str, Any]:
    """Return what a log says of an obstacle."""
    radius = obstacle.shape.bounding_radius
    return {
        "shape": type(obstacle.shape).__name__,
        "parameters": shape_to_log(obstacle.shape),
        "radius": radius if np.isfinite(radius) else None,
    }


def versions() -> dict[str, str]:
    """Return the versions of the packages that a run depends on."""
    packages = ("pin", "numpy", "scipy", "numba")
    return {
        "hsp_control": __version__,
        "python": platform.python_version(),
        **{package: version(package) for package in packages},
    }
