"""Targets of the tasks in a log: positions, orientations, directions."""

from typing import NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import drawn_parts, task_names, task_path


class Target(NamedTuple):
    """The target of one task at every row, and the actual position."""

    name: str
    actual: Array  # the actual position of the task's point [m], (N, 3)
    # Its desired position [m], (N, 3); the actual one along world axes that the task
    # does not track. None if the task tracks no position.
    desired: Array | None = None
    # The desired orientation as a quaternion (x, y, z, w), (N, 4).
    rotation: Array | None = None
    direction: Array | None = None  # the desired direction, unit vectors, (N, 3)


def read_targets(rollout: Rollout) -> list[Target]:
    """Return the targets of all tasks that can be shown in space."""
    if "skeleton" not in rollout:
        return []
    targets = (_target(rollout, name) for name in task_names(rollout))
    return [target for target in targets if target is not None]


def _target(rollout: Rollout, name: str) -> Target | None:
    parts = drawn_parts(rollout, name)
    if not parts:
        return None
    path = task_path(rollout, name)
    reference = rollout[f"task.{name}.reference"]
    orientation, direction = parts.get("orientation"), parts.get("direction")
    return Target(
        name,
        # Without a position: the last frame that a task tracks.
        rollout["skeleton"][:, -1] if path is None else path.actual,
        None if path is None else path.desired,
        None if orientation is None else reference[:, orientation],
        None if direction is None else reference[:, direction],
    )
