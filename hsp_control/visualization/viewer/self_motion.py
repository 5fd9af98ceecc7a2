"""Self-motion: arrows of null-space velocity P v and projected field P g."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.control.controller import Controller
from hsp_control.robot import RobotState
from hsp_control.visualization.viewer.appearance import (
    ARROW_RADIUS,
    FIELD,
    FIELD_OPACITY,
)
from hsp_control.visualization.viewer.arrows import arrow_tracks, unit_arrow
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, set_object
from hsp_control.visualization.viewer.controller_analysis import (
    from_the_start,
    null_space_projector,
)
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.materials import always_visible, material
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.scene_path import path_element

SECONDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""An arrow shows a joint's motion during one of these times [s]."""
_TYPICAL_LENGTH = 0.22
"""Maximum length of a fast arrow, over the robot's size; it chooses the time."""
_MAX_ARROWS = 4
_MIN_SPACING = 0.06
"""Minimum distance of two joints with arrows, over the robot's size."""
_MIN_SPEED = 0.1
"""Minimum mean speed of a joint with an arrow, over that of the fastest joint."""
_MAX_LENGTH = 0.6
"""Maximum length of an arrow, over the robot's size."""
_WIDENING = 2.2
"""Radius of a field arrow over that of a velocity arrow."""


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
    """Return the indices of the fastest joints that keep a distance from each other.

    Shapes: positions (N, njoints - 1, 3) [m], speeds (njoints - 1,) [m/s].
    """
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
