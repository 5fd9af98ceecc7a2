"""Writes the log of a run row by row, in memory or into a journal, or both."""

import platform
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigError
from hsp_control.common.version import __version__
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.change import Change
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.control.plans import RunningPlan
from hsp_control.declaration.imported import fingerprints
from hsp_control.declaration.nested import with_parts_replaced
from hsp_control.declaration.plain_data import plain_data
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.shapes import Mesh, shape_to_log
from hsp_control.law.problem import StepRecord
from hsp_control.null_space.metrics import FixedMetric
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.description.recorded_meshes import mesh_data
from hsp_control.robot.recorded import robot_record
from hsp_control.simulation.journal import JournalWriter
from hsp_control.simulation.limit_excess import VELOCITY, LimitExcess
from hsp_control.simulation.log_columns import (
    BarrierColumns,
    ContactColumns,
    LogColumns,
    TaskColumns,
    TermColumns,
    write_channels,
)
from hsp_control.simulation.rollout import FORMAT, Rollout, complete_columns
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.streams.streamed import Streamed

_EFFORT_UNITS = {"rad": "N·m", "m": "N"}


class LogWriter:
    """Writes the log of a run; an incomplete row is never written.

    Attributes:
        path: The journal, to which rows are written at once; None: rows stay in memory
        only.
        plan: The plan that the robot follows; its streams are recorded. None: no plan.
    """

    def __init__(
        self,
        controller: Controller,
        scene: Scene,
        rows: int,
        plan: RunningPlan | None = None,
        *,
        path: Path | None = None,
        meta: Mapping[str, Any] | None = None,
    ) -> None:
        """Declare the columns.

        Args:
            controller: The controller.
            scene: Obstacles to log.
            rows: How many rows are kept in memory; 0: none, and then any number of
                them can be written.
            plan: The plan of the run.
            path: The journal to write; `Rollout.load` reads it also after a crash.
            meta: JSON data to add to the log's.

        Raises:
            SimulationError: If so many rows are too large.
            LogError: If the journal cannot be created.
        """
        self.path, self.plan = path, plan
        self._controller, self._scene = controller, scene
        self._columns = columns = LogColumns(rows)
        self._settled: object = None
        self._made: dict[int, Change] = {}  # all changes of the run, by identity
        # the latest runs of streams, by their declarations' identities
        self._streams: dict[int, StreamRun] = {}
        self._placed: dict[str, Array] = {}  # where the obstacles are
        self._law: StepRecord | None = None  # of the present row
        self._stacks: list[ActiveStack] = []  # those of `_sources`
        self._sources: list[tuple[str, Array]] = []  # the law's arrays for columns
        robot, column = controller.robot, columns.add
        nv, units = robot.nv, dict.fromkeys(robot.units)
        joint_unit = " or ".join(units)
        rated = f"({joint_unit})" if len(units) > 1 else joint_unit
        effort_unit = " or ".join(_EFFORT_UNITS[unit] for unit in units)
        column("t", (), "s", "time")
        column("q", (robot.nq,), joint_unit, "configuration")
        column("v", (nv,), f"{rated}/s", "velocity")
        column("tau", (nv,), effort_unit, "effort M a + N")
        column("acceleration", (nv,), f"{rated}/s²", "commanded acceleration")
        column("joint_positions", (nv,), joint_unit, "joint positions, unwrapped")
        self._tasks = TaskColumns(controller, columns)
        column("field.g", (nv,), f"{rated}/s", "null-space field")
        column("field.value", (), "-", "cost f, or norm of a vector field")
        column("null_space_error", (nv,), f"{rated}/s", "e_N = (I - J#J)(g - v)")
        column("null_space_norm", (), f"{rated}/s", "norm of e_N in the metric")
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
               "3 limits relaxed; 4 beyond a limit")  # fmt: skip
        column("relaxation", (), "(rad or m)/s²", "largest violation of a limit")
        self._contacts = ContactColumns(controller, columns)
        self._excess = LimitExcess(robot)
        self._frames, self._parents = _skeleton(robot, controller)
        column("skeleton", (len(self._parents), 3), "m", "joints and task frames")
        self._terms = TermColumns(controller, columns)
        self._barriers = BarrierColumns(controller, columns)
        for obstacle in scene.values():
            prefix = f"obstacle.{obstacle.name}"
            column(prefix, (3,), "m", "position of its frame")
            column(f"{prefix}.quaternion", (4,), "-", "orientation (x, y, z, w)")
        columns.lay_out()
        self._let_streams_record()
        self._meta = dict(meta or {})
        self._robot_record = robot_record(robot)
        self._meshes = _meshes_of(scene)
        self._journal = None if path is None else JournalWriter(path)
        self._headed: Array | None = None  # the row for which there is a heading

    def record(
        self,
        state: RobotState,
        output: ControlOutput | None,
        tau: Array,
        log_channels: Mapping[str, LogChannel],
        *,
        keep: bool = True,
        parts: bool = True,
    ) -> None:
        """Write a row.

        Args:
            state: The state.
            output: The controller's output for it; None: the law's columns are empty.
            tau: The effort of the motors, shape (nv,).
            log_channels: Further values to log, by name.
            keep: Whether the row is written; False: see `warm_up`.
            parts: Whether tasks and obstacles are evaluated: a user's may raise, again
                and again. Else the obstacles are where they were in the last row.

        Raises:
            LogError: If the journal cannot be written.
        """
        controller, columns = self._controller, self._columns
        columns.begin_row()
        settled = controller._settled_step
        if settled is None or settled is not self._settled:
            self._settled = settled
            self._tasks.update()
            self._terms.update()
            if settled is not None:  # both are kept during a transition
                self._barriers.update()
            self._keep_messages()
            columns.lay_out()
            self._stacks = []
        row = columns.row
        row["t"][...] = state.t
        row["q"][:], row["v"][:], row["tau"][:] = state.q, state.v, tau
        row["joint_positions"][:] = controller.robot.joint_positions(state.q)
        if parts:
            self._tasks.write(state)
        if parts or not self._placed:
            self._placed = self._place_obstacles(state.t)
        skeleton = row["skeleton"]
        joints = len(skeleton) - len(self._frames)
        skeleton[:joints] = state.world.placements[1:, 9:]
        for k, frame in self._frames:
            skeleton[k] = state.position(frame)
        for name, placement in self._placed.items():
            row[f"obstacle.{name}"][:] = placement[:3]
            row[f"obstacle.{name}.quaternion"][:] = placement[3:]
        if output is not None:
            self._fill_law(state, output)
        if VELOCITY not in log_channels:  # not recorded by the loop: this row alone
            self._excess.record(controller.limits, state.q, state.v)
            log_channels = {**self._excess.collect(controller.limits), **log_channels}
        write_channels(columns, log_channels)
        self._write_heading()
        if not keep:
            return
        if self._journal is not None:
            self._journal.write_row(columns.numbers)
        columns.keep_row()

    def _place_obstacles(self, t: float) -> dict[str, Array]:
        """Return position and quaternion of the obstacles, shape (7,), by name."""
        moved, placed = self._controller.scene, {}
        for known in self._scene.values():
            # No `get`: a scene raises its own error, not KeyError.
            obstacle = moved[known.name] if known.name in moved else known  # noqa: SIM401
            placed[obstacle.name] = pin.SE3ToXYZQUAT(obstacle.placement(t))
        return placed

    def warm_up(self, *row: Any, parts: bool = True) -> None:
        """Do everything for a row except writing it; the heading is written."""
        self.record(*row, keep=False, parts=parts)

    def _fill_law(self, state: RobotState, output: ControlOutput) -> None:
        controller, columns = self._controller, self._columns
        stacks = controller.stacks
        before = self._law
        self._law = law = output.explanation(before)
        if stacks != self._stacks or law is not before:
            self._stacks, self._sources = stacks, self._find_sources(stacks, law)
        diagnostics = controller.diagnose()
        values = diagnostics.singular_values
        columns.widen("singular_values", len(values))
        columns.lay_out()
        row = columns.row
        for name, source in self._sources:
            row[name][:] = source
        self._tasks.write_law(output)
        row["field.value"][...] = diagnostics.field_value
        row["null_space_norm"][...] = diagnostics.null_space_norm
        row["manipulability"][...] = diagnostics.manipulability
        row["singular_values"][: len(values)] = values
        levels = [each.damped_level for each in stacks] if output.damped else []
        row["damped"][...] = next(filter(None, levels), 0)
        row["status"][...] = output.status
        row["relaxation"][...] = output.relaxation
        self._contacts.write(state.t, output)
        self._terms.write(state)
        self._barriers.write(state)

    def _find_sources(
        self, stacks: Sequence[ActiveStack], law: StepRecord
    ) -> list[tuple[str, Array]]:
        """Return the law's arrays of the columns."""
        return [
            ("acceleration", law.acceleration),
            ("field.g", law.field.g),
            ("null_space_error", law.null_space_error),
            *self._tasks.sources(stacks, law),
            *self._terms.sources(stacks[-1]),
        ]

    def _write_heading(self) -> None:
        """Write a heading to the journal, if there are other columns than before."""
        columns = self._columns
        if self._journal is not None and self._headed is not columns.numbers:
            self._journal.write_heading(columns.shapes, self.meta("running", ""))
            self._headed = columns.numbers

    @property
    def count(self) -> int:
        """How many rows are written."""
        return self._columns.count

    def rows(self, start: int) -> dict[str, Array]:
        """Return the columns from a row to the last one, of the rows in memory."""
        return self._columns.rows(start)

    def end(self, status: str, message: str, **meta: Any) -> None:
        """Write how the run ended to the journal, if there is one, and close it."""
        if self._journal is None:
            return
        try:
            self._journal.write_end(status, message, **self._came_during_run(), **meta)
        except KeyboardInterrupt:  # it may be called again afterwards
            raise
        except BaseException:
            self._journal.close()
            raise
        self._journal.close()

    def close(self) -> None:
        """Close the journal, if there is one, without an end."""
        if self._journal is not None:
            self._journal.close()

    def rollout(self, status: str, message: str, **meta: Any) -> Rollout:
        """Return the rows in memory as a rollout."""
        columns = {name: a.copy() for name, a in self._columns.rows().items()}
        complete_columns(columns, continuous_dofs(self._controller.robot))
        return Rollout(columns, self.meta(status, message, **meta))

    def meta(self, status: str, message: str, **meta: Any) -> dict[str, Any]:
        """Return the meta data of a rollout of these rows, as JSON data."""
        controller = self._controller
        robot, metric, limits = controller.robot, controller.metric, controller.limits
        return {
            "format": FORMAT,
            "status": status,
            "message": message,
            "columns": self._columns.descriptions,
            "robot": {
                "name": robot.name,
                "nq": robot.nq,
                "nv": robot.nv,
                "dofs": list(robot.dof_names),
                "units": list(robot.units),
                "rotors": bool(robot.model.armature.any()),
                "continuous": continuous_dofs(robot),
                "skeleton_parents": self._parents,
                "joint_coordinates": robot.source.joint_coordinates,
                "record": self._robot_record,
            },
            "limits": {}
            if limits is None
            else {
                name: [x if np.isfinite(x) else None for x in vars(limits)[name]]
                for name in ("lower", "upper", "velocity", "effort")
            },
            "tasks": self._tasks.meta(),
            **self._came_during_run(),
            "field": controller.field.name,
            "controls_null_space": controller.field.controls,
            "null_space_gain": controller.null_space_gain.tolist(),
            "metric": type(metric).__name__,
            "metric_matrix": (
                metric.W.tolist() if isinstance(metric, FixedMetric) else None
            ),
            "obstacles": {o.name: _obstacle_meta(o) for o in self._scene.values()},
            **({"obstacle_meshes": self._meshes} if self._meshes else {}),
            "versions": versions(),
            **(given := {**self._meta, **meta}),
            # A reader of the log runs this code only if it is unchanged.
            "imported": fingerprints((given.get("config") or {}).get("imports") or ()),
        }

    def _keep_messages(self) -> None:
        """Keep changes, which a controller discards; let streams record all messages.

        A log repeats both.
        """
        self._made |= {id(each): each for each in self._controller.changes}
        self._let_streams_record()

    def _let_streams_record(self) -> None:
        planned = [] if self.plan is None else self.plan.streams
        for run in (*self._controller.streams, *planned):
            run.log()
            self._streams[id(run.declared)] = run

    def _changes(self) -> dict[str, Any]:
        """Return the changes that were made, their streams as they were recorded."""
        self._keep_messages()
        missing = self._controller._changes_made - len(self._made)
        if missing > 0:
            lost = f"{missing} were over before the next row was written"
            return {"changes": None, "changes_lost": lost}
        try:
            changes = [
                plain_data(self._repeated(change))
                for change in sorted(self._made.values(), key=lambda each: each.at)
            ]
        except ConfigError as error:
            return {"changes": None, "changes_lost": str(error)}
        return {"changes": changes}

    def _repeated(self, change: Change) -> Change:
        """Return a change whose streams repeat their messages."""

        def declared(stream: Streamed) -> Streamed:
            return self._streams[id(stream)].repeated()

        made: Change = with_parts_replaced(
            with_parts_replaced(change, Streamed, declared),
            FollowedStream,
            lambda followed: followed.run.repeated(),
        )
        return made

    def _came_during_run(self) -> dict[str, Any]:
        """Return changes that were made, and the streams' messages, as JSON data.

        With them, a run can be repeated from its log.
        """
        streams = {
            name: [self._streams[id(each)] for each in declared]
            for name, declared in self._tasks.streamed.items()
            if declared
        }
        heard = {name: [list(s.record) for s in each] for name, each in streams.items()}
        lost = sum(s.unrecorded for each in streams.values() for s in each)
        found = self._changes() | ({"streams": heard} if heard else {})
        if self.plan is not None:
            planned = self.plan.streams
            lost += sum(stream.unrecorded for stream in planned)
            if planned:
                found["plan_streams"] = [list(stream.record) for stream in planned]
        return found | ({"streams_lost": lost} if lost else {})


def _meshes_of(scene: Scene) -> dict[str, Any]:
    """Return the meshes of obstacles as JSON data; empty if there are none."""
    shapes = [each.shape for each in scene.values() if isinstance(each.shape, Mesh)]
    files = {str(shape.file): Path(shape.file) for shape in shapes}
    return mesh_data("this scene", files) if files else {}


def _obstacle_meta(obstacle: Obstacle) -> dict[str, Any]:
    """Return the log's description of an obstacle."""
    radius = obstacle.shape.bounding_radius
    return {
        "shape": type(obstacle.shape).__name__,
        "parameters": shape_to_log(obstacle.shape),
        "radius": radius if np.isfinite(radius) else None,
    }


def continuous_dofs(robot: Robot) -> list[int]:
    """Return the dofs of continuous joints, whose configuration is (cos, sin)."""
    joints = robot.single_dof_joints
    return [int(i) for i in joints[joints[:, 2] == 2, 0]]


def versions() -> dict[str, str]:
    """Return the versions of the packages that a run depends on."""
    python = {"hsp_control": __version__, "python": platform.python_version()}
    return python | _installed()


@cache  # reading a package's metadata takes milliseconds
def _installed() -> dict[str, str]:
    return {package: version(package) for package in ("pin", "numpy", "scipy")}


def _skeleton(
    robot: Robot, controller: Controller
) -> tuple[list[tuple[int, str]], list[int]]:
    """Return which of the drawn points are frames, and the points' parents.

    A point per joint in order, then for every frame of a task (index and name); a
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
