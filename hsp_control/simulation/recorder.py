"""Fills a rollout's columns, one row at a time, into memory that is there already."""

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.controller import Controller, ControlOutput
from hsp_control.fields import FieldSample, NullSpaceField, WeightedSum
from hsp_control.metrics import ConstantMetric, Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Obstacle, Scene
from hsp_control.simulation.rollout import FORMAT, Rollout
from hsp_control.version import __version__


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
        nv, joint_unit = robot.nv, " or ".join(dict.fromkeys(robot.units))
        effort_unit = joint_unit.replace("rad", "N·m").replace("or m", "or N")
        effort_unit = "N" if joint_unit == "m" else effort_unit

        def column(name: str, shape: tuple[int, ...], unit: str, meaning: str) -> None:
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

    def record(self, state: RobotState, output: ControlOutput) -> None:
        """Append the row of a state and of what the controller made of it."""
        i, columns, controller = self._rows, self._columns, self._controller
        robot = controller.robot
        columns["t"][i] = state.t
        columns["q"][i] = state.q
        columns["v"][i] = state.v
        columns["tau"][i] = output.tau
        columns["acceleration"][i] = output.acceleration
        columns["joint_positions"][i] = robot.joint_positions(state.q)
        for task in controller.tasks:
            rows, prefix = controller.task_rows[task.name], f"task.{task.name}"
            reference, actual = task.measure(state)
            columns[f"{prefix}.error"][i] = output.task.error[rows]
            columns[f"{prefix}.error_rate"][i] = output.task.error_rate[rows]
            columns[f"{prefix}.reference"][i] = reference
            columns[f"{prefix}.actual"][i] = actual
        diagnostics = controller.diagnose(state)
        columns["field.g"][i] = output.field.g
        columns["field.value"][i] = diagnostics.field_value
        columns["null_space_error"][i] = output.null_space_error
        columns["null_space_norm"][i] = diagnostics.null_space_norm
        columns["manipulability"][i] = diagnostics.manipulability
        columns["singular_values"][i] = diagnostics.singular_values
        columns["damped"][i] = output.damped
        for k, (frame, joint) in enumerate(self._joints):
            columns["skeleton"][i, k] = (
                state.position(frame) if frame else state.data.oMi[joint].translation
            )
        for name, (sample, field) in self._terms.items():
            columns[f"field.{name}.g"][i] = sample.g
            columns[f"field.{name}.value"][i] = field.value(state)
            if f"distance.{name}" in columns:
                columns[f"distance.{name}"][i] = field.least_distance(state)
        for obstacle in self._scene.values():
            placement = pin.SE3ToXYZQUAT(obstacle.placement(state.t))
            columns[f"obstacle.{obstacle.name}"][i] = placement[:3]
            columns[f"obstacle.{obstacle.name}.quaternion"][i] = placement[3:]
        self._rows += 1

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
                        "axes": getattr(task, "axes", None),
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


def _terms(controller: Controller) -> dict[str, tuple[FieldSample, NullSpaceField]]:
    """Return each term of the controller's field and where its share of g stands."""
    field = controller.field
    if not isinstance(field, WeightedSum):
        return {field.name: (controller.field_sample, field)}
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
