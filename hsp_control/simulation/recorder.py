"""Records a rollout row by row, into columns that are allocated before the run."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import CallSequence, merged
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.control.plan import RunningPlan
from hsp_control.geometry.scene import Scene
from hsp_control.law.problem import Record
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation.contact_columns import ContactColumns
from hsp_control.simulation.limit_excess import VELOCITY, LimitExcess
from hsp_control.simulation.log_columns import LogColumns
from hsp_control.simulation.repeatable import repeatable
from hsp_control.simulation.rollout import FORMAT, Rollout, complete_columns
from hsp_control.simulation.run_meta import (
    continuous_dofs,
    null_space_meta,
    obstacle_meta,
    robot_meta,
    versions,
)
from hsp_control.simulation.task_columns import TaskColumns
from hsp_control.simulation.term_columns import TermColumns

_EFFORT_UNITS = {"rad": "N·m", "m": "N"}


class RowCopies:
    """Copies arrays to a row of their columns, ten times as fast as Python."""

    def __init__(self, pairs: Iterable[tuple[Array, Array]]) -> None:
        copies = [bind(_copy, *pair, timed=True) for pair in pairs]
        self._write = merged(CallSequence(*copies))

    def write(self, row: int) -> None:
        """Write a row."""
        self._write(float(row))


@kernel
def _copy(source: Array, column: Array, row: float) -> None:
    """Write a row of a column; the row comes as the time does in other calls."""
    i = int(row)
    for j in range(source.shape[0]):
        column[i, j] = source[j]


class Recorder:
    """Columns for a known number of rows; an incomplete row is never returned."""

    def __init__(
        self,
        controller: Controller,
        scene: Scene,
        rows: int,
        plan: RunningPlan | None = None,
    ) -> None:
        self._controller = controller
        # what the robot follows; its streams are recorded. None: no plan
        self.plan = plan
        self._scene = scene
        self._columns = LogColumns(rows)
        self._settled: object = None
        self._law: Record | None = None  # of the present row
        self._copies = IdentityCache(self._bind_copies)
        robot = controller.robot
        nv, units = robot.nv, dict.fromkeys(robot.units)
        joint_unit = " or ".join(units)
        effort_unit = " or ".join(_EFFORT_UNITS[unit] for unit in units)
        column = self._columns.add
        column("t", (), "s", "time")
        column("q", (robot.nq,), joint_unit, "configuration")
        column("v", (nv,), f"{joint_unit}/s", "velocity")
        column("tau", (nv,), effort_unit, "effort M a + N")
        column("acceleration", (nv,), f"({joint_unit})/s²", "commanded acceleration")
        column("joint_positions", (nv,), joint_unit, "joint positions, unwrapped")
        self._tasks = TaskColumns(controller, self._columns)
        column("field.g", (nv,), f"{joint_unit}/s", "null-space field")
        column("field.value", (), "-", "cost f, or norm of a vector field")
        column("null_space_error", (nv,), f"{joint_unit}/s", "e_N = (I - J#J)(g - v)")
        column("null_space_norm", (), f"{joint_unit}/s", "norm of e_N in the metric")
        column("manipulability", (), "-", "det(J W⁻¹ Jᵀ) of all tasks")
        rows_of_tasks = sum(task.rows for task in controller.tasks)
        column("singular_values", (rows_of_tasks,), "-", "of J L⁻ᵀ, W = L Lᵀ")
        column(
            "damped",
            (),
            "-",
            "first level, 1 the highest, that is damped at a singularity; 0: exact",
        )
        column("status", (), "-", "0 exact law; 1 forces redistributed; 2 limited; "
               "3 limits relaxed")  # fmt: skip
        column("relaxation", (), "(rad or m)/s²", "largest violation of a limit")
        self._contacts = ContactColumns(controller, self._columns)
        self._excess = LimitExcess(robot)
        self._frames, self._parents = _skeleton(robot, controller)
        column("skeleton", (len(self._parents), 3), "m", "joints and task frames")
        self._terms = TermColumns(controller, self._columns)
        for obstacle in scene.values():
            prefix = f"obstacle.{obstacle.name}"
            column(prefix, (3,), "m", "position of its frame")
            column(f"{prefix}.quaternion", (4,), "-", "orientation (x, y, z, w)")

    def record(
        self,
        state: RobotState,
        output: ControlOutput | None,
        tau: Array,
        log_channels: Mapping[str, LogChannel],
    ) -> None:
        """Append a row."""
        i, columns = self._columns.count, self._columns.arrays
        robot = self._controller.robot
        settled = self._controller.settled
        if settled is None or settled is not self._settled:
            self._settled = settled
            others = self._tasks.update(), self._terms.update()
            if any(others):
                self._copies = IdentityCache(self._bind_copies)
        columns["t"][i] = state.t
        columns["q"][i] = state.q
        columns["v"][i] = state.v
        columns["tau"][i] = tau
        columns["joint_positions"][i] = robot.joint_positions(state.q)
        self._tasks.write(i, state)
        skeleton = columns["skeleton"][i]
        joints = len(skeleton) - len(self._frames)
        skeleton[:joints] = state.world.placements[1:, 9:]
        for k, frame in self._frames:
            skeleton[k] = state.position(frame)
        moved = self._controller.scene
        for known in self._scene.values():
            # No `get`: a scene raises its own error, not KeyError.
            obstacle = moved[known.name] if known.name in moved else known  # noqa: SIM401
            placement = pin.SE3ToXYZQUAT(obstacle.placement(state.t))
            columns[f"obstacle.{obstacle.name}"][i] = placement[:3]
            columns[f"obstacle.{obstacle.name}.quaternion"][i] = placement[3:]
        limits = self._controller.limits
        if VELOCITY not in log_channels:  # the state was seen in this row alone
            self._excess.see(limits, state.q, state.v)
            log_channels = {**self._excess.take(limits), **log_channels}
        if output is not None:
            self._record_law(state, output)
        for name, channel in log_channels.items():
            if name not in columns:
                shape = np.shape(channel.value)
                self._columns.add(name, shape, channel.unit, channel.meaning)
            columns[name][i] = channel.value
        self._columns.count += 1

    def _record_law(self, state: RobotState, output: ControlOutput) -> None:
        i, columns = self._columns.count, self._columns.arrays
        controller = self._controller
        self._law = law = output.explanation(self._law)
        active = controller.active_stack
        self._copies.get(active, law).write(i)
        self._tasks.write_stiffness(i, active)
        self._tasks.write_bounded(i, active, output)
        diagnostics = controller.diagnose()
        columns["field.value"][i] = diagnostics.field_value
        columns["null_space_norm"][i] = diagnostics.null_space_norm
        columns["manipulability"][i] = diagnostics.manipulability
        values = diagnostics.singular_values
        if (added := len(values) - columns["singular_values"].shape[1]) > 0:
            old = columns["singular_values"]
            columns["singular_values"] = np.pad(
                old, ((0, 0), (0, added)), constant_values=np.nan
            )
        columns["singular_values"][i, : len(values)] = values
        level = active.damped_level if output.damped else 0
        columns["damped"][i] = level
        columns["status"][i] = output.status
        columns["relaxation"][i] = output.relaxation
        self._contacts.write(i, state.t, output)
        self._terms.write(i, state)

    def _bind_copies(self, active: ActiveStack, law: Record) -> RowCopies:
        """Return what copies the law's arrays, those of the active tasks and terms."""
        columns = self._columns.arrays
        pairs = [
            (law.acceleration, columns["acceleration"]),
            (law.field.g, columns["field.g"]),
            (law.null_space_error, columns["null_space_error"]),
        ]
        pairs += [*self._tasks.copies(active, law), *self._terms.copies(active)]
        return RowCopies(pairs)

    @property
    def count(self) -> int:
        """How many rows are recorded."""
        return self._columns.count

    def rows(self, start: int) -> dict[str, Array]:
        """Return views of the columns from a row to the last one recorded."""
        return self._columns.rows(start)

    def clear(self) -> None:
        """Remove all rows, to make room for new ones."""
        self._columns.clear()

    def rollout(self, status: str, message: str, **meta: Any) -> Rollout:
        """Return the rows recorded so far as a rollout."""
        columns = self._columns.rows()
        complete_columns(columns, continuous_dofs(self._controller.robot))
        return Rollout(columns, self.meta(status, message, **meta))

    def repeatable(self) -> dict[str, Any]:
        """Return what came during the run, as data; see `repeatable`."""
        return repeatable(self._controller, self._tasks.logged, self.plan)

    def meta(self, status: str, message: str, **meta: Any) -> dict[str, Any]:
        """Return the meta data of a rollout of these rows, as JSON data."""
        controller = self._controller
        return {
            "format": FORMAT,
            "status": status,
            "message": message,
            "columns": self._columns.descriptions,
            "robot": robot_meta(controller.robot, self._parents),
            "tasks": self._tasks.meta(),
            **self.repeatable(),
            **null_space_meta(controller),
            "obstacles": {o.name: obstacle_meta(o) for o in self._scene.values()},
            "versions": versions(),
            **meta,
        }


def _skeleton(
    robot: Robot, controller: Controller
) -> tuple[list[tuple[int, str]], list[int]]:
    """Return which of the points to draw are frames, and the parent of each point.

    A point for each joint in order, then for each frame of a task (index and name); a
    parent is the index of another point, -1 for none.
    """
    named: list[tuple[int, str]] = []
    parents: list[int] = []
    index = {0: -1}
    for joint in range(1, robot.model.njoints):
        index[joint] = len(parents)
        parents.append(index[robot.model.parents[joint]])
    frames = dict.fromkeys(
        frame for task in controller.tasks if (frame := getattr(task, "frame", None))
    )
    for frame in frames:
        joint = robot.model.frames[robot.frame_id(frame)].parentJoint
        named.append((len(parents), frame))
        parents.append(index[joint])
    return named, parents
