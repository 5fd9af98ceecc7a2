"""The camera: as configured, or placed so that the whole scene is visible."""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.matrix_view import matrix_view
from hsp_control.visualization.viewer.commands import Command, set_camera
from hsp_control.visualization.viewer.stage import scene_size

FIELD_OF_VIEW = 32.0
"""Vertical field of view [deg]: narrow, for little perspective distortion."""
_THICKNESS = 0.11
"""Radius of the balls around the points, over the size of the scene."""
_DEFAULT_DIRECTION = np.array([1.0, -1.35, 0.62])
_COS_STEEP = np.cos(np.radians(30.0))
_MAX_POINTS = 300


def look_at(
    robot: Robot,
    points: Array,
    eye: ArrayLike | None = None,
    target: ArrayLike | None = None,
    *,
    fit: bool = False,
) -> Command:
    """Return the command that places the camera.

    A planar arm is seen along its joint axes, any other robot from its front and above.
    ``eye`` None: far enough to see all ``points``, (K, 3) [m]; ``fit``: only its
    direction.
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    center = middle if target is None or fit else np.asarray(target, float)
    direction = viewing_direction(robot, eye, center if target is None else target)
    stride = max(1, len(points) // _MAX_POINTS)
    view: dict[str, object] = {
        "points": points[::stride].tolist(),
        "radius": _THICKNESS * scene_size(points),
    }
    if eye is not None and not fit:
        view["eye"] = np.asarray(eye, float).tolist()
    else:
        view["direction"] = direction.tolist()
    steep = abs(direction[2]) > _COS_STEEP * np.linalg.norm(direction)
    return set_camera(
        **view,
        target=center.tolist(),
        up=[0.0, 1.0, 0.0] if steep else [0.0, 0.0, 1.0],
        field_of_view=FIELD_OF_VIEW,
    )


def viewing_direction(
    robot: Robot, eye: ArrayLike | None, target: ArrayLike | None
) -> Array:
    """Return the direction from the target to the eye, shape (3,), not normalised."""
    if eye is not None:
        return np.subtract(eye, np.zeros(3) if target is None else target)
    normal = plane_normal(robot)
    return _DEFAULT_DIRECTION if normal is None else normal


def right_direction(
    robot: Robot, eye: ArrayLike | None, target: ArrayLike | None
) -> Array:
    """Return the horizontal direction to the right in the picture, a unit vector."""
    direction = viewing_direction(robot, eye, target)
    right = np.array([-direction[1], direction[0], 0.0])
    length = float(np.linalg.norm(right))
    return right / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])


def plane_normal(robot: Robot) -> Array | None:
    """Return the normal of a planar arm's plane, towards the eye; None if spatial."""
    if any(joint.nv != 1 for joint in list(robot.model.joints)[1:]):
        return None
    data = robot.model.createData()
    J = matrix_view(pin.computeJointJacobians(robot.model, data, robot.neutral()))
    turns = np.linalg.norm(J[3:], axis=0) > 0.5
    if not turns.any():
        return None
    normal = J[3:, turns][:, 0]
    parallel = np.abs(np.abs(normal @ J[3:, turns]) - 1.0) < 1e-9
    across = np.abs(normal @ J[:3, ~turns]) < 1e-9
    if not (parallel.all() and across.all()):
        return None
    # Seen from above; if the plane is vertical, with x or y to the right.
    towards = normal @ np.array([0.1, -1.0, 10.0])
    return np.asarray(normal if towards > 0.0 else -normal)
