"""The axes of the tasks' frames, at the robot and at their targets: x, y, z."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.palette import INK
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    Json,
    LegendEntry,
    PageCommand,
    path_element,
    set_object,
)
from hsp_control.companions.viewer.motion import (
    Layer,
    RunMotion,
    Track,
    pose_tracks,
)
from hsp_control.companions.viewer.targets import AXES, TaskTarget, read_targets
from hsp_control.robot import Robot

KEY = "f"  # shows and hides them
_LENGTH, _RADIUS = 0.22, 0.003
"""Of an axis at the robot, over the size of the scene: longer than a target's mark."""
_TARGET_LENGTH, _TARGET_RADIUS = 0.16, 0.005
"""The same at a target: both remain visible where they coincide."""
_NAMED = 2  # maximum number of frames named in the legend's row


def frame_axes(robot: Robot, motion: RunMotion, root: str) -> Layer:
    """Draw the frames that tasks name, and the targets that are orientations.

    Without such a task: the robot's end effector.
    """
    tasks = motion.rows.meta.get("tasks", {}).values()
    named = dict.fromkeys(frame for task in tasks if (frame := task.get("frame")))
    frames = [*named] or [robot.end_effector]
    here = {frame: f"{root}/here/{path_element(frame)}" for frame in frames}
    turned = [each.name for each in _turned(motion)]
    there = {name: f"{root}/target/{path_element(name)}" for name in turned}
    data = robot.model.createData()

    def draw(size: float) -> Iterator[PageCommand]:
        for path in here.values():
            yield set_object(path, _triad(_LENGTH * size, _RADIUS * size))
        for path in there.values():
            yield set_object(path, _triad(_TARGET_LENGTH * size, _TARGET_RADIUS * size))

    def tracks(motion: RunMotion) -> Iterator[Track]:
        poses: Array = np.empty((len(here), len(motion.times), 7))
        for row, q in enumerate(motion.rows.q):
            pin.forwardKinematics(robot.model, data, q)
            for k, frame in enumerate(here):
                place = pin.updateFramePlacement(
                    robot.model, data, robot.frame_id(frame)
                )
                poses[k, row] = pin.SE3ToXYZQUAT(place)
        for path, own in zip(here.values(), poses, strict=True):
            yield from pose_tracks(path, motion.times, own)
        for target in _turned(motion):
            path, times = there[target.name], motion.times
            place = target.actual if target.desired is None else target.desired
            yield Track(path, "position", times, place)
            if target.rotation is not None:
                yield Track(path, "quaternion", times, target.rotation)

    def legend() -> list[LegendEntry]:
        names = f": {', '.join(frames)}" if len(frames) <= _NAMED else ""
        paths = (*here.values(), *there.values())
        entry = LegendEntry(f"Frame axes{names}", INK, paths, plain=True)
        return [entry._replace(short="axes", key=KEY)]

    return Layer(draw, tracks, legend)


def _turned(motion: RunMotion) -> list[TaskTarget]:
    """Return the targets with an orientation."""
    return [each for each in read_targets(motion.rows) if each.rotation is not None]


def _triad(length: float, radius: float) -> Json:
    arrow = threejs.arrow(length, radius)
    return threejs.group(
        [
            threejs.mesh(
                arrow,
                threejs.always_visible(threejs.material(color, glow=0.5)),
                threejs.pose_along(axis),
                shadow=False,
            )
            for axis, color in zip(np.eye(3), AXES, strict=True)
        ]
    )
