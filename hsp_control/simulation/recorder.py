"""Fills a rollout's columns, one row at a time, into memory that is there already."""

import math
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.controller import Controller, ControlOutput
from hsp_control.exceptions import SimulationError
from hsp_control.fields import FieldSample, NullSpaceField, WeightedSum
from hsp_control.metrics import ConstantMetric, Metric
from hsp_control.plants import Reading
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Obstacle, Scene
from hsp_control.simulation.log_file import MAX_SIZE
from hsp_control.simulation.rollout import FORMAT, Rollout
from hsp_control.version import __version__

_EFFORT_UNITS = {"rad": "N·m", "m": "N"}


class Recorder:
    """Columns for a known number of rows; only whole rows count."""

    def __init__(self, controller: Controller, scene: Scene, rows: int) -> None:
        """Allocate every column."""
        self._controller = controller
        self._scene = scene
        self._rows = 0
        self._columns: dict[str, Array] = {}
        self._meaning: dict[str, dict[str, str]] = {}
        robot = controller.robot
        nv, units = robot.nv, dict.fromkeys(robot.units)
        joint_unit = " or ".join(units)
        effort_unit = " or ".join(_EFFORT_UNITS[unit] for unit in units)

        self._size = 0

        def column(name: str, shape: tuple[int, ...], unit: str, meaning: str) -> None:
            self._reserve(rows, shape)
            self._columns[name] = np.zeros((rows, *shape))
            self._meaning[name] = {"unit": unit, "meaning": meaning}

        column("t", (), "s", "time")
        column("q", (robot.nq,), joint_unit, "configuration")
        column("v", (nv,), f"{joint_unit}/s", "velocity")
        column("tau", (nv,), effort_unit, "effort M a + N")
        column("acceleration", (nv,), f"({joint_unit})/s²", "commanded acceleration")
        column("joint_positions", (nv,), joint_unit, "joints' positions, unwound")
        for task in controller.tasks:
            m, prefix = task.rows, f"task.{task.name}"
            width = len(task.measure(_probe(robot))[0])
            unit = "m or rad"
            column(f"{prefix}.error", (m,), unit, "e in the task's coordinates")
            column(f"{prefix}.error_rate", (m,), f"{unit}/s", "e'")
            column(f"{prefix}.reference", (width,), unit, "desired")
            column(f"{prefix}.actual", (width,), unit, "measured")
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
        self._terms = _terms(controller)
        for name, (_, field) in self._terms.items():
            column(f"field.{name}.g", (nv,), f"{joint_unit}/s", "weighted contribution")
            column(f"field.{name}.value", (), "-", "unweighted cost or norm")
            if field.least_distance(_probe(robot)) is not None:
                column(f"distance.{name}", (), "m", "least distance it watches")
        for obstacle in scene.values():
            column(f"obstacle.{obstacle.name}", (3,), "m", "its centre")
            column(f"obstacle.{obstacle.name}.quaternion", (4,), "-", "x, y, z, w")

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
        output: ControlOutput,
        tau: Array,
        readings: Mapping[str, Reading],
    ) -> None:
        """Append a row.

        Args:
            state: The true state.
            output: What the controller makes of the true state.
            tau: The effort that it commands, of what it is shown, shape (nv,).
            readings: What the plant tells of itself.
        """
        i, columns, controller = self._rows, self._columns, self._controller
        robot = controller.robot
        columns["t"][i] = state.t
        columns["q"][i] = state.q
        columns["v"][i] = state.v
        columns["tau"][i] = tau
        columns["acceleration"][i] = output.acceleration
        columns["joint_positions"][i] = robot.joint_positions(state.q)
        for task in controller.tasks:
            prefix = f"task.{task.name}"
            reference, actual = task.measure(state)
            rows = controller.task_rows.get(task.name)
            on = rows is not None  # a task that does not count has no error
            columns[f"{prefix}.error"][i] = output.task.error[rows] if on else np.nan
            rate = output.task.error_rate[rows] if on else np.nan
            columns[f"{prefix}.error_rate"][i] = rate
            columns[f"{prefix}.reference"][i] = reference
            columns[f"{prefix}.actual"][i] = actual
        diagnostics = controller.diagnose(state)
        columns["field.g"][i] = output.field.g
        columns["field.value"][i] = diagnostics.field_value
        columns["null_space_error"][i] = output.null_space_error
        columns["null_space_norm"][i] = diagnostics.null_space_norm
        columns["manipulability"][i] = diagnostics.manipulability
        values = diagnostics.singular_values
        columns["singular_values"][i] = np.nan
        columns["singular_values"][i, : len(values)] = values
        columns["damped"][i] = output.damped
        columns["status"][i] = output.status
        columns["relaxation"][i] = output.relaxation
        self._record_contacts(output)
        for k, (frame, joint) in enumerate(self._joints):
            columns["skeleton"][i, k] = (
                state.position(frame) if frame else state.data.oMi[joint].translation
            )
        for name, (sample, field) in self._terms.items():
            columns[f"field.{name}.g"][i] = (sample or output.field).g
            columns[f"field.{name}.value"][i] = field.value(state)
            if f"distance.{name}" in columns:
                columns[f"distance.{name}"][i] = field.least_distance(state)
        for obstacle in self._scene.values():
            placement = pin.SE3ToXYZQUAT(obstacle.placement(state.t))
            columns[f"obstacle.{obstacle.name}"][i] = placement[:3]
            columns[f"obstacle.{obstacle.name}.quaternion"][i] = placement[3:]
        for name, reading in readings.items():
            if name not in columns:
                shape = np.shape(reading.value)
                self._reserve(len(columns["t"]), shape)
                columns[name] = np.zeros((len(columns["t"]), *shape))
                self._meaning[name] = {
                    "unit": reading.unit,
                    "meaning": reading.meaning,
                }
            columns[name][i] = reading.value
        self._rows += 1

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
            tangential = np.linalg.norm(local[:, :2], axis=1)
            loaded = local[:, 2] > 1e-3  # [N]: below it the ratio is of two zeros
            ratios = tangential[loaded] / (contact.friction * local[loaded, 2])
            used[self._rows] = ratios.max(initial=0.0)

    def rows(self, start: int) -> dict[str, Array]:
        """Return the columns from a row on, as far as they have come; no copies."""
        return {name: a[start : self._rows] for name, a in self._columns.items()}

    def rollout(self, status: str, message: str, **meta: Any) -> Rollout:
        """Return the rows recorded so far as a rollout."""
        controller, robot = self._controller, self._controller.robot
        columns = {name: array[: self._rows] for name, array in self._columns.items()}
        positions = columns["joint_positions"]
        circular = _continuous(robot)
        positions[:, circular] = np.unwrap(positions[:, circular], axis=0)
        return Rollout(
            columns,
            {
                "format": FORMAT,
                "status": status,
                "message": message,
                "columns": self._meaning,
                "robot": {
                    "name": robot.name,
                    "nq": robot.nq,
                    "nv": robot.nv,
                    "freedoms": list(robot.freedom_names),
                    "units": list(robot.units),
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
            },
        )


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


def _continuous(robot: Robot) -> list[int]:
    return [j.idx_v for j in robot.joints.values() if j.nq == 2 and j.nv == 1]
