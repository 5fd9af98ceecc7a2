"""A run in the scene: obstacles, desired and actual paths, and the target now."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.viewer import threejs
from hsp_control.viewer.appearance import (
    ACTUAL,
    AXES,
    DESIRED,
    DESIRED_WIDENING,
    PATH_RADIUS,
)
from hsp_control.viewer.commands import (
    Command,
    Json,
    set_length,
    set_object,
    set_transform,
)
from hsp_control.viewer.moments import Moment, between, moment, orientation_between
from hsp_control.viewer.obstacle_drawing import (
    draw_obstacle,
    enclosing,
    move_obstacle,
    obstacle_legend,
)
from hsp_control.viewer.obstacle_shapes import logged_shape
from hsp_control.viewer.poses import along
from hsp_control.viewer.surfaces import material, paint
from hsp_control.viewer.targets import Target, read_targets
from hsp_control.viewer.tube import tube

ROOT = "/tasks"
_MOST_RINGS = 1500


class RolloutDrawing:
    """What a log tells besides the robot."""

    def __init__(self, rollout: Rollout) -> None:
        """Read the log."""
        self._rollout = rollout
        self._targets = read_targets(rollout)
        self._obstacles = {
            name: shape
            for name, about in rollout.meta.get("obstacles", {}).items()
            if (shape := logged_shape(about)) and f"obstacle.{name}" in rollout
        }

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""
        radius = PATH_RADIUS * size
        for name, shape in self._obstacles.items():
            yield draw_obstacle(name, shape, 4.0 * size)
        for target in self._targets:
            path = f"{ROOT}/{target.name}"
            if target.desired is not None:
                yield from _draw_path(f"{path}/desired", target.desired, radius, True)
                yield from _draw_path(f"{path}/actual", target.actual, radius, False)
            yield set_object(f"{path}/target", _marker(target, radius))

    def move(self, time: float) -> Iterator[Command]:
        """Yield what moves it to where it was at a time of the run [s]."""
        now = moment(self._rollout.t, time)
        for name in self._obstacles:
            yield move_obstacle(name, self._placement(name, now))
        run = (now.row + now.fraction) / max(1, len(self._rollout) - 1)
        for target in self._targets:
            path = f"{ROOT}/{target.name}"
            if target.desired is not None:
                yield set_length(f"{path}/actual", run)
            yield set_transform(f"{path}/target", _pose(target, now))

    def points(self) -> Array:
        """Return where the robot and its targets are in the run [m], shape (K, 3)."""
        clouds = [self._rollout["skeleton"]] if "skeleton" in self._rollout else []
        clouds += [t.desired for t in self._targets if t.desired is not None]
        return np.concatenate([np.zeros((0, 3)), *(c.reshape(-1, 3) for c in clouds)])

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles in the run [m], shape (K, 3)."""
        clouds = [
            corners
            for name, shape in self._obstacles.items()
            for corners in enclosing(shape, self._rollout[f"obstacle.{name}"])
        ]
        return np.concatenate([np.zeros((0, 3)), *clouds])

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        paths = any(target.desired is not None for target in self._targets)
        named = [("desired path", DESIRED), ("actual path", ACTUAL)] if paths else []
        return named + obstacle_legend(self._obstacles)

    def _placement(self, name: str, now: Moment) -> pin.SE3:
        center = between(self._rollout[f"obstacle.{name}"], now)
        turns = f"obstacle.{name}.quaternion"
        if turns not in self._rollout:
            return pin.SE3(np.eye(3), center)
        return pin.SE3(orientation_between(self._rollout[turns], now), center)


def _draw_path(
    path: str, points: Array, radius: float, desired: bool
) -> Iterator[Command]:
    if len(points) < 2 or np.ptp(points, axis=0).max() < radius:
        return  # it stands still: the marker shows where
    rows = np.linspace(0, len(points) - 1, min(len(points), _MOST_RINGS)).round()
    if desired:
        surface = paint(DESIRED, inside=True)
        radius *= DESIRED_WIDENING
    else:
        surface = paint(ACTUAL)
    line = threejs.mesh(tube(points[rows.astype(int)], radius), surface, shadow=False)
    yield set_object(path, threejs.group([line]))


def _marker(target: Target, radius: float) -> Json:
    """Return what shows the target now: a ball, an arrow, or three axes."""
    if target.direction is not None:
        surface = material(DESIRED)
        return threejs.group(
            [threejs.mesh(threejs.arrow(60 * radius, 2 * radius), surface)]
        )
    if target.rotation is None:
        surface = material(DESIRED)
        return threejs.group([threejs.mesh(threejs.sphere(4.5 * radius), surface)])
    arrows = []
    for axis, color in zip(np.eye(3), AXES, strict=True):
        body = threejs.arrow(40.0 * radius, 1.5 * radius)
        arrows.append(threejs.mesh(body, material(color), along(axis)))
    return threejs.group(arrows)


def _pose(target: Target, now: Moment) -> Array:
    place = target.actual if target.desired is None else target.desired
    pose = np.eye(4)
    if target.rotation is not None:
        pose[:3, :3] = orientation_between(target.rotation, now).matrix()
    elif target.direction is not None:
        pose = along(between(target.direction, now))
    pose[:3, 3] = between(place, now)
    return pose
