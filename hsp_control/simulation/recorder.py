"""Fills a rollout's columns, one row at a time, into memory that is there already."""

import math
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.common.version import __version__
from hsp_control.control.controller import Controller, ControlOutput
from hsp_control.control.log_channel import LogChannel
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.null_space.fields import FieldSample, NullSpaceField, WeightedSum
from hsp_control.null_space.metrics import ConstantMetric, Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation.log_file import MAX_SIZE
from hsp_control.simulation.rollout import FORMAT, Rollout, settle

_EFFORT_UNITS = {"rad": "N·m", "m": "N"}


class Recorder:
    """Columns for a known number of rows; only whole rows count."""

    def __init__(self, controller: Controller, scene: Scene, rows: int) -> None:
        """Allocate every column."""
        self._controller = controller
        self._scene = scene
        self._rows = 0
        self._capacity = rows
        self._columns: dict[str, Array] = {}
        self._meaning: dict[str, dict[str, str]] = {}
        robot = controller.robot
        nv, units = robot.nv, dict.fromkeys(robot.units)
        self._joint_unit = joint_unit = " or ".join(units)
        effort_unit = " or ".join(_EFFORT_UNITS[unit] for unit in units)
        self._size = 0
        column = self._open
        column("t", (), "s", "time")
        column("q", (robot.nq,), joint_unit, "configuration")
        column("v", (nv,), f"{joint_unit}/s", "velocity")
        column("tau", (nv,), effort_unit, "effort M a + N")
        column("acceleration", (nv,), f"({joint_unit})/s²", "commanded acceleration")
        column("joint_positions", (nv,), joint_unit, "joints' positions, unwound")
        self._open_tasks()
        column("field.g", (nv,), f"{joint_unit}/s", "null-space field")
        column("field.value", (), "-", "cost f, or norm of a vector field")
        column("null_space_error", (nv,), f"{joint_unit}/s", "e_N = (I - J#J)(g - v)")
        column("null_space_norm", (), f"{joint_unit}/s", "norm of e_N in the metric")
        column("manipulability", (), "-", "det(J W⁻¹ Jᵀ) of all tasks")
        rows_of_tasks = sum(task.rows for task in controller.tasks)
        column("singular_values", (rows_of_tasks,), "-", "of J L⁻ᵀ, W = L Lᵀ")
        column("damped", (), "-", "1 where a singularity made the law bounded")
        column("status", (), "-", "0 the law; 1 forces redistributed; 2 limited; 3 "
               "limits relaxed")  # fmt: skip
        column(
            "relaxation", (), "(rad or m)/s²", "by how much the worst limit is missed"
        )
        for contact in controller.contacts:
            prefix = f"contact.{contact.name}"
            column(f"{prefix}.force", (3,), "N", "on the robot, in the world")
            column(f"{prefix}.position", (3,), "m", "its centre of pressure")
            column(
                f"{prefix}.friction_used", (), "-", "‖f_t‖/(μ f_n), the worst point's"
            )
        self._joints, self._edges = _skeleton(robot, controller)
        column("skeleton", (len(self._edges), 3), "m", "joints and task frames")
        self._open_terms()
        for obstacle in scene.values():
            column(f"obstacle.{obstacle.name}", (3,), "m", "its centre")
            column(f"obstacle.{obstacle.name}.quaternion", (4,), "-", "x, y, z, w")

    def _open(self, name: str, shape: tuple[int, ...], unit: str, meaning: str) -> None:
        """Open a column, if it is not; rows without a value of it hold NaN."""
        if name not in self._columns:
            self._reserve(self._capacity, shape)
            self._columns[name] = np.full((self._capacity, *shape), np.nan)
            self._meaning[name] = {"unit": unit, "meaning": meaning}

    def _open_tasks(self) -> None:
        """Open the columns of all tasks: some may have come while it runs."""
        self._tasks = self._controller.tasks
        probe, unit = _probe(self._controller.robot), "m or rad"
        for task in self._tasks:
            m, prefix = task.rows, f"task.{task.name}"
            width = len(task.measure(probe)[0])
            self._open(f"{prefix}.error", (m,), unit, "e in the task's coordinates")
            self._open(f"{prefix}.error_rate", (m,), f"{unit}/s", "e'")
            self._open(f"{prefix}.reference", (width,), unit, "desired")
            self._open(f"{prefix}.actual", (width,), unit, "measured")

    def _open_terms(self) -> None:
        """Open the columns of the field's terms: it may have changed while it runs."""
        controller, probe = self._controller, _probe(self._controller.robot)
        self._field, self._terms = controller.field, _terms(controller)
        shape, unit = (controller.robot.nv,), f"{self._joint_unit}/s"
        for name, (_, field) in self._terms.items():
            self._open(f"field.{name}.g", shape, unit, "weighted contribution")
            self._open(f"field.{name}.value", (), "-", "unweighted cost or norm")
            if field.least_distance(probe) is not None:
                self._open(f"distance.{name}", (), "m", "least distance it watches")

    def _reserve(self, rows: int, shape: tuple[int, ...]) -> None:
        """Refuse a log that could not be read again, before memory is asked for it."""
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
            output: What the controller makes of that state; None: nothing, and what
                only the law tells is not a number in this row.
            tau: The effort that it commands, of what it is shown, shape (nv,).
            log_channels: What the plant tells of itself.
        """
        i, columns = self._rows, self._columns
        robot = self._controller.robot
        if self._controller.tasks is not self._tasks:
            self._open_tasks()
        if self._controller.field is not self._field:
            self._open_terms()
        columns["t"][i] = state.t
        columns["q"][i] = state.q
        columns["v"][i] = state.v
        columns["tau"][i] = tau
        columns["joint_positions"][i] = robot.joint_positions(state.q)
        for task in self._tasks:
            reference, actual = task.measure(state)
            columns[f"task.{task.name}.reference"][i] = reference
            columns[f"task.{task.name}.actual"][i] = actual
        for k, (frame, joint) in enumerate(self._joints):
            columns["skeleton"][i, k] = (
                state.position(frame) if frame else state.data.oMi[joint].translation
            )
        for obstacle in self._scene.values():
            placement = pin.SE3ToXYZQUAT(obstacle.placement(state.t))
            columns[f"obstacle.{obstacle.name}"][i] = placement[:3]
            columns[f"obstacle.{obstacle.name}.quaternion"][i] = placement[3:]
        if output is not None:
            self._record_law(state, output)
        for name, reading in log_channels.items():
            self._open(name, np.shape(reading.value), reading.unit, reading.meaning)
            columns[name][i] = reading.value
        self._rows += 1

    def _record_law(self, state: RobotState, output: ControlOutput) -> None:
        i, columns, controller = self._rows, self._columns, self._controller
        columns["acceleration"][i] = output.acceleration
        for name, rows in controller.task_rows.items():  # those that count
            columns[f"task.{name}.error"][i] = output.task.error[rows]
            columns[f"task.{name}.error_rate"][i] = output.task.error_rate[rows]
        diagnostics = controller.diagnose(state)
        columns["field.g"][i] = output.field.g
        columns["field.value"][i] = diagnostics.field_value
        columns["null_space_error"][i] = output.null_space_error
        columns["null_space_norm"][i] = diagnostics.null_space_norm
        columns["manipulability"][i] = diagnostics.manipulability
        values = diagnostics.singular_values
        if (more := len(values) - columns["singular_values"].shape[1]) > 0:
            old = columns["singular_values"]
            columns["singular_values"] = np.pad(
                old, ((0, 0), (0, more)), constant_values=np.nan
            )
        columns["singular_values"][i, : len(values)] = values
        columns["damped"][i] = output.damped
        columns["status"][i] = output.status
        columns["relaxation"][i] = output.relaxation
        self._record_contacts(output)
        for name, (sample, field) in self._terms.items():
            columns[f"field.{name}.g"][i] = (sample or output.field).g
            columns[f"field.{name}.value"][i] = field.value(state)
            if f"distance.{name}" in columns:
                columns[f"distance.{name}"][i] = field.least_distance(state)

    def _record_contacts(self, output: ControlOutput) -> None:
        columns, support = self._columns, self._controller.mode.support
        world = support.in_world(output.forces)
        for contact in self._controller.contacts:
            prefix = f"contact.{contact.name}"
            force = columns[f"{prefix}.force"][self._rows]
            place = columns[f"{prefix}.position"][self._rows]
            used = columns[f"{prefix}.friction_used"]
            force[:], place[:] = 0.0, np.nan
            if contact not in support.contacts:
                continue
            where = support.points[support.contacts.index(contact)]
            local = output.forces.reshape(-1, 3)[where]
            force[:] = world[where].sum(axis=0)
            pressed = np.maximum(local[:, 2], 1e-9)
            place[:] = pressed @ support.places[where] / pressed.sum()
            tangential = np.hypot(local[:, 0], local[:, 1])  # no square overflows
            loaded = local[:, 2] > 1e-3  # [N]: below it the ratio is of two zeros
            ratios = tangential[loaded] / (contact.friction * local[loaded, 2])
            used[self._rows] = ratios.max(initial=0.0)

    def rows(self, start: int) -> dict[str, Array]:
        """Return the columns from a row on, as far as they have come; no copies."""
        return {name: a[start : self._rows] for name, a in self._columns.items()}

    def forget(self) -> None:
        """Make room: the rows so far have another place."""
        for column in self._columns.values():
            column[: self._rows] = np.nan
        self._rows = 0

    def rollout(self, status: str, message: str, **meta: Any) -> Rollout:
        """Return the rows recorded so far as a rollout."""
        columns = {name: array[: self._rows] for name, array in self._columns.items()}
        settle(columns, continuous_dofs(self._controller.robot))
        return Rollout(columns, self.meta(status, message, **meta))

    def meta(self, status: str, message: str, **meta: Any) -> dict[str, Any]:
        """Return what a rollout of these rows says of itself, as JSON data."""
        controller, robot = self._controller, self._controller.robot
        return {
            "format": FORMAT,
            "status": status,
            "message": message,
            "columns": self._meaning,
            "robot": {
                "name": robot.name,
                "nq": robot.nq,
                "nv": robot.nv,
                "freedoms": list(robot.dof_names),
                "units": list(robot.units),
                "continuous": continuous_dofs(robot),
                "skeleton_parents": self._edges,
                "joint_coordinates": robot.source.joint_coordinates,
            },
            "tasks": {
                task.name: {
                    "type": type(task).__name__,
                    "rows": task.rows,
                    "level": controller.level_of(task.name),
                    "axes": getattr(task, "axes", None),
                    "frame": getattr(task, "frame", None),
                }
                for task in controller.tasks
            },
            "field": controller.field.name,
            "controls_null_space": controller.field.controls,
            "null_space_gain": controller.null_space_gain.tolist(),
            "metric": type(controller.metric).__name__,
            "metric_matrix": _constant_matrix(controller.metric),
            "obstacles": {o.name: _described(o) for o in self._scene.values()},
            "versions": versions(),
            **meta,
        }


def continuous_dofs(robot: Robot) -> list[int]:
    """Return the freedoms of joints that turn without end, as (cos, sin)."""
    joints = robot.single_joints
    return [int(i) for i in joints[joints[:, 2] == 2, 0]]


def versions() -> dict[str, str]:
    """Return the versions that a run depends on."""
    packages = ("pin", "numpy", "scipy", "numba")
    return {
        "hsp_control": __version__,
        "python": platform.python_version(),
        **{package: version(package) for package in packages},
    }


def _terms(
    controller: Controller,
) -> dict[str, tuple[FieldSample | None, NullSpaceField]]:
    """Return each term of the controller's field and where its share of g stands.

    None stands for the whole g, where there is but one.
    """
    field = controller.field
    if not isinstance(field, WeightedSum):
        return {field.name: (None, field)}
    terms = zip(field.samples, (term for _, term in field.terms), strict=True)
    names = [term.name for _, term in field.terms]
    return {
        name if names.count(name) == 1 else f"{name}_{k}": pair
        for k, (name, pair) in enumerate(zip(names, terms, strict=True))
    }


def _described(obstacle: Obstacle) -> dict[str, Any]:
    reach = obstacle.shape.reach
    return {
        "shape": type(obstacle.shape).__name__,
        "parameters": {k: str(v) if isinstance(v, Path) else v
                       for k, v in vars(obstacle.shape).items()},
        "radius": reach if np.isfinite(reach) else None,
    }  # fmt: skip


def _constant_matrix(metric: Metric) -> list[list[float]] | None:
    if isinstance(metric, ConstantMetric):
        return [[float(x) for x in row] for row in metric.W]
    return None


def _probe(robot: Robot) -> RobotState:
    return robot.state(0.0, robot.neutral(), np.zeros(robot.nv))


def _skeleton(
    robot: Robot, controller: Controller
) -> tuple[list[tuple[str, int]], list[int]]:
    """Return the points to draw as (frame, joint) and the parent of each, -1 for none.

    One point a joint, and one a frame that a task follows.
    """
    points: list[tuple[str, int]] = []
    parents: list[int] = []
    index = {0: -1}
    for joint in range(1, robot.model.njoints):
        index[joint] = len(points)
        points.append(("", joint))
        parents.append(index[robot.model.parents[joint]])
    frames = dict.fromkeys(
        frame for task in controller.tasks if (frame := getattr(task, "frame", None))
    )
    for frame in frames:
        joint = robot.model.frames[robot.frame_id(frame)].parentJoint
        points.append((frame, joint))
        parents.append(index[joint])
    return points, parents
