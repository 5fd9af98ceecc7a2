"""A run in the scene: obstacles, desired and actual paths, and the target now."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.viewer import shapes
from hsp_control.viewer.appearance import (
    ACTUAL,
    AXES,
    DESIRED,
    DESIRED_OPACITY,
    DESIRED_WIDENING,
    OBSTACLE,
    PATH_RADIUS,
)
from hsp_control.viewer.commands import (
    Command,
    Json,
    set_length,
    set_object,
    set_transform,
)
from hsp_control.viewer.moments import Moment, between
from hsp_control.viewer.obstacle_drawing import draw_obstacle, move_obstacle
from hsp_control.viewer.stage import scene_size
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
        self._obstacles: dict[str, float] = {
            name: float(about["radius"])
            for name, about in rollout.meta.get("obstacles", {}).items()
            if f"obstacle.{name}" in rollout
        }

    def draw(self) -> Iterator[Command]:
        """Yield what puts it into the scene."""
        radius = PATH_RADIUS * scene_size(self.points())
        for name, size in self._obstacles.items():
            yield draw_obstacle(name, size)
        for target in self._targets:
            path = f"{ROOT}/{target.name}"
            if target.desired is not None:
                yield from _draw_path(f"{path}/desired", target.desired, radius, True)
                yield from _draw_path(f"{path}/actual", target.actual, radius, False)
            yield set_object(f"{path}/target", _marker(target, radius))

    def move(self, now: Moment) -> Iterator[Command]:
        """Yield what moves it to a moment of the run."""
        rollout = self._rollout
        for name in self._obstacles:
            yield move_obstacle(name, between(rollout[f"obstacle.{name}"], now))
        run = (now.row + now.fraction) / max(1, len(rollout) - 1)
        for target in self._targets:
            path = f"{ROOT}/{target.name}"
            if target.desired is not None:
                yield set_length(f"{path}/actual", run)
            yield set_transform(f"{path}/target", _pose(target, now))

    def points(self) -> Array:
        """Return points that enclose all of it over the run [m], shape (K, 3)."""
        clouds = [self._rollout["skeleton"]] if "skeleton" in self._rollout else []
        clouds += [t.desired for t in self._targets if t.desired is not None]
        for name, radius in self._obstacles.items():
            centers = self._rollout[f"obstacle.{name}"]
            clouds += [centers - radius, centers + radius]
        return np.concatenate([cloud.reshape(-1, 3) for cloud in clouds] or [_NOTHING])

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        paths = any(target.desired is not None for target in self._targets)
        named = [("desired", DESIRED), ("actual", ACTUAL)] if paths else []
        return named + [(name, OBSTACLE) for name in self._obstacles]


_NOTHING = np.zeros((0, 3))


def _draw_path(
    path: str, points: Array, radius: float, desired: bool
) -> Iterator[Command]:
    if len(points) < 2 or np.ptp(points, axis=0).max() < radius:
        return  # it stands still: the marker shows where
    rows = np.linspace(0, len(points) - 1, min(len(points), _MOST_RINGS)).round()
    if desired:
        surface = shapes.material(DESIRED, opacity=DESIRED_OPACITY, glow=0.5)
        radius *= DESIRED_WIDENING
    else:
        surface = shapes.material(ACTUAL, glow=0.35)
    line = shapes.mesh(tube(points[rows.astype(int)], radius), surface, shadow=False)
    yield set_object(path, shapes.group([line]))


def _marker(target: Target, radius: float) -> Json:
    """Return what shows the target now: a ball, an arrow, or three axes."""
    if target.direction is not None:
        surface = shapes.material(DESIRED, glow=0.3)
        return shapes.group([shapes.mesh(shapes.arrow(60 * radius, 2 * radius), surface)])
    if target.rotation is None:
        surface = shapes.material(DESIRED, glow=0.3)
        return shapes.group([shapes.mesh(shapes.sphere(4.5 * radius), surface)])
    arrows = []
    for axis, color in zip(np.eye(3), AXES, strict=True):
        body = shapes.arrow(40.0 * radius, 1.5 * radius)
        arrows.append(shapes.mesh(body, shapes.material(color, glow=0.3), along(axis)))
    return shapes.group(arrows)


def _pose(target: Target, now: Moment) -> Array:
    place = target.actual if target.desired is None else target.desired
    pose = np.eye(4)
    if target.rotation is not None:
        x, y, z, w = between(target.rotation, now)
        turn = pin.Quaternion(w, x, y, z).normalized()
        pose[:3, :3] = turn.toRotationMatrix()
    elif target.direction is not None:
        pose = along(between(target.direction, now))
    pose[:3, 3] = between(place, now)
    return pose


def along(direction: Array) -> Array:
    """Return the pose that turns z along a direction, shape (4, 4)."""
    pose = np.eye(4)
    z = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z, direction / np.linalg.norm(direction))
    pose[:3, :3] = turn.toRotationMatrix()
    return pose
