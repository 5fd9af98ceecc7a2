"""Arrows of contact forces and of self-motion, and the manipulability ellipsoid."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot, RobotState
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.analysis import (
    from_the_start,
    null_space_projector,
)
from hsp_control.visualization.viewer.appearance import (
    ARROW_RADIUS,
    CONTACT,
    ELLIPSOID,
    ELLIPSOID_OPACITY,
    FIELD,
    FIELD_OPACITY,
    LegendEntry,
    translucent,
)
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    path_element,
    set_object,
)
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.threejs import (
    always_visible,
    material,
    quaternions_along,
)

_FULL_WIDTH = 12.0  # length over radius from which an arrow has its full radius


def unit_arrow(surface: Json, radius: float) -> Json:
    """Return an arrow along z of length 1 with the given shaft radius [m]."""
    profile = np.array([(0, 0), (1, 0), (1, 0.72), (2.5, 0.72), (0, 1)])
    thing = threejs.mesh(threejs.lathe(profile * [radius, 1.0]), surface, shadow=False)
    thing["object"]["renderOrder"] = (
        1  # draw it after the objects that it is seen through
    )
    return threejs.group([thing])


def unit_bar(surface: Json, radius: float) -> Json:
    """Return a bar along z of length 1 with the given radius [m]."""
    solid = threejs.lathe(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [radius, 1.0])
    return threejs.group([threejs.mesh(solid, surface, shadow=False)])


def arrow_tracks(
    path: str, times: Array, origins: Array, vectors: Array, radius: float
) -> Iterator[Track]:
    """Yield the tracks that turn a unit arrow into vectors; short ones are thinner."""
    lengths = np.linalg.norm(vectors, axis=1)
    widths = np.minimum(lengths / (_FULL_WIDTH * radius), 1.0)
    yield from _tracks(path, times, origins, vectors, np.c_[widths, widths, lengths])


def bar_tracks(
    path: str, times: Array, starts: Array, ends: Array, shown: Array
) -> Iterator[Track]:
    """Yield the tracks with which a unit bar connects two points."""
    vectors = ends - starts
    ones = np.ones(len(times))
    scales = np.c_[ones, ones, np.linalg.norm(vectors, axis=1)]
    yield from _tracks(path, times, starts, vectors, scales)
    yield Track(path, "visible", times, np.asarray(shown, float)[:, None])


def _tracks(
    path: str, times: Array, origins: Array, vectors: Array, scales: Array
) -> Iterator[Track]:
    yield Track(path, "position", times, origins)
    yield Track(path, "quaternion", times, quaternions_along(vectors))
    yield Track(path, "scale", times, scales)


_PREFIX, _FORCE, _POSITION = "contact.", ".force", ".position"
_WEIGHT_LENGTH = 0.5
"""Length of an arrow that shows the robot's weight, over the robot's size."""
_GRAVITY = 9.81  # m/s²


class Contacts:
    """Contact forces, from the columns ``contact.<name>.position`` and ``.force``."""

    def __init__(self, robot: Robot, motion: Motion, root: str) -> None:
        """Find the contacts."""
        self._root = root
        self._weight = _GRAVITY * sum(inertia.mass for inertia in robot.model.inertias)
        self._size = motion.size
        columns = motion.rows.columns
        self._names = [
            name
            for column in columns
            if column.startswith(_PREFIX) and column.endswith(_FORCE)
            for name in [column[len(_PREFIX) : -len(_FORCE)]]
            if f"{_PREFIX}{name}{_POSITION}" in columns
        ]

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name in self._names:
            # Contacts lie inside the legs' meshes.
            surface = always_visible(material(CONTACT, glow=0.5))
            arrow = unit_arrow(surface, ARROW_RADIUS * self._size)
            yield set_object(self._path(name, "force"), arrow)
            ball = threejs.sphere(1.5 * ARROW_RADIUS * self._size)
            yield set_object(
                self._path(name, "point"), threejs.group([threejs.mesh(ball, surface)])
            )

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run; a contact without force is hidden."""
        times = motion.times
        for name in self._names:
            position = _held(motion.rows[f"{_PREFIX}{name}{_POSITION}"])
            force = motion.rows[f"{_PREFIX}{name}{_FORCE}"]
            arrows = _WEIGHT_LENGTH * self._size / self._weight * force
            radius = ARROW_RADIUS * self._size
            path = self._path(name, "force")
            yield from arrow_tracks(path, times, position, arrows, radius)
            touches = np.linalg.norm(force, axis=1) > 0.0
            yield Track(self._path(name, "point"), "position", times, position)
            shown = touches.astype(float)[:, None]
            yield Track(self._path(name, "point"), "visible", times, shown)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        name = LegendEntry("contact force", CONTACT, (self._root,))
        return [name] if self._names else []

    def _path(self, name: str, kind: str) -> str:
        return f"{self._root}/{path_element(name)}/{kind}"


def _held(positions: Array) -> Array:
    """Return positions; those with NaN, of inactive contacts, stay the last ones."""
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    if not known.size:
        return np.zeros_like(positions)
    latest = np.searchsorted(known, np.arange(len(positions)), side="right") - 1
    return np.asarray(positions[known[np.maximum(latest, 0)]])


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


class SelfMotion:
    """Two arrows at the joints that self-motion moves most, such as the elbow.

    Thin: the null-space velocity P v. Wide and pale: the projected field P g.
    """

    def __init__(self, controller: Controller, motion: Motion, root: str) -> None:
        """Choose the joints that self-motion moves most, at distinct positions."""
        self._root = root
        self._controller = controller
        self._radius = ARROW_RADIUS * motion.size
        self._longest = _MAX_LENGTH * motion.size
        self._speeds = IdentityCache(self._velocities)
        positions, velocities, fields = self._speeds.get(motion)
        size = motion.size
        speeds = np.maximum(
            *(np.linalg.norm(each, axis=2) for each in (velocities, fields))
        )
        self._joints = _select_joints(
            positions, speeds.mean(axis=0), _MIN_SPACING * size
        )
        fast = float(np.quantile(speeds.max(axis=1), 0.9))
        fitting = [s for s in SECONDS if s * fast <= _TYPICAL_LENGTH * size]
        self.seconds = max(fitting, default=SECONDS[0])

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for joint in self._joints:
            surface = always_visible(material(FIELD, glow=0.5))
            thin = unit_arrow(surface, self._radius)
            yield set_object(self._path("velocity", joint), thin)
            if self._controller.field.controls:
                pale = always_visible(material(FIELD, opacity=FIELD_OPACITY, glow=0.5))
                wide = unit_arrow(pale, _WIDENING * self._radius)
                yield set_object(self._path("field", joint), wide)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        positions, velocities, fields = self._speeds.get(motion)
        arrows = [("velocity", velocities, self._radius)]
        if self._controller.field.controls:
            arrows.append(("field", fields, _WIDENING * self._radius))
        for joint in self._joints:
            k = joint - 1  # the universe joint has no column
            for kind, speeds, radius in arrows:
                yield from arrow_tracks(
                    self._path(kind, joint),
                    motion.times,
                    positions[:, k],
                    self._shortened(self.seconds * speeds[:, k]),
                    radius,
                )

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        if not self._joints:
            return []
        name = f"self-motion in {self.seconds:g} s (pale: the field's)"
        return [LegendEntry(name, FIELD, (self._root,))]

    def _velocities(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Return positions, P v and P g of the joints, (N, njoints - 1, 3) each."""
        controller = from_the_start(self._controller)
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

    def _shortened(self, vectors: Array) -> Array:
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        shares = np.minimum(1.0, self._longest / np.maximum(lengths, 1e-12))
        return np.asarray(vectors * shares)

    def _path(self, kind: str, joint: int) -> str:
        name = self._controller.robot.model.names[joint]
        return f"{self._root}/{kind}/{path_element(name)}"


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
    """Return the indices of the fastest joints that keep a distance from each other."""
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


ELLIPSOID_SECONDS = 0.2
"""A semi-axis is the hand's travel in this time at a joint speed of norm 1 [s]."""
_THINNEST = 0.02
"""Minimum semi-axis, over the longest: a flat ellipsoid is drawn as a disk."""


class Ellipsoid:
    """The image {J v : |v| = 1} of unit joint velocities, at each task's frame."""

    def __init__(self, robot: Robot, controller: Controller | None, root: str) -> None:
        """Find the frames: those of the tasks, or else the robot's end effector."""
        self._root = root
        tasks = controller.tasks if controller else ()
        named = (getattr(task, "frame", None) for task in tasks)
        frames = dict.fromkeys(frame for frame in named if frame)
        self._frames = tuple(frames) or (robot.end_effector,)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for frame in self._frames:
            surface = material(ELLIPSOID, opacity=ELLIPSOID_OPACITY, glow=0.4)
            ball = threejs.mesh(threejs.sphere(1.0), surface, shadow=False)
            yield set_object(self._path(frame), threejs.group([ball]))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        rows = len(motion.times)
        for frame in self._frames:
            places, turns, axes = np.empty((rows, 3)), np.empty((rows, 4)), []
            last = np.eye(3)
            for row, state in enumerate(motion.states()):
                kinematics = state.frame(frame)
                places[row] = kinematics.position
                last, lengths = principal_axes(kinematics.jacobian[:3], last)
                turns[row] = pin.Quaternion(last).coeffs()
                axes.append(np.maximum(lengths, _THINNEST * lengths.max()))
            path = self._path(frame)
            yield Track(path, "position", motion.times, places)
            yield Track(path, "quaternion", motion.times, turns)
            yield Track(path, "scale", motion.times, ELLIPSOID_SECONDS * np.array(axes))

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        paths = tuple(map(self._path, self._frames))
        color = translucent(ELLIPSOID, 2.0 * ELLIPSOID_OPACITY)
        return [LegendEntry("manipulability", color, paths)]

    def _path(self, frame: str) -> str:
        return f"{self._root}/{path_element(frame)}"


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
