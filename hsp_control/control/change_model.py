"""The changes of a robot's model: its payloads, its tools, and gravity."""

from dataclasses import replace
from typing import Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError
from hsp_control.control.change import Change
from hsp_control.control.evolution import ABSENT
from hsp_control.control.model_in_force import CarriedBody, PlannedPayload
from hsp_control.control.setup import Setup
from hsp_control.control.tools_in_force import PlannedTool
from hsp_control.declaration import within
from hsp_control.declaration.quantities import NonNegative, Semidefinite, Vector3
from hsp_control.declaration.rotation import Rotation
from hsp_control.geometry.scene import Start
from hsp_control.robot import Robot
from hsp_control.trajectories import PoseTrajectory, crossfade
from hsp_control.trajectories.pose import HoldPose

MOST_GRAVITY = 300.0
"""Largest gravity, ten times that of Jupiter: more is in other units [m/s²]."""
_ROUNDING = 1e-9
"""Of moments of inertia, relative: typed values have rounding errors."""


class ChangePayload(Change, type="payload"):
    """A frame takes up a payload, or puts it down; the law is that of the model.

    It replaces the frame's previous payload. Simulated rigid bodies carry it, too,
    in addition to errors of their own masses.
    """

    frame: str
    """Name of the frame that the payload is fixed to."""
    mass: NonNegative
    """Mass [kg]; 0: it carries nothing from then on."""
    center: Vector3 = (0.0, 0.0, 0.0)
    """Centre of mass in the frame [m]."""
    inertia: Semidefinite = 0.0
    """Moments of inertia about the centre [kg·m²]: a number, three about the frame's
    axes, or a symmetric matrix; 0: a point mass."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change, checked where the robot is."""
        self._body(start.state.robot)
        return self

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the payload; see `Change.apply`."""
        before = [
            replace(each, share=each.share.then(self.at, self.ramp, 0.0))
            if each.frame == self.frame
            else each
            for each in setup.payloads
        ]
        body = self._body(setup.start.state.robot)
        share = ABSENT.then(self.at, self.ramp, 1.0)
        new = [PlannedPayload(self.frame, body, share)] if self.mass else []
        return replace(setup, payloads=(*before, *new))

    def _body(self, robot: Robot) -> CarriedBody:
        """Return the payload in the axes of the joint that carries it."""
        with within("frame"):
            frame = robot.model.frames[robot.frame_id(self.frame)]
            if frame.parentJoint == 0:
                raise ControllerError(
                    f"{self.frame!r} is fixed to the world, where a payload has no "
                    "effect; give a frame of a moving link"
                )
        center, inertia = np.zeros(3), np.zeros((3, 3))
        engine.BodyInJoint(
            rotation=np.ascontiguousarray(frame.placement.rotation),
            position=frame.placement.translation.copy(),
            center=np.asarray(self.center, dtype=float),
            inertia=np.ascontiguousarray(self._moments()),
            center_out=center,
            inertia_out=inertia,
        )()
        moved = tuple(center.tolist()), tuple(inertia.ravel().tolist())
        return CarriedBody(int(frame.parentJoint), float(self.mass), *moved)

    def _moments(self) -> Array:
        """Return the inertia about the centre, in the frame's axes, (3, 3)."""
        given = np.asarray(self.inertia, dtype=float)
        with within("inertia"):
            if given.shape not in {(), (3,), (3, 3)}:
                raise ControllerError(
                    f"has shape {given.shape}; needs a number, 3 numbers or a 3 × 3 "
                    "matrix"
                )
            moments = given if given.ndim == 2 else np.diag(np.resize(given, 3))
            if not np.allclose(moments, moments.T, rtol=_ROUNDING, atol=0.0):
                raise ControllerError(f"is {given.tolist()}; must be symmetric")
            principal = np.linalg.eigvalsh(moments)
            least = principal[0] + principal[1] - principal[2]
            rounding = _ROUNDING * principal[2]
            if principal[0] < -rounding or least < -rounding:
                shown = ", ".join(f"{each:.3g}" for each in principal)
                raise ControllerError(
                    f"has the principal moments {shown} kg m²; none may be negative, "
                    "nor greater than the sum of the others"
                )
            if self.mass == 0.0 and principal[2] > 0.0:
                raise ControllerError("is not 0, but the mass is; give the mass")
        return moments


class ChangeTool(Change, type="tool"):
    """A frame goes elsewhere in its link, as when a tool is taken up or put down.

    All tasks and fields of the frame follow it: their errors obey their equations while
    it moves, and the hand moves so that the new tip goes where the old one was to be.
    Capsules, the payload and all else fixed to the link stay.
    """

    frame: str
    """Name of the frame, such as that of the hand."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Where it goes, in its axes as the model has it [m]: the tip of the tool."""
    rotation: Rotation = (0.0, 0.0, 0.0)
    """Its orientation there: roll, pitch and yaw [rad], a quaternion or a matrix."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change, checked where the robot is."""
        with within("frame"):
            start.state.robot.frame_id(self.frame)
            for each in setup.contacts:
                if self.frame == each.contact.frame:
                    raise ControllerError(
                        f"{self.frame!r} is the frame of contact {each.contact.name!r},"
                        " which does not move in its link; give the tool another frame"
                    )
        return self

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the tool; see `Change.apply`."""
        there = {each.frame: each.placement for each in setup.tools}
        old = there.get(self.frame, _AS_IN_THE_MODEL)
        new = HoldPose(self.position, self.rotation)
        placement = crossfade(old, new, start_time=self.at, duration=self.ramp)
        assert isinstance(placement, PoseTrajectory)
        others = (each for each in setup.tools if each.frame != self.frame)
        return replace(setup, tools=(*others, PlannedTool(self.frame, placement)))


_AS_IN_THE_MODEL = HoldPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class ChangeGravity(Change, type="gravity"):
    """Gravity changes, as on a base that is tilted; the law is that of the model."""

    gravity: Vector3
    """Gravity in the world [m/s²], such as [0, 0, -9.81]."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the gravity; see `Change.apply`."""
        target = np.asarray(self.gravity, dtype=float)
        with within("gravity"):
            if np.linalg.norm(target) > MOST_GRAVITY:
                raise ControllerError(
                    f"{target.tolist()} is {np.linalg.norm(target):.3g} m/s²; at most "
                    f"{MOST_GRAVITY:g}"
                )
        gravity = setup.gravity.then(self.at, self.ramp, target)
        return replace(setup, gravity=gravity)
