"""What a log holds of tasks, which may come and go during a run."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.controller import Controller
from hsp_control.control.output import ControlOutput
from hsp_control.declaration.nested import parts_within
from hsp_control.law.problem import Record
from hsp_control.robot import RobotState
from hsp_control.simulation.log_columns import LogColumns
from hsp_control.simulation.run_meta import task_meta
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.trajectories.streams.stream import Streamed

STREAM_CHANNELS = {
    "age": "time since the last message",
    "taken": "messages taken",
    "late": "of these, messages that came too late to count",
    "rejected": "invalid messages",
}
"""What is logged of a stream; see `Streamed.counts`."""


class TaskColumns:
    """The columns of all tasks of a run; a task that is removed keeps its own."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns
        # all tasks that there have been, by their names in the log
        self.logged: dict[str, Task] = {}
        self._levels: dict[str, int] = {}
        self._measured: dict[str, tuple[Array, Array]] = {}  # reference, actual
        self._streams: dict[str, tuple[tuple[str, Streamed], ...]] = {}
        self._names: dict[str, str] = {}  # in the log, of the tasks that there are
        self._compliant: set[str] = set()  # of these, tasks with an impedance
        self._known: list[int] = []
        self.update()

    def update(self) -> bool:
        """Add columns for the tasks that there are; return whether they are others."""
        # By identity: equal tasks of two runs may have streams in different states.
        known = list(map(id, self._controller.tasks))
        if known == self._known:
            return False
        self._known = known
        self._names.clear()
        self._compliant.clear()
        probe = present_state(self._controller)
        for level, tasks in enumerate(self._controller.levels):
            for task in tasks:
                name = self._names[task.name] = self._log_name(task)
                self.logged[name], self._levels[name] = task, level
                self._add(name, task, len(task.measure(probe)[0]))
        return True

    def _log_name(self, task: Task) -> str:
        """Return the task's name in the log."""
        name, k = task.name, 2
        while name in self.logged and task_meta(self.logged[name]) != task_meta(task):
            name, k = f"{task.name}_{k}", k + 1
        return name

    def _add(self, name: str, task: Task, width: int) -> None:
        """Add a task's columns; its reference has so many numbers."""
        column, m, prefix = self._columns.add, task.rows, f"task.{name}"
        parts = task.error_parts
        unit = " and ".join(dict.fromkeys(part.unit for part in parts))
        rate_unit = " and ".join(dict.fromkeys(part.rate_unit for part in parts))
        what = " and ".join(part.name for part in parts)
        column(f"{prefix}.error", (m,), unit, f"error e: {what}")
        column(f"{prefix}.error_rate", (m,), rate_unit, "error rate e'")
        column(f"{prefix}.bounded", (), unit, "length of an error that counts for less")
        # To look for streams in every row would cost more than the row.
        self._streams[name] = tuple(_streams_of(task, name))
        for stream, _ in self._streams[name]:
            for what, meaning in STREAM_CHANNELS.items():
                unit_of = "s" if what == "age" else "-"
                column(f"{stream}.{what}", (), unit_of, meaning)
        if impedance_of(task) is not None:
            self._compliant.add(task.name)
            column(f"{prefix}.stiffness", (m,), "N/m or N·m/rad", "diagonal of K")
        column(f"{prefix}.reference", (width,), unit, "desired value")
        column(f"{prefix}.actual", (width,), unit, "actual value")
        arrays = self._columns.arrays
        self._measured[name] = arrays[f"{prefix}.reference"], arrays[f"{prefix}.actual"]

    def write(self, row: int, state: RobotState) -> None:
        """Write references, what follows them, and what streams have heard."""
        for name, task in self.logged.items():
            reference, actual = self._measured[name]
            reference[row], actual[row] = task.measure(state)
            for prefix, stream in self._streams[name]:
                for what, value in stream.counts().items():
                    self._columns.arrays[f"{prefix}.{what}"][row] = value

    def write_bounded(
        self, row: int, active: ActiveStack, output: ControlOutput
    ) -> None:
        """Write how far the targets are that are too far to count in full."""
        away = output.bounded
        for task in active.task_rows:
            column = self._columns.arrays[f"task.{self._names[task]}.bounded"]
            column[row] = away.get(task, 0.0)

    def write_stiffness(self, row: int, active: ActiveStack) -> None:
        """Write the stiffness of the active tasks that have one."""
        for task in self._compliant & active.task_rows.keys():
            stiffness = np.diag(self._controller.stiffness(task))
            self._columns.arrays[f"task.{self._names[task]}.stiffness"][row] = stiffness

    def copies(self, active: ActiveStack, law: Record) -> Iterator[tuple[Array, Array]]:
        """Yield what the law writes of the active tasks, each with its column."""
        columns = self._columns.arrays
        for task, rows in active.task_rows.items():
            prefix = f"task.{self._names[task]}"
            yield law.task.error[rows], columns[f"{prefix}.error"]
            yield law.task.error_rate[rows], columns[f"{prefix}.error_rate"]

    def meta(self) -> dict[str, Any]:
        """Return what the log says of all tasks that there have been, as JSON data."""
        return {
            name: {**task_meta(task), "level": self._levels[name]}
            for name, task in self.logged.items()
        }


def present_state(controller: Controller) -> RobotState:
    """Return a state at the present time: streams would go on to any later one."""
    robot = controller.robot
    return robot.state(controller.state.t, robot.neutral(), np.zeros(robot.nv))


def _streams_of(task: Task, name: str) -> Iterator[tuple[str, Streamed]]:
    """Yield the streams of a task that is logged by a name, with their own names."""
    if task.remembers:
        for k, stream in enumerate(parts_within(task, Streamed)):
            yield f"stream.{name}" + (f"_{k + 1}" if k else ""), stream
