"""Writes a run for Rerun's viewer, with the names of our own view.

The scene is below ``robot``, ``obstacles`` and ``paths``, as in the page; every column
of the log is a curve below ``log``, by its own name. Needs the extra ``rerun``.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ExportError
from hsp_control.companions.plots import palette
from hsp_control.companions.viewer.commands import path_element
from hsp_control.companions.viewer.motion import RunMotion
from hsp_control.companions.viewer.obstacles import logged_shapes, triangles_of
from hsp_control.companions.viewer.packing import read_mesh
from hsp_control.companions.viewer.replay import robot_of
from hsp_control.companions.viewer.robot_drawing import Visual, read_visuals
from hsp_control.companions.viewer.targets import read_targets
from hsp_control.companions.viewer.threejs import collada_object, mesh_geometry
from hsp_control.geometry import shapes
from hsp_control.geometry.shapes import Shape
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import task_names

INSTALL = "pip install 'hsp_control[rerun]'"
TIMELINE = "t"
"""The name of the run's time in Rerun [s]."""


def log_to_rerun(
    rollout: Rollout,
    robot: Robot | None = None,
    *,
    recording: Any = None,
    path: str | Path | None = None,
) -> Any:
    """Log a run to Rerun: the robot, obstacles, paths, and all columns as curves.

    Args:
        rollout: The run.
        robot: Its robot; None: the one that the log's configuration names.
        recording: A `rerun.RecordingStream` to log into, besides other data; None:
            a new one.
        path: A file ``.rrd`` to write, instead of a recording to log into; None: none,
            and the recording goes where its owner sends it.

    Returns:
        The recording.

    Raises:
        ExportError: If Rerun is not installed, a mesh cannot be read, the file cannot
            be written, or both a recording and a file are given.
        ViewerError: If the log has no configuration that names its robot.
    """
    try:
        import rerun
    except ImportError:
        raise ExportError(
            f"logging to Rerun needs rerun-sdk; install it with: {INSTALL}"
        ) from None
    if recording is not None and path is not None:
        raise ExportError("give either a recording or a path")
    robot = robot_of(rollout) if robot is None else robot
    if recording is None:
        title = rollout.meta.get("title") or rollout.meta.get("name") or robot.name
        recording = rerun.RecordingStream(str(title))
        recording.send_blueprint(_layout(rollout))
    if path is not None:
        try:
            Path(path).touch()
            recording.save(str(path))
        except OSError as error:
            raise ExportError(f"{path}: {error.strerror or error}") from error
    motion = RunMotion(robot, rollout)
    recording.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _log_robot(rerun, recording, motion)
    _log_obstacles(rerun, recording, motion)
    _log_paths(rerun, recording, motion)
    times = rerun.TimeColumn(TIMELINE, duration=rollout.t)
    for name, column in _curves(rollout):
        columns = rerun.Scalars.columns(scalars=column)
        recording.send_columns(f"/log/{name}", [times], columns)
    if path is not None:
        recording.disconnect()  # completes the file
    return recording


def _layout(rollout: Rollout) -> Any:
    """Return the layout of Rerun's viewer: the scene, and beside it a few plots."""
    from rerun import blueprint

    shown = {
        "Task errors": [f"task.{name}.error" for name in task_names(rollout)],
        "Null-space error ‖e_N‖": ["null_space_norm"],
        "Distances": [n for n in rollout.columns if n.startswith("distance.")],
        "Efforts": ["tau"],
    }
    plots = [
        blueprint.TimeSeriesView(
            origin="/log", name=title, contents=[f"+ /log/{name}/**" for name in names]
        )
        for title, names in shown.items()
        if any(name in rollout.columns for name in names)
    ]
    scene = blueprint.Spatial3DView(
        origin="/", name="Scene", contents=["+ /**", "- /log/**"]
    )
    return blueprint.Blueprint(
        blueprint.Horizontal(
            scene, blueprint.Vertical(*plots), column_shares=[3.0, 2.0]
        ),
        blueprint.SelectionPanel(state="collapsed"),
        blueprint.BlueprintPanel(state="collapsed"),
        blueprint.TimePanel(timeline=TIMELINE, state="collapsed"),
    )


def _log_robot(rerun: Any, recording: Any, motion: RunMotion) -> None:
    robot = motion.robot
    nodes = [f"/robot/{path_element(name)}" for name in robot.model.names]
    for k, visual in enumerate(read_visuals(robot)):
        path = f"{nodes[visual.joint]}/{path_element(visual.link)}/{k}"
        place, turned = visual.pose[:3, 3], visual.pose[:3, :3]
        pose = rerun.Transform3D(translation=place, mat3x3=turned)
        recording.log(path, pose, static=True)
        for i, shape in enumerate(_archetypes(rerun, visual, path)):
            recording.log(f"{path}/{i}", shape, static=True)
    poses = motion.joint_poses()
    for joint, node in enumerate(nodes[1:], start=1):
        _send_poses(rerun, recording, node, motion.times, poses[:, joint])


def _log_obstacles(rerun: Any, recording: Any, motion: RunMotion) -> None:
    for name, shape in logged_shapes(motion.rows).items():
        path = f"/obstacles/{path_element(name)}"
        for drawn in _shape(rerun, shape):
            recording.log(path, drawn, static=True)
        where = motion.rows[f"obstacle.{name}"]
        turns = motion.rows[f"obstacle.{name}.quaternion"]
        poses = np.hstack([where, turns])
        _send_poses(rerun, recording, path, motion.times, poses)


def _shape(rerun: Any, shape: Shape) -> Iterator[Any]:
    """Yield the entities that Rerun draws for an obstacle; none for a half-space."""
    solid = {"colors": [_rgb(palette.OBSTACLE)], "fill_mode": "solid"}
    match shape:
        case shapes.Sphere():
            yield rerun.Ellipsoids3D(radii=[shape.radius], **solid)
        case shapes.Box():
            yield rerun.Boxes3D(sizes=[shape.size], **solid)
        case shapes.Capsule() | shapes.Cylinder():
            length, radius = [shape.length], [shape.radius]
            if isinstance(shape, shapes.Cylinder):
                yield rerun.Cylinders3D(radii=radius, lengths=length, **solid)
            else:
                down = [[0.0, 0.0, -0.5 * shape.length]]
                yield rerun.Capsules3D(
                    radii=radius, lengths=length, translations=down, **solid
                )
        case _ if np.isfinite(shape.bounding_radius):
            yield _mesh(rerun, *triangles_of(shape.geometry()), _rgb(palette.OBSTACLE))


def _log_paths(rerun: Any, recording: Any, motion: RunMotion) -> None:
    """Log the whole paths, and the present references as points."""
    for target in read_targets(motion.rows):
        if target.desired is None:
            continue
        root = f"/paths/{path_element(target.name)}"
        for name, points, color in (
            ("desired", target.desired, palette.DESIRED),
            ("actual", target.actual, palette.ACTUAL),
        ):
            line = rerun.LineStrips3D([points], colors=[_rgb(color)])
            recording.log(f"{root}/{name}", line, static=True)
        path = f"/targets/{path_element(target.name)}"
        point = rerun.Points3D([[0.0, 0.0, 0.0]], colors=[_rgb(palette.DESIRED)])
        recording.log(path, point, static=True)
        still = np.tile([0.0, 0.0, 0.0, 1.0], (len(motion.times), 1))
        turns = still if target.rotation is None else target.rotation
        poses = np.hstack([target.desired, turns])
        _send_poses(rerun, recording, path, motion.times, poses)


def _send_poses(
    rerun: Any, recording: Any, path: str, times: Array, poses: Array
) -> None:
    """Send the motion of a node: x, y, z [m] and a quaternion, shape (N, 7)."""
    columns = rerun.Transform3D.columns(
        translation=poses[:, :3], quaternion=poses[:, 3:]
    )
    time = rerun.TimeColumn(TIMELINE, duration=times)
    recording.send_columns(path, [time], columns)


def _archetypes(rerun: Any, visual: Visual, owner: str) -> Iterator[Any]:
    """Yield Rerun's entities for a piece of a link; none without its mesh."""
    size, color = visual.size, [*visual.color]
    solid = {"colors": [color], "fill_mode": "solid"}
    match visual.kind:
        case "box":
            yield rerun.Boxes3D(sizes=[size], **solid)
        case "sphere":
            yield rerun.Ellipsoids3D(radii=[size[0]], **solid)
        case "cylinder":
            yield rerun.Cylinders3D(radii=[size[0]], lengths=[size[1]], **solid)
        case "capsule":
            down = [[0.0, 0.0, -0.5 * size[1]]]
            yield rerun.Capsules3D(
                radii=[size[0]], lengths=[size[1]], translations=down, **solid
            )
        case "ellipsoid":
            yield rerun.Ellipsoids3D(radii=[size], **solid)
        case _ if visual.mesh is not None:
            yield _mesh(rerun, *visual.mesh, color)
        case _ if visual.file is not None:
            collada = visual.file.suffix.lower() == ".dae"
            thing = (
                collada_object(visual.file)["object"]
                if collada
                else mesh_geometry(visual.file)
            )
            for piece in read_mesh(thing, owner):
                vertices = piece.vertices * np.asarray(size)
                yield _mesh(rerun, vertices, piece.triangles, piece.color or color)


def _mesh(rerun: Any, vertices: Array, triangles: Any, color: Any) -> Any:
    return rerun.Mesh3D(
        vertex_positions=vertices,
        vertex_normals=_normals(vertices, triangles),
        triangle_indices=triangles,
        albedo_factor=color,
    )


def _normals(vertices: Array, triangles: Any) -> Array:
    """Return the normals of vertices, shape (N, 3): without them nothing is shaded.

    A normal is the mean of the triangles' normals, weighted by their areas.
    """
    first, second, third = np.moveaxis(vertices[triangles], 1, 0)
    of_triangles = np.cross(second - first, third - first)
    normals = np.zeros_like(vertices, dtype=float)
    for corner in np.asarray(triangles).T:
        np.add.at(normals, corner, of_triangles)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0.0, lengths, 1.0)


def _rgb(color: str) -> list[float]:
    """Return the channels of ``#RRGGBB``, from 0 to 1."""
    return [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]


def _curves(rollout: Rollout) -> Iterator[tuple[str, Array]]:
    """Yield the log's columns by component: (name, values (N,))."""
    dofs = rollout.meta["robot"]["dofs"]
    for name, column in rollout.columns.items():
        flat = column.reshape(len(column), -1)
        if name == "t" or not flat.shape[1]:
            continue
        by_dof = flat.shape[1] == len(dofs) and name != "q"
        for k in range(flat.shape[1]):
            part = dofs[k] if by_dof else str(k)
            yield f"{name}/{part}" if column.ndim > 1 else name, flat[:, k]
