"""Records a rollout row by row, into columns that are allocated before the run."""

import math
import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ConfigError, SimulationError
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.version import __version__
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.controller import Controller
from hsp_control.control.log_channel import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.declaration.nested import parts_within, with_parts_replaced
from hsp_control.declaration.plain_data import plain_data
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.shapes import shape_to_log
from hsp_control.law.problem import Record
from hsp_control.null_space.fields import NullSpaceField, PointDistance
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import FixedMetric, Metric
from hsp_control.plans import RunningPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation.limit_excess import VELOCITY, LimitExcess
from hsp_control.simulation.log_file import MAX_SIZE
from hsp_control.simulation.rollout import FORMAT, Rollout, complete_columns
from hsp_control.simulation.row_copies import RowCopies
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.trajectories.streams.stream import Streamed

STREAM_CHANNELS = {
    "age": "time since the last message",
    "taken": "messages taken",
    "late": "of these, messages that came too late to count",
    "rejected": "invalid messages",
    "held_back": "1 while the reference waits for the robot",
}
"""What is logged of a stream; see `Streamed.counts`."""
_EFFORT_UNITS = {"rad": "N·m", "m": "N"}


class Recorder:
    """Columns for a known number of rows; an incomplete row is never returned.

    Attributes:
        plan: What the robot follows; its streams are recorded. None: no plan.
    """

    def __init__(
        self,
        controller: Controller,
        scene: Scene,
        rows: int,
        plan: RunningPlan | None = None,
    ) -> None:
        """Allocate all columns.

        Args:
            controller: The controller; its tasks and fields may change during the run.
            scene: Obstacles to log.
            rows: The largest number of rows.
            plan: What the robot follows; its streams are recorded.

        Raises:
            SimulationError: If the log would be too large to be loaded.
        """
        self._controller = controller
        self.plan = plan
        self._scene = scene
        self._rows = 0
        self._capacity = rows
        self._columns: dict[str, Array] = {}
        self._descriptions: dict[str, dict[str, str]] = {}
        self._logged: dict[str, Task] = {}
        self._levels: dict[str, int] = {}
        self._streams: dict[str, tuple[tuple[str, Streamed], ...]] = {}
        self._settled: object = None
        self._law: Record | None = None  # of the present row
        self._yielding: set[str] = set()  # tasks with an impedance
        robot = controller.robot
        nv, units = robot.nv, dict.fromkeys(robot.units)
        self._joint_unit = joint_unit = " or ".join(units)
        effort_unit = " or ".join(_EFFORT_UNITS[unit] for unit in units)
        self._size = 0
        column = self._add_column
        column("t", (), "s", "time")
        column("q", (robot.nq,), joint_unit, "configuration")
        column("v", (nv,), f"{joint_unit}/s", "velocity")
        column("tau", (nv,), effort_unit, "effort M a + N")
        column("acceleration", (nv,), f"({joint_unit})/s²", "commanded acceleration")
        column("joint_positions", (nv,), joint_unit, "joint positions, unwrapped")
        self._add_task_columns()
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
        for contact in controller.contacts:
            prefix = f"contact.{contact.name}"
            column(f"{prefix}.force", (3,), "N", "on the robot, in world axes")
            if contact.force is not None:
                meaning = "force that is commanded, in world axes"
                column(f"{prefix}.commanded", (3,), "N", meaning)
            column(f"{prefix}.position", (3,), "m", "centre of pressure")
            column(f"{prefix}.weight", (), "-", "how much it bears, 0 to 1")
            column(
                f"{prefix}.friction_used", (), "-", "largest ‖f_t‖/(μ f_n) of a point"
            )
        self._excess = LimitExcess(robot)
        self._frames, self._parents = _skeleton(robot, controller)
        column("skeleton", (len(self._parents), 3), "m", "joints and task frames")
        self._add_term_columns()
        for obstacle in scene.values():
            prefix = f"obstacle.{obstacle.name}"
            column(prefix, (3,), "m", "position of its frame")
            column(f"{prefix}.quaternion", (4,), "-", "orientation (x, y, z, w)")

    def _add_column(
        self, name: str, shape: tuple[int, ...], unit: str, meaning: str, **more: str
    ) -> None:
        """Add a column if it does not exist; rows without a value hold NaN."""
        if name not in self._columns:
            self._reserve(self._capacity, shape)
            self._columns[name] = np.full((self._capacity, *shape), np.nan)
            self._descriptions[name] = {"unit": unit, "meaning": meaning, **more}

    def _add_task_columns(self) -> None:
        """Add the columns of all tasks; the tasks may change during the run.

        A task that is removed keeps its columns and its place in the meta data.
        """
        column = self._add_column
        # By identity: equal tasks of two runs may have streams in different states.
        self._known = list(map(id, self._controller.tasks))
        self._log_names: dict[str, str] = {}
        self._copies = IdentityCache(self._bind_copies)
        self._yielding.clear()
        probe = _probe(self._controller)
        levels = [
            (level, task)
            for level, tasks in enumerate(self._controller.levels)
            for task in tasks
        ]
        for level, task in levels:
            name = self._log_name(task)
            self._log_names[task.name] = name
            self._logged[name], self._levels[name] = task, level
            m, prefix = task.rows, f"task.{name}"
            width = len(task.measure(probe)[0])
            parts = task.error_parts
            unit = " and ".join(dict.fromkeys(part.unit for part in parts))
            rate_unit = " and ".join(dict.fromkeys(part.rate_unit for part in parts))
            what = " and ".join(part.name for part in parts)
            column(f"{prefix}.error", (m,), unit, f"error e: {what}")
            column(f"{prefix}.error_rate", (m,), rate_unit, "error rate e'")
            # To look for streams in every row would cost more than the row.
            self._streams[name] = tuple(_streams_of(task, name))
            for stream, _ in self._streams[name]:
                for what, meaning in STREAM_CHANNELS.items():
                    unit_of = "s" if what == "age" else "-"
                    column(f"{stream}.{what}", (), unit_of, meaning)
            if impedance_of(task) is not None:
                self._yielding.add(task.name)
                column(f"{prefix}.stiffness", (m,), "N/m or N·m/rad", "diagonal of K")
            column(f"{prefix}.reference", (width,), unit, "desired value")
            column(f"{prefix}.actual", (width,), unit, "actual value")

    def _log_name(self, task: Task) -> str:
        """Return the task's name in the log.

        A number is added if another task was logged by this name, whose columns do not
        fit.
        """
        name, k = task.name, 2
        while name in self._logged and _task_meta(self._logged[name]) != _task_meta(
            task
        ):
            name, k = f"{task.name}_{k}", k + 1
        return name

    def _add_term_columns(self) -> None:
        """Add the columns of the field's terms; the field may change during the run."""
        controller, probe = self._controller, _probe(self._controller)
        self._copies = IdentityCache(self._bind_copies)
        self._values = IdentityCache(self._bind_values)
        self._distances: dict[str, NullSpaceField] = {}  # terms that measure one
        self._field, self._terms = controller.field, logged_terms(controller)
        shape, unit = (controller.robot.nv,), f"{self._joint_unit}/s"
        for name, field in self._terms.items():
            self._add_column(f"field.{name}.g", shape, unit, "weighted share of g")
            self._add_column(f"field.{name}.value", (), "-", "unweighted cost or norm")
            if field.minimum_distance(probe) is not None:
                column, center = f"distance.{name}", _center_of(field)
                self._distances[column] = field
                self._add_column(column, (), "m", "minimum distance", **center)

    def _reserve(self, rows: int, shape: tuple[int, ...]) -> None:
        """Check that the log can be loaded again, before memory is allocated."""
        self._size += 8 * rows * math.prod(shape)
        if self._size > MAX_SIZE:
            raise SimulationError(
                f"a log of {rows} rows is larger than {MAX_SIZE / 1e9:g} GB; choose a "
                "longer log_period or a shorter duration"
            )

    def record(
        self,
        state: RobotState,
        output: ControlOutput | None,
        tau: Array,
        log_channels: Mapping[str, LogChannel],
    ) -> None:
        """Append a row.

        Args:
            state: The true state.
            output: The controller's output for that state; None: none, and the columns
                of the law hold NaN in this row.
            tau: The commanded effort, computed from the measured state, shape (nv,).
            log_channels: Further columns by name, of the plant and the compensation.
        """
        i, columns = self._rows, self._columns
        robot = self._controller.robot
        settled = self._controller.settled
        if settled is None or settled is not self._settled:
            self._settled = settled
            if list(map(id, self._controller.tasks)) != self._known:
                self._add_task_columns()
            if self._controller.field is not self._field:
                self._add_term_columns()
        columns["t"][i] = state.t
        columns["q"][i] = state.q
        columns["v"][i] = state.v
        columns["tau"][i] = tau
        columns["joint_positions"][i] = robot.joint_positions(state.q)
        for name, task in self._logged.items():
            reference, actual = task.measure(state)
            columns[f"task.{name}.reference"][i] = reference
            columns[f"task.{name}.actual"][i] = actual
            for prefix, stream in self._streams[name]:
                for what, value in stream.counts().items():
                    columns[f"{prefix}.{what}"][i] = value
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
                self._add_column(name, shape, channel.unit, channel.meaning)
            columns[name][i] = channel.value
        self._rows += 1

    def _record_law(self, state: RobotState, output: ControlOutput) -> None:
        i, columns, controller = self._rows, self._columns, self._controller
        self._law = law = output.explanation(self._law)
        active = controller.active_stack
        self._copies.get(active, law).write(i)
        for task in self._yielding & active.task_rows.keys():
            stiffness = np.diag(controller.stiffness(task))
            columns[f"task.{self._log_names[task]}.stiffness"][i] = stiffness
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
        self._record_contacts(output)
        for value, column in self._values.get(state):
            column[i] = value()
        for name, field in self._distances.items():
            columns[name][i] = field.minimum_distance(state)

    def _bind_values(
        self, state: RobotState
    ) -> list[tuple[Callable[[], float], Array]]:
        """Return what computes the value of each term at a state, and its column."""
        return [
            (field.bind_value(state), self._columns[f"field.{name}.value"])
            for name, field in self._terms.items()
        ]

    def _bind_copies(self, active: ActiveStack, law: Record) -> RowCopies:
        """Return what copies the law's arrays, those of the active tasks and terms."""
        columns = self._columns
        pairs = [
            (law.acceleration, columns["acceleration"]),
            (law.field.g, columns["field.g"]),
            (law.null_space_error, columns["null_space_error"]),
        ]
        for task, rows in active.task_rows.items():
            prefix = f"task.{self._log_names[task]}"
            pairs.append((law.task.error[rows], columns[f"{prefix}.error"]))
            pairs.append((law.task.error_rate[rows], columns[f"{prefix}.error_rate"]))
        for name, sample in zip(self._terms, active.term_samples, strict=True):
            pairs.append((sample.g, columns[f"field.{name}.g"]))
        return RowCopies(pairs)

    def _record_contacts(self, output: ControlOutput) -> None:
        if not self._controller.contacts:
            return
        columns, support = self._columns, self._controller.active_stack.support
        world = support.in_world(output.forces)
        commanded = support.in_world(support.reference)
        for contact in self._controller.contacts:
            prefix = f"contact.{contact.name}"
            force = columns[f"{prefix}.force"][self._rows]
            center = columns[f"{prefix}.position"][self._rows]
            used = columns[f"{prefix}.friction_used"]
            force[:], center[:] = 0.0, np.nan
            t = self._columns["t"][self._rows]
            bearing = self._controller.bearing_of(contact.name, t)
            columns[f"{prefix}.weight"][self._rows] = bearing
            if contact not in support.contacts:
                continue
            points = support.points[support.contacts.index(contact)]
            local = output.forces.reshape(-1, 3)[points]
            force[:] = world[points].sum(axis=0)
            if contact.force is not None:
                total = commanded[points].sum(axis=0)
                columns[f"{prefix}.commanded"][self._rows] = total
            normal = np.maximum(local[:, 2], 1e-9)
            center[:] = normal @ support.positions[points] / normal.sum()
            tangential = np.hypot(local[:, 0], local[:, 1])  # without overflow
            loaded = local[:, 2] > 1e-3  # [N]: below it the ratio is rounding
            ratios = tangential[loaded] / (contact.friction * local[loaded, 2])
            used[self._rows] = ratios.max(initial=0.0)

    @property
    def count(self) -> int:
        """How many rows are recorded."""
        return self._rows

    def rows(self, start: int) -> dict[str, Array]:
        """Return views of the columns from a row to the last one recorded."""
        return {name: a[start : self._rows] for name, a in self._columns.items()}

    def clear(self) -> None:
        """Remove all rows, to make room for new ones."""
        for column in self._columns.values():
            column[: self._rows] = np.nan
        self._rows = 0

    def rollout(self, status: str, message: str, **meta: Any) -> Rollout:
        """Return the rows recorded so far as a rollout.

        Args:
            status: How the run ended; see `Rollout.status`.
            message: Why it ended.
            **meta: JSON data to add to the rollout's meta data.
        """
        columns = {name: array[: self._rows] for name, array in self._columns.items()}
        complete_columns(columns, continuous_dofs(self._controller.robot))
        return Rollout(columns, self.meta(status, message, **meta))

    def repeatable(self) -> dict[str, Any]:
        """Return what came during the run, as data, so that the run can be repeated.

        The changes that were made, and what the streams of each task and of the plan
        have taken.
        """
        streams = {
            name: list(parts_within(task, Streamed))
            for name, task in self._logged.items()
            if task.remembers
        }
        heard = {name: [list(s.record) for s in each] for name, each in streams.items()}
        lost = sum(s.unrecorded for each in streams.values() for s in each)
        found = _changes(self._controller) | ({"streams": heard} if heard else {})
        if self.plan is not None:
            planned = list(parts_within(self.plan.plan, Streamed))
            lost += sum(stream.unrecorded for stream in planned)
            if planned:
                found["plan_streams"] = [list(stream.record) for stream in planned]
        return found | ({"streams_lost": lost} if lost else {})

    def meta(self, status: str, message: str, **meta: Any) -> dict[str, Any]:
        """Return the meta data of a rollout of these rows, as JSON data."""
        controller, robot = self._controller, self._controller.robot
        return {
            "format": FORMAT,
            "status": status,
            "message": message,
            "columns": self._descriptions,
            "robot": {
                "name": robot.name,
                "nq": robot.nq,
                "nv": robot.nv,
                "dofs": list(robot.dof_names),
                "units": list(robot.units),
                "continuous": continuous_dofs(robot),
                "skeleton_parents": self._parents,
                "joint_coordinates": robot.source.joint_coordinates,
            },
            "tasks": {
                name: {**_task_meta(task), "level": self._levels[name]}
                for name, task in self._logged.items()
            },
            **self.repeatable(),
            "field": controller.field.name,
            "controls_null_space": controller.field.controls,
            "null_space_gain": controller.null_space_gain.tolist(),
            "metric": type(controller.metric).__name__,
            "metric_matrix": _constant_matrix(controller.metric),
            "obstacles": {o.name: _obstacle_meta(o) for o in self._scene.values()},
            "versions": versions(),
            **meta,
        }


def _streams_of(task: Task, name: str) -> Iterator[tuple[str, Streamed]]:
    """Yield the streams of a task that is logged by a name, with their own names."""
    if task.remembers:
        for k, stream in enumerate(parts_within(task, Streamed)):
            yield f"stream.{name}" + (f"_{k + 1}" if k else ""), stream


def _as_recorded(stream: Streamed) -> Streamed:
    return replace(stream, source=None, messages=stream.record)


def continuous_dofs(robot: Robot) -> list[int]:
    """Return the dofs of continuous joints, whose configuration is (cos, sin)."""
    joints = robot.single_dof_joints
    return [int(i) for i in joints[joints[:, 2] == 2, 0]]


def versions() -> dict[str, str]:
    """Return the versions of the packages that a run depends on."""
    packages = ("pin", "numpy", "scipy", "numba")
    return {
        "hsp_control": __version__,
        "python": platform.python_version(),
        **{package: version(package) for package in packages},
    }


def _changes(controller: Controller) -> dict[str, Any]:
    try:
        changes = [
            plain_data(with_parts_replaced(change, Streamed, _as_recorded))
            for change in controller.changes
        ]
    except ConfigError as error:
        return {"changes": None, "changes_lost": str(error)}
    return {"changes": changes}


def logged_terms(controller: Controller) -> dict[str, NullSpaceField]:
    """Return the terms of the controller's field, by names that differ."""
    terms = terms_of(controller.field)
    names = [term.name for term in terms]
    return {
        name if names.count(name) == 1 else f"{name}_{k}": term
        for k, (name, term) in enumerate(zip(names, terms, strict=True))
    }


def _center_of(field: NullSpaceField) -> dict[str, str]:
    """Return which obstacle's centre a field's distance leads to, if to a centre."""
    if isinstance(field, PointDistance) and isinstance(field.obstacle, Obstacle):
        return {"center_of": field.obstacle.name}
    return {}


def _task_meta(task: Task) -> dict[str, Any]:
    return {
        "type": type(task).__name__,
        "rows": task.rows,
        "error": [list(part) for part in task.error_parts],
        "drawn": list(task.drawn),
        "axes": getattr(task, "axes", None),
        "frame": getattr(task, "frame", None),
    }


def _obstacle_meta(obstacle: Obstacle) -> dict[str, Any]:
    radius = obstacle.shape.bounding_radius
    return {
        "shape": type(obstacle.shape).__name__,
        "parameters": shape_to_log(obstacle.shape),
        "radius": radius if np.isfinite(radius) else None,
    }


def _constant_matrix(metric: Metric) -> list[list[float]] | None:
    if isinstance(metric, FixedMetric):
        return [[float(x) for x in row] for row in metric.W]
    return None


def _probe(controller: Controller) -> RobotState:
    """Return a state at the present time: streams would go on to any later one."""
    robot = controller.robot
    return robot.state(controller.state.t, robot.neutral(), np.zeros(robot.nv))


def _skeleton(
    robot: Robot, controller: Controller
) -> tuple[list[tuple[int, str]], list[int]]:
    """Return which of the points to draw are frames, and the parent of each point.

    There is one point per joint, in their order, and then one per frame that a task
    controls: of these index and name. A parent is the index of another point, -1 for
    none.
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
