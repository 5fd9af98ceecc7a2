"""Arrows of contact forces and of self-motion, and the manipulability ellipsoid."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import permutations

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.analysis import (
    null_space_projector,
)
from hsp_control.companions.plots.palette import FIELD, TASK, WARNING
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    Json,
    LegendEntry,
    PageCommand,
    path_element,
    set_object,
    translucent,
)
from hsp_control.companions.viewer.motion import Layer, RunMotion, Track
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot, RobotState

_RADIUS = 0.007  # radius of an arrow's shaft, over the robot's size
_FULL_WIDTH = 12.0  # length over radius from which an arrow has its full radius


def unit_arrow(surface: Json, radius: float) -> Json:
    """Return an arrow along z of length 1 with the given shaft radius [m]."""
    profile = np.array([(0, 0), (1, 0), (1, 0.72), (2.5, 0.72), (0, 1)])
    thing = threejs.mesh(threejs.lathe(profile * [radius, 1.0]), surface, shadow=False)
    # Draw it after the objects through which it is visible.
    thing["object"]["renderOrder"] = 1
    return threejs.group([thing])


def unit_bar(surface: Json, radius: float) -> Json:
    """Return a bar along z of length 1 with the given radius [m]."""
    solid = threejs.lathe(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [radius, 1.0])
    return threejs.mesh_group(solid, surface, shadow=False)


def arrow_tracks(
    path: str, times: Array, origins: Array, vectors: Array, radius: float
) -> Iterator[Track]:
    """Yield the tracks that turn a unit arrow into vectors; short ones are thinner."""
    lengths = np.linalg.norm(vectors, axis=1)
    widths = np.minimum(lengths / (_FULL_WIDTH * radius), 1.0)
    yield from _tracks(path, times, origins, vectors, np.c_[widths, widths, lengths])


def bar_tracks(path: str, times: Array, starts: Array, ends: Array) -> Iterator[Track]:
    """Yield the tracks with which a unit bar connects two points."""
    vectors, ones = ends - starts, np.ones(len(times))
    scales = np.c_[ones, ones, np.linalg.norm(vectors, axis=1)]
    yield from _tracks(path, times, starts, vectors, scales)


def _tracks(
    path: str, times: Array, origins: Array, vectors: Array, scales: Array
) -> Iterator[Track]:
    yield Track(path, "position", times, origins)
    yield Track(path, "quaternion", times, threejs.quaternions_along(vectors))
    yield Track(path, "scale", times, scales)


# -- contact forces -------------------------------------------------------------------

_PREFIX, _FORCE, _POSITION = "contact.", ".force", ".position"
_WEIGHT_LENGTH = 0.5
"""Length of an arrow that shows the robot's weight, over the robot's size."""
_GRAVITY = 9.81  # m/s²


def contacts(robot: Robot, motion: RunMotion, root: str) -> Layer:
    """Draw contact forces: columns ``contact.<name>.position`` and ``.force``."""
    weight = _GRAVITY * sum(inertia.mass for inertia in robot.model.inertias)
    columns, size = motion.rows.columns, motion.size
    names = [
        name
        for column in columns
        if column.startswith(_PREFIX) and column.endswith(_FORCE)
        for name in [column[len(_PREFIX) : -len(_FORCE)]]
        if f"{_PREFIX}{name}{_POSITION}" in columns
    ]
    paths = {name: f"{root}/{path_element(name)}" for name in names}

    def draw(_: float) -> Iterator[PageCommand]:
        for path in paths.values():
            # Contacts lie inside the legs' meshes.
            surface = threejs.always_visible(threejs.material(WARNING, glow=0.5))
            yield set_object(f"{path}/force", unit_arrow(surface, _RADIUS * size))
            ball = threejs.sphere(1.5 * _RADIUS * size)
            yield set_object(f"{path}/point", threejs.mesh_group(ball, surface))

    def tracks(motion: RunMotion) -> Iterator[Track]:
        times = motion.times
        for name, path in paths.items():
            position = _held(motion.rows[f"{_PREFIX}{name}{_POSITION}"])
            force = motion.rows[f"{_PREFIX}{name}{_FORCE}"]
            arrow = _WEIGHT_LENGTH * size / weight * force
            radius = _RADIUS * size
            yield from arrow_tracks(f"{path}/force", times, position, arrow, radius)
            yield Track(f"{path}/point", "position", times, position)
            # An arrow without force is hidden.
            touches = np.linalg.norm(force, axis=1) > 0.0
            yield Track(
                f"{path}/point", "visible", times, touches.astype(float)[:, None]
            )

    def legend() -> list[LegendEntry]:
        return [LegendEntry("contact force", WARNING, (root,))] if names else []

    return Layer(draw, tracks, legend)


def _held(positions: Array) -> Array:
    """Return positions; those with NaN, of inactive contacts, stay the last ones."""
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    if not known.size:
        return np.zeros_like(positions)
    latest = np.searchsorted(known, np.arange(len(positions)), side="right") - 1
    return np.asarray(positions[known[np.maximum(latest, 0)]])


# -- self-motion ----------------------------------------------------------------------

SECONDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""An arrow shows a joint's motion during one of these times [s]."""
_TYPICAL_LENGTH = 0.22
"""Maximum length of a fast arrow, over the robot's size; it chooses the time."""
_MAX_ARROWS = 4
_MIN_SPACING = 0.06  # minimum distance of two joints with arrows, over the robot's size
_MIN_SPEED = 0.1
"""Minimum mean speed of a joint with an arrow, over that of the fastest joint."""
_MAX_LENGTH = 0.6  # maximum length of an arrow, over the robot's size
_WIDENING = 2.2  # radius of a field arrow over that of a velocity arrow
_FIELD_OPACITY = 0.4


@dataclass
class SelfMotionLayer(Layer):
    """Arrows at the joints that self-motion moves most.

    Attributes:
        seconds: An arrow is the motion in this time [s]; compared runs share it.
    """

    seconds: float = 1.0


def self_motion(
    controller: Controller, motion: RunMotion, root: str
) -> SelfMotionLayer:
    """Draw two arrows at the joints that self-motion moves most, such as the elbow.

    Thin: the null-space velocity P v. Wide and pale: the projected field P g.
    """
    size, model = motion.size, controller.robot.model
    radius, controls = _RADIUS * size, controller.field.controls
    rates = lru_cache(maxsize=1)(partial(_joint_rates, controller))
    positions, *both = rates(motion)
    speeds = np.maximum(*(np.linalg.norm(each, axis=2) for each in both))
    joints = _select_joints(positions, speeds.mean(axis=0), _MIN_SPACING * size)
    fast = float(np.quantile(speeds.max(axis=1), 0.9))
    fitting = [s for s in SECONDS if s * fast <= _TYPICAL_LENGTH * size]

    def node(kind: str, joint: int) -> str:
        return f"{root}/{kind}/{path_element(model.names[joint])}"

    def draw(_: float) -> Iterator[PageCommand]:
        for joint in joints:
            surface = threejs.always_visible(threejs.material(FIELD, glow=0.5))
            yield set_object(node("velocity", joint), unit_arrow(surface, radius))
            if controls:
                pale = threejs.material(FIELD, opacity=_FIELD_OPACITY, glow=0.5)
                wide = unit_arrow(threejs.always_visible(pale), _WIDENING * radius)
                yield set_object(node("field", joint), wide)

    def tracks(motion: RunMotion) -> Iterator[Track]:
        positions, velocities, fields = rates(motion)
        kinds = [("velocity", velocities, radius)]
        if controls:
            kinds.append(("field", fields, _WIDENING * radius))
        for joint in joints:
            k = joint - 1  # the universe joint has no column
            for kind, speeds, width in kinds:
                arrows = _shortened(layer.seconds * speeds[:, k], _MAX_LENGTH * size)
                path, origins = node(kind, joint), positions[:, k]
                yield from arrow_tracks(path, motion.times, origins, arrows, width)

    def legend() -> list[LegendEntry]:
        name = f"self-motion in {layer.seconds:g} s (pale: the field's)"
        return [LegendEntry(name, FIELD, (root,))] if joints else []

    layer = SelfMotionLayer(draw, tracks, legend, max(fitting, default=SECONDS[0]))
    return layer


def _joint_rates(
    controller: Controller, motion: RunMotion
) -> tuple[Array, Array, Array]:
    """Return positions, P v and P g of the joints, shapes (N, njoints - 1, 3)."""
    controller = controller.preview()
    data = controller.robot.model.createData()
    rows: list[tuple[Array, Array, Array]] = []
    for state, g in zip(motion.states(), motion.rows["field.g"], strict=True):
        P = null_space_projector(controller, state)
        positions = np.array([pose.translation for pose in state.data.oMi])
        velocities = _joint_velocities(state, P @ state.v, data)
        fields = _joint_velocities(state, P @ g, data)
        rows.append((positions[1:], velocities[1:], fields[1:]))
    positions, velocities, fields = map(np.array, zip(*rows, strict=True))
    return positions, velocities, fields


def _joint_velocities(state: RobotState, v: Array, data: pin.Data) -> Array:
    """Return the joints' linear velocities [m/s], shape (njoints, 3)."""
    model = state.robot.model
    pin.forwardKinematics(model, data, state.q, v)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    velocities: Array = np.empty((model.njoints, 3))
    for joint in range(model.njoints):
        velocities[joint] = pin.getVelocity(model, data, joint, axes).linear
    return velocities


def _select_joints(positions: Array, speeds: Array, spacing: float) -> list[int]:
    """Return the indices of the fastest joints that keep a mutual distance."""
    joints: list[int] = []
    for k in np.argsort(-speeds):
        if len(joints) == _MAX_ARROWS or speeds[k] <= _MIN_SPEED * speeds.max():
            break
        distances = [
            np.linalg.norm(positions[:, k] - positions[:, other], axis=1).mean()
            for other in joints
        ]
        if all(distance > spacing for distance in distances):
            joints.append(int(k))
    return sorted(joint + 1 for joint in joints)


def _shortened(vectors: Array, longest: float) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors * np.minimum(1.0, longest / np.maximum(lengths, 1e-12)))


# -- the manipulability ellipsoid (Yoshikawa 1985): the hand's speed per direction ----

ELLIPSOID_SECONDS = 0.2
"""A semi-axis is the hand's travel in this time at a joint speed of norm 1 [s]."""
_THINNEST = 0.02
"""Minimum semi-axis, over the longest: a flat ellipsoid is drawn as a disk."""
_ELLIPSOID_OPACITY = 0.3


def ellipsoid(robot: Robot, controller: Controller | None, root: str) -> Layer:
    """Draw the image {J v : |v| = 1} of unit joint velocities, at the tasks' frames."""
    tasks = controller.tasks if controller else ()
    named = (getattr(task, "frame", None) for task in tasks)
    frames = dict.fromkeys(frame for frame in named if frame) or [robot.end_effector]
    paths = {frame: f"{root}/{path_element(frame)}" for frame in frames}

    def draw(_: float) -> Iterator[PageCommand]:
        for path in paths.values():
            surface = threejs.material(TASK, opacity=_ELLIPSOID_OPACITY, glow=0.4)
            ball = threejs.mesh_group(threejs.sphere(1.0), surface, shadow=False)
            yield set_object(path, ball)

    def tracks(motion: RunMotion) -> Iterator[Track]:
        for frame, path in paths.items():
            places, turns, axes, last = [], [], [], np.eye(3)
            for state in motion.states():
                kinematics = state.frame(frame)
                places.append(np.array(kinematics.position))
                last, lengths = principal_axes(kinematics.jacobian[:3], last)
                turns.append(pin.Quaternion(last).coeffs())
                axes.append(np.maximum(lengths, _THINNEST * lengths.max()))
            yield Track(path, "position", motion.times, np.array(places))
            yield Track(path, "quaternion", motion.times, np.array(turns))
            yield Track(path, "scale", motion.times, ELLIPSOID_SECONDS * np.array(axes))

    def legend() -> list[LegendEntry]:
        color = translucent(TASK, 2.0 * _ELLIPSOID_OPACITY)
        return [LegendEntry("manipulability", color, tuple(paths.values()))]

    return Layer(draw, tracks, legend)


def principal_axes(J: Array, last: Array) -> tuple[Array, Array]:
    """Return the axes of {J v : |v| = 1}, nearest to ``last``, and semi-axes."""
    axes, lengths, _ = np.linalg.svd(J)
    padded = np.zeros(3)
    padded[: len(lengths)] = lengths
    overlap = last.T @ axes
    orders = [list(order) for order in permutations(range(3))]
    order = max(orders, key=lambda o: float(np.abs(overlap[range(3), o]).sum()))
    axes = axes[:, order] * np.where(overlap[range(3), order] < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return axes, padded[order]
