"""A foot of a walking robot: its sole, its place, its references and its switches."""

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import PlanError
from hsp_control.companions.walking.contact_switch import Switch, Switched
from hsp_control.companions.walking.footsteps import Footstep, near
from hsp_control.companions.walking.planned_references import Fed, FedOrientation
from hsp_control.companions.walking.polygon import convex_hull
from hsp_control.companions.walking.swing import Swing, turned
from hsp_control.constraints.contacts import SurfaceContact
from hsp_control.control.interface import Controller
from hsp_control.robot import RobotState
from hsp_control.trajectories import ComposedPose

SLOPE = 0.02
"""Slope below which the ground is level: the tilt of a flat sole [-]."""
FLATNESS = 0.05
"""Largest angle between a sole and the ground at the start [rad]."""


class Foot(Switched):
    """A foot with a flat sole.

    Its `Footstep` is the middle of its sole and the yaw of its frame.

    Attributes:
        name: The name of its contact and of its task.
        frame: Its frame.
        normal: The normal of the ground, shape (3,) [-].
        swing: The motion of its references until it rests; None: its present place.
        position: The reference of the frame's origin.
        orientation: The reference of its orientation.
        place: Its present or last footstep.
        height: The height of its sole there [m].
        frame_height: The height of its frame's origin there [m].
    """

    def __init__(self, name: str, controller: Controller) -> None:
        """Find its parts in a controller."""
        self.name = name
        contact = {each.name: each for each in controller.contacts}[name]
        task = {each.name: each for each in controller.tasks}[name]
        pose = task.followed
        if not (
            isinstance(contact, SurfaceContact)
            and isinstance(contact.schedule, Switch)
            and isinstance(task.schedule, Switch)
            and isinstance(pose, ComposedPose)
            and isinstance(pose.position, Fed)
            and isinstance(pose.orientation, FedOrientation)
        ):
            raise PlanError(
                f"the foot {name!r} does not follow the plan: build the controller "
                "from the plan's parts"
            )
        self.frame, self.normal = contact.frame, contact.axes[:, 2]
        self.contact, self.task = contact.schedule, task.schedule
        self.position, self.orientation = pose.position, pose.orientation
        self._points: Array = contact.points

    def begin(self, state: RobotState, heading: float) -> None:
        """Stand at the robot's present pose."""
        self.reset()
        self.swing: Swing | None = None
        here = state.frame(self.frame)
        corners = here.position + self._points @ here.rotation.T
        spread = np.ptp(corners @ self.normal)
        size = float(np.ptp(self._points, axis=0).max())
        if abs(self.normal[2]) < 1.0 - 1e-9 or spread > FLATNESS * size:
            raise PlanError(
                f"the sole of {self.name!r} does not lie on flat ground at the start: "
                f"its corners differ in height by {1000.0 * spread:.0f} mm"
            )
        if abs(here.rotation[2, 0]) > FLATNESS:
            raise PlanError(
                f"the x axis of {self.frame!r} does not point along the ground, so "
                "that it has no direction to walk; choose another frame for the contact"
            )
        self._rotation = here.rotation.copy()
        yaw = float(np.arctan2(here.rotation[1, 0], here.rotation[0, 0]))
        self._yaw = self._last_yaw = near(yaw, heading)
        # The sole's own axes: x forward, in the ground.
        local = self._points @ turned(-self._yaw, here.rotation).T
        self._middle: Array = local[:, :2].mean(axis=0)
        self._corners: Array = local[:, :2] - self._middle
        self.reach: Array = np.abs(self._corners).max(axis=0)
        self.stand(state)

    @property
    def sole_width(self) -> float:
        """The width of the sole [m]."""
        return float(np.ptp(self._corners[:, 1]))

    def follow(self, state: RobotState) -> None:
        """Write its references: its swing, or its present place."""
        t, here = state.t, state.frame(self.frame)
        if self.rests(t):
            self.swing = None
        if self.swing is None:
            self.position.write(t, here.position)
            self.orientation.write(t, here.rotation)
        else:
            self.position.write(t, *self.swing.position(t))
            self.orientation.write(t, *self.swing.orientation(t))

    def stand(self, state: RobotState) -> None:
        """Set the foot's present place as its footstep."""
        here = state.frame(self.frame)
        yaw = float(np.arctan2(here.rotation[1, 0], here.rotation[0, 0]))
        self._last_yaw = near(yaw, self._last_yaw)  # several turns may have been made
        x, y = map(float, here.position[:2])
        origin = Footstep(x, y, self._last_yaw)
        self.place = self.place_of(origin)
        self.frame_height = float(here.position[2])
        self.height = self.sole_height(state)

    def sole_height(self, state: RobotState) -> float:
        """Return the height of the middle of its sole [m]."""
        here = state.frame(self.frame)
        corners = here.position + self._points @ here.rotation.T
        return float(corners[:, 2].mean())

    def ground(self, state: RobotState) -> tuple[Array, float, Array]:
        """Return the ground's tilt, the foot's height, and the ground's slope.

        The tilt is a rotation from the level, shape (3, 3); the height is that of the
        frame's origin [m]; the slope is the ground's gradient, shape (2,) [-]. Nearly
        level ground is treated as level, and the height is that at touchdown.
        """
        here = state.frame(self.frame)
        normal = here.rotation @ self.flat(self.place.yaw)[2]
        slope = -normal[:2] / normal[2]
        if np.hypot(*slope) < SLOPE:
            return np.eye(3), self.frame_height, np.zeros(2)
        axis = np.array([-normal[1], normal[0], 0.0])
        angle = np.arccos(min(float(normal[2]), 1.0)) / np.linalg.norm(axis)
        return pin.exp3(angle * axis), float(here.position[2]), slope

    def place_of(self, origin: Footstep) -> Footstep:
        """Return the footstep for a position of the frame's origin."""
        return origin.ahead(float(self._middle[0]), float(self._middle[1]))

    def origin_of(self, place: Footstep) -> Footstep:
        """Return the position of the frame's origin at a footstep."""
        return place.ahead(-float(self._middle[0]), -float(self._middle[1]))

    def flat(self, yaw: float) -> Array:
        """Return its orientation at a footstep of some yaw, shape (3, 3)."""
        return turned(yaw - self._yaw, self._rotation)

    def corners(self, share: float) -> Array:
        """Return the corners of a share of its sole on the ground, shape (m, 2) [m]."""
        scaled = share * self._corners
        return convex_hull(np.array([self.place.world(each) for each in scaled]))
