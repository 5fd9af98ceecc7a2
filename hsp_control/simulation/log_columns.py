"""The columns of a log: values of tasks, fields and contacts in every row."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.constraints.limits import (
    Barrier,
    MinimumDistance,
    RobotLimits,
    barrier_names,
)
from hsp_control.control.active_stack import ActiveStack, StackedTask, tasks_of
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.control.task_names import TaskNames, task_meta
from hsp_control.declaration.nested import parts_within
from hsp_control.geometry.scene import Obstacle
from hsp_control.law.problem import StepRecord
from hsp_control.null_space.fields import NullSpaceField, PointDistance
from hsp_control.null_space.fields.field import terms_of
from hsp_control.robot import RobotState
from hsp_control.simulation.journal import Shapes, joined, views, width
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.impedance import parts_of
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.streams.streamed import Streamed

MAX_SIZE = 2_000_000_000
"""Most bytes of all columns: an hour at 1 kHz with 70 numbers per row."""

Sources = Iterator[tuple[str, Array]]
"""Columns, with the arrays that the law writes for them."""


class LogColumns:
    """The columns of a log, declared once: the present row, and the rows before.

    Attributes:
        row: The arrays of the present row, by column; values that are not
            written are NaN.
        numbers: The same numbers side by side, shape (n,); another array once columns
            were added.
        descriptions: The unit and the meaning of each column, as JSON data.
        count: How many rows are complete.
    """

    def __init__(self, capacity: int) -> None:
        """Begin without columns; ``capacity`` is how many rows are kept."""
        self.row: dict[str, Array] = {}
        self.numbers = np.zeros(0)
        self.descriptions: dict[str, dict[str, Any]] = {}
        self.count = 0
        self._capacity = capacity
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._laid_out = True
        # The rows before columns were added, and the present ones, with their shapes.
        self._earlier: list[tuple[Shapes, Array]] = []
        self._block, self._first = np.zeros((0, 0)), 0

    @property
    def shapes(self) -> Shapes:
        """The shapes of the columns of `row`."""
        return {name: numbers.shape for name, numbers in self.row.items()}

    def add(
        self, name: str, shape: tuple[int, ...], unit: str, meaning: str, **more: Any
    ) -> None:
        """Declare a column if there is none of that name; `lay_out` makes it."""
        if name not in self._shapes:
            self._shapes[name], self._laid_out = shape, False
            self.descriptions[name] = {"unit": unit, "meaning": meaning, **more}

    def widen(self, name: str, length: int) -> None:
        """Widen a column of vectors to at least this many numbers."""
        if length > self._shapes[name][0]:
            self._shapes[name], self._laid_out = (length,), False

    def lay_out(self) -> None:
        """Make the columns that were added; present values of the row are kept."""
        if self._laid_out:
            return
        old, size = self.row, width(self._shapes)
        if 8 * self._capacity * size > MAX_SIZE:  # before memory is allocated
            raise SimulationError(
                f"a log of {self._capacity} rows is larger than {MAX_SIZE / 1e9:g} GB; "
                "choose a longer log_period or a shorter duration"
            )
        if self.count > self._first:
            kept = self._block[: self.count - self._first]
            self._earlier.append((self.shapes, kept))
            self._first = self.count
        self._block = np.empty((max(self._capacity - self.count, 0), size))
        self.numbers = np.full(size, np.nan)
        self.row = views(self.numbers, self._shapes)
        for name, values in old.items():
            self.row[name][tuple(map(slice, values.shape))] = values
        self._laid_out = True

    def begin_row(self) -> None:
        """Begin the next row."""
        self.numbers.fill(np.nan)

    def keep_row(self) -> None:
        """Append the present row to those that are kept."""
        if self._capacity:
            self._block[self.count - self._first] = self.numbers
        self.count += 1

    def rows(self, start: int = 0) -> dict[str, Array]:
        """Return the columns from a row to the last complete one, views if possible."""
        present = self.shapes, self._block[: self.count - self._first]
        return joined([*self._earlier, present], start)


STREAM_CHANNELS = {
    "age": "time since the last message",
    "taken": "messages taken",
    "late": "of these, messages that arrived too late to be used",
    "rejected": "invalid messages",
}
"""The columns of a stream; see `StreamRun.counts`."""


class TaskColumns:
    """The columns of all tasks of a run; those of a removed task are kept."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns
        # all tasks that there have been, by their names in the log
        self.logged: dict[str, Task] = {}
        # the tasks' streams at their first appearance, as declared; those of changes
        # are theirs
        self.streamed: dict[str, list[Streamed]] = {}
        self._levels: dict[str, int] = {}
        self._streams: dict[str, list[tuple[str, StreamRun]]] = {}
        self._names = TaskNames()
        self._known: list[tuple[int, int]] = []
        # the active tasks: their places in the log, names, and springs
        self._active: list[tuple[str, str]] = []
        self._springs: list[tuple[str, StackedTask]] = []
        self.update()

    def update(self) -> None:
        """Add columns for the present tasks, if they have changed."""
        # By identity: equal tasks of two runs may have streams in different states.
        levels = self._controller.planned_levels
        known = [(each.key, id(each.task)) for level in levels for each in level]
        if known == self._known:
            return
        self._known = known
        names = self._names.update(each for level in levels for each in level)
        probe = _present_state(self._controller)
        for level, tasks in enumerate(levels):
            for each in tasks:
                task, name = each.task, names[each.key]
                self.logged[name], self._levels[name] = task, level
                runs = [each.run for each in parts_within(task, FollowedStream)]
                self.streamed.setdefault(name, [run.declared for run in runs])
                self._add(name, task, len(task.measure(probe.read_only)[0]))

    def _add(self, name: str, task: Task, width: int) -> None:
        """Add a task's columns; its reference has the given size."""
        column, m, prefix = self._columns.add, task.rows, f"task.{name}"
        parts = task.error_parts
        unit = " and ".join(dict.fromkeys(part.unit for part in parts))
        rate_unit = " and ".join(dict.fromkeys(part.rate_unit for part in parts))
        what = " and ".join(part.name for part in parts)
        column(f"{prefix}.error", (m,), unit, f"error e: {what}")
        column(f"{prefix}.error_rate", (m,), rate_unit, "error rate e'")
        column(f"{prefix}.bounded", (), unit, "length of an error that is bounded")
        # A search for streams in every row would cost more than the row.
        self._streams[name] = list(_streams_of(task, name))
        for stream, _ in self._streams[name]:
            for what, meaning in STREAM_CHANNELS.items():
                unit_of = "s" if what == "age" else "-"
                column(f"{stream}.{what}", (), unit_of, meaning)
        if impedance_of(task) is not None:
            column(f"{prefix}.stiffness", (m,), "N/m or N·m/rad", "diagonal of K")
        column(f"{prefix}.reference", (width,), unit, "desired value")
        column(f"{prefix}.actual", (width,), unit, "actual value")

    def write(self, state: RobotState) -> None:
        """Write references, tracked values, and the counters of streams."""
        row = self._columns.row
        for name, task in self.logged.items():
            reference, actual = task.measure(state.read_only)
            row[f"task.{name}.reference"][:] = reference
            row[f"task.{name}.actual"][:] = actual
            for prefix, stream in self._streams[name]:
                for what, value in stream.counts().items():
                    row[f"{prefix}.{what}"][...] = value

    def write_law(self, output: ControlOutput) -> None:
        """Write errors beyond the largest, and stiffnesses, of the active tasks."""
        row, away = self._columns.row, output.bounded
        for prefix, name in self._active:
            row[f"{prefix}.bounded"][...] = away.get(name, 0.0)
        for prefix, each in self._springs:
            stiffness = parts_of(each.in_force.numbers).K
            row[f"{prefix}.stiffness"][:] = np.diag(stiffness)

    def sources(self, stacks: Sequence[ActiveStack], law: StepRecord) -> Sources:
        """Return the law's arrays of the active tasks, which `write_law` writes, too.

        Those of ``law`` are the active stack's, the last one. To look at a stack in
        every row would cost a third of the row.
        """
        found: list[tuple[str, Array]] = []
        self._active, self._springs = [], []
        for name, stack, each in tasks_of(stacks):
            prefix = f"task.{self._names.present[each.planned.key]}"
            rows = law.task if stack is stacks[-1] else stack.rows
            found.append((f"{prefix}.error", rows.error[each.rows]))
            found.append((f"{prefix}.error_rate", rows.error_rate[each.rows]))
            self._active.append((prefix, name))
            if impedance_of(each.planned.task) is not None:
                self._springs.append((prefix, each))
        return iter(found)

    def meta(self) -> dict[str, Any]:
        """Return the log's description of all tasks of the run, as JSON data."""
        return {
            name: {**task_meta(task), "level": self._levels[name]}
            for name, task in self.logged.items()
        }


def _present_state(controller: Controller) -> RobotState:
    """Return a state at the present time: streams would advance to any later one."""
    robot = controller.robot
    return robot.state(controller.state.t, robot.neutral(), np.zeros(robot.nv))


def _streams_of(task: Task, name: str) -> Iterator[tuple[str, StreamRun]]:
    """Yield the streams of a task that is logged by a name, with their own names."""
    if task.remembers:
        for k, each in enumerate(parts_within(task, FollowedStream)):
            yield f"stream.{name}" + (f"_{k + 1}" if k else ""), each.run


class TermColumns:
    """The columns of all terms of a controller's field; old ones keep theirs."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns
        self._unit = " or ".join(dict.fromkeys(controller.robot.units)) + "/s"
        self._field: NullSpaceField | None = None
        self.update()

    def update(self) -> None:
        """Add columns for the present terms, if they have changed."""
        controller, column = self._controller, self._columns.add
        if controller.field is self._field:
            return
        self._field, self._terms = controller.field, logged_terms(controller)
        self._distances: dict[str, NullSpaceField] = {}  # terms that measure one
        probe, nv = _present_state(controller), controller.robot.nv
        for name, term in self._terms.items():
            column(f"field.{name}.g", (nv,), self._unit, "weighted share of g")
            column(f"field.{name}.value", (), "-", "unweighted cost or norm")
            if term.minimum_distance(probe) is not None:
                distance = f"distance.{name}"
                self._distances[distance] = term
                column(distance, (), "m", "minimum distance", **_center_of(term))

    def write(self, state: RobotState) -> None:
        """Write the values of the terms, and distances."""
        row = self._columns.row
        for name, term in self._terms.items():
            row[f"field.{name}.value"][...] = term.value(state.read_only)
        for name, term in self._distances.items():
            row[name][...] = term.minimum_distance(state.read_only)

    def sources(self, active: ActiveStack) -> Sources:
        """Yield the law's arrays of the terms."""
        for name, sample in zip(self._terms, active.term_samples, strict=True):
            yield f"field.{name}.g", sample.g


def logged_terms(controller: Controller) -> dict[str, NullSpaceField]:
    """Return the terms of the controller's field, by names that differ."""
    terms = terms_of(controller.field)
    names = [term.name for term in terms]
    return {
        name if names.count(name) == 1 else f"{name}_{k}": term
        for k, (name, term) in enumerate(zip(names, terms, strict=True))
    }


class BarrierColumns:
    """The columns of the limits' barriers; those of removed ones are kept."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns
        self._limits: RobotLimits | None = None
        self._barriers: dict[str, Barrier] = {}
        self.update()

    def update(self) -> None:
        """Add columns for the present barriers, if they have changed."""
        limits = self._controller.limits
        if limits is self._limits:
            return
        self._limits = limits
        self._barriers = logged_barriers(() if limits is None else limits.barriers)
        for name, each in self._barriers.items():
            least = {"minimum": each.minimum}
            if isinstance(each, MinimumDistance):
                self._columns.add(name, (), "m", "minimum distance", **least)
            else:
                self._columns.add(name, (), "-", "smallest value", **least)

    def write(self, state: RobotState) -> None:
        """Write the smallest values."""
        row = self._columns.row
        for name, each in self._barriers.items():
            row[name][...] = np.min(each.values(state.read_only))


def logged_barriers(barriers: Sequence[Barrier]) -> dict[str, Barrier]:
    """Return barriers by their columns, such as ``distance.self_distance``."""
    return {
        f"{'distance' if isinstance(each, MinimumDistance) else 'barrier'}.{name}": each
        for name, each in zip(barrier_names(barriers), barriers, strict=True)
    }


def _center_of(term: NullSpaceField) -> dict[str, str]:
    """Return which obstacle's centre a term's distance leads to, if to a centre."""
    if isinstance(term, PointDistance) and isinstance(term.obstacle, Obstacle):
        return {"center_of": term.obstacle.name}
    return {}


class ContactColumns:
    """The columns of all contacts: forces, centres of pressure, friction in use."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns
        for contact in controller.contacts:
            prefix, column = f"contact.{contact.name}", columns.add
            column(f"{prefix}.force", (3,), "N", "on the robot, in world axes")
            if contact.force is not None:
                meaning = "force that is commanded, in world axes"
                more = {"frame": contact.frame, "normal": contact.axes[:, 2].tolist()}
                column(f"{prefix}.commanded", (3,), "N", meaning, **more)
            column(f"{prefix}.position", (3,), "m", "centre of pressure")
            column(f"{prefix}.weight", (), "-", "how active it is, 0 to 1")
            column(
                f"{prefix}.friction_used", (), "-", "largest ‖f_t‖/(μ f_n) of a point"
            )

    def write(self, t: float, output: ControlOutput) -> None:
        """Write a row."""
        controller, row = self._controller, self._columns.row
        if not controller.contacts:
            return
        support = controller.active_stack.support
        world = support.in_world(output.forces)
        commanded = support.in_world(support.reference)
        for contact in controller.contacts:
            prefix = f"contact.{contact.name}"
            row[f"{prefix}.force"][:] = 0.0
            row[f"{prefix}.weight"][...] = controller.contact_weight(contact.name, t)
            points = support.points_of(contact.name)
            if points is None:
                continue
            local = output.forces.reshape(-1, 3)[points]
            row[f"{prefix}.force"][:] = world[points].sum(axis=0)
            if contact.force is not None:
                row[f"{prefix}.commanded"][:] = commanded[points].sum(axis=0)
            normal = np.maximum(local[:, 2], 1e-9)
            center = normal @ support.positions[points] / normal.sum()
            row[f"{prefix}.position"][:] = center
            tangential = np.hypot(local[:, 0], local[:, 1])  # without overflow
            loaded = local[:, 2] > 1e-3  # [N]: below it the ratio is rounding
            ratios = tangential[loaded] / (contact.friction * local[loaded, 2])
            row[f"{prefix}.friction_used"][...] = ratios.max(initial=0.0)


def write_channels(columns: LogColumns, channels: Mapping[str, LogChannel]) -> None:
    """Write the values that the parts of a run report; a new name is a new column."""
    for name, channel in channels.items():
        if name not in columns.row:
            shape = np.shape(channel.value)
            columns.add(name, shape, channel.unit, channel.meaning)
    columns.lay_out()
    for name, channel in channels.items():
        columns.row[name][...] = channel.value
