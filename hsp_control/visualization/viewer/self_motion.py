"""Self-motion: where the null-space velocity takes the joints, and where g would."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
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
from hsp_control.visualization.viewer.element import element
from hsp_control.visualization.viewer.explained import null_space_projector
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.surfaces import material, seen_through

SECONDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""An arrow leads to where a joint would be after one of these times [s]."""
_USUAL = 0.22
"""Of a quick arrow, over the robot's size: the longest time that stays below."""
_MOST = 4
_APART = 0.06
"""Joints that are nearer to each other, over the robot's size, share an arrow."""
_WORTH = 0.1
"""What a joint must move, over what the quickest does, to be given an arrow."""
_LONGEST = 0.6
"""Of an arrow, over the robot's size."""
_WIDENING = 2.2


class SelfMotion:
    """Two arrows at the joints that self-motion moves most, as an elbow.

    The slender one is the velocity P v, the wide and pale one about it the projected
    field P g, to which the law makes the velocity converge: it slips into it.
    """

    def __init__(self, controller: Controller, motion: Motion, root: str) -> None:
        """Choose joints that move most along the run, and are not all in a place."""
        self._root = root
        self._controller = controller
        self._radius = ARROW_RADIUS * motion.size
        self._longest = _LONGEST * motion.size
        places, moves, wants = self._measured(motion)
        self._last = motion, (places, moves, wants)
        size = motion.size
        speeds = np.maximum(*(np.linalg.norm(each, axis=2) for each in (moves, wants)))
        self._joints = _chosen(places, speeds.mean(axis=0), _APART * size)
        quick = float(np.quantile(speeds.max(axis=1), 0.9))
        fitting = [s for s in SECONDS if s * quick <= _USUAL * size]
        self.seconds = max(fitting, default=SECONDS[0])

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""
        for joint in self._joints:
            surface = seen_through(material(FIELD, glow=0.5))
            slender = unit_arrow(surface, self._radius)
            yield set_object(self._path("velocity", joint), slender)
            if self._controller.field.controls:
                pale = seen_through(material(FIELD, opacity=FIELD_OPACITY, glow=0.5))
                wide = unit_arrow(pale, _WIDENING * self._radius)
                yield set_object(self._path("field", joint), wide)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield how it moves along the run."""
        if self._last[0] is not motion:
            self._last = motion, self._measured(motion)
        places, moves, wants = self._last[1]
        arrows = [("velocity", moves, self._radius)]
        if self._controller.field.controls:
            arrows.append(("field", wants, _WIDENING * self._radius))
        for joint in self._joints:
            k = joint - 1  # the world has no row
            for kind, speeds, radius in arrows:
                yield from arrow_tracks(
                    self._path(kind, joint),
                    motion.times,
                    places[:, k],
                    self._shortened(self.seconds * speeds[:, k]),
                    radius,
                )

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        if not self._joints:
            return []
        return [(f"self-motion in {self.seconds:g} s, within the field's", FIELD)]

    def _measured(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Return places [m], velocities of P v and P g [m/s], each (N, joints, 3)."""
        data = self._controller.robot.model.createData()
        rows: list[tuple[Array, Array, Array]] = []
        for state, g in zip(motion.states(), motion.rows["field.g"], strict=True):
            P = null_space_projector(self._controller, state)
            places = np.array([place.translation for place in state.data.oMi])
            moves = _joint_velocities(state, P @ state.v, data)
            wants = _joint_velocities(state, P @ g, data)
            rows.append((places[1:], moves[1:], wants[1:]))
        places, moves, wants = map(np.array, zip(*rows, strict=True))
        return places, moves, wants

    def _shortened(self, vectors: Array) -> Array:
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        shares = np.minimum(1.0, self._longest / np.maximum(lengths, 1e-12))
        return np.asarray(vectors * shares)

    def _path(self, kind: str, joint: int) -> str:
        name = self._controller.robot.model.names[joint]
        return f"{self._root}/{kind}/{element(name)}"


def _joint_velocities(state: RobotState, v: Array, data: pin.Data) -> Array:
    """Return the joints' linear velocities [m/s], shape (njoints, 3)."""
    model = state.robot.model
    pin.forwardKinematics(model, data, state.q, v)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    velocities: Array = np.empty((model.njoints, 3))
    for joint in range(model.njoints):
        velocities[joint] = pin.getVelocity(model, data, joint, axes).linear
    return velocities


def _chosen(places: Array, speeds: Array, apart: float) -> list[int]:
    """Return the indices of joints: the quickest, and not nearer together than told.

    Args:
        places: Of all joints but the world [m], shape (N, joints, 3).
        speeds: Their mean speeds [m/s], shape (joints,).
        apart: Least mean distance of two [m].
    """
    joints: list[int] = []
    for k in np.argsort(-speeds):
        if len(joints) == _MOST or speeds[k] <= _WORTH * speeds.max():
            break
        away = [
            np.linalg.norm(places[:, k] - places[:, other], axis=1).mean()
            for other in joints
        ]
        if all(distance > apart for distance in away):
            joints.append(int(k))
    return sorted(joint + 1 for joint in joints)
