"""Where a run begins: configuration and velocity at t = 0."""

from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigurationError, ContactError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.controller import Controller
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    READ_ONLY,
    ArrayField,
    Name,
    Number,
    Vector,
    Vector3,
)
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.geometry.good_postures import PostureSearch, Rows
from hsp_control.geometry.scene import Scene
from hsp_control.robot import Robot
from hsp_control.robot.inverse_kinematics import Target
from hsp_control.tasks import FrameOrientation, FramePose, FramePosition, Task
from hsp_control.tasks.frame_position import axis_indices
from hsp_control.tasks.frame_task import frame_of


class StartPose(Part, error=ConfigurationError):
    """Placement of a frame at the start; inverse kinematics finds the joints."""

    _: KW_ONLY
    frame: Name | None = None
    """Name of the frame; the robot's end effector by default."""
    position: Vector3
    """Its origin in the world [m]."""
    rotation: Rotation | None = None
    """Its orientation in the world: roll, pitch and yaw [rad], a quaternion
    (x, y, z, w) [-], or a matrix [-]; any by default."""

    def target(self, robot: Robot) -> Target:
        """Return the target of the inverse kinematics.

        Raises:
            FrameNotFoundError: If there is no such frame.
        """
        place = pin.SE3.Identity()
        place.translation = self.position
        if self.rotation is not None:
            place.rotation = matrix_of(self.rotation)
        rows = 3 if self.rotation is None else 6
        return Target(frame_of(self.frame, robot), place, rows)


class InitialState(Part, error=ConfigurationError):
    """The start: one of joints, coordinates, configuration and pose; home by default.

    ``joints: auto``, in YAML also ``start: auto``, and ``pose`` are found: regular for
    the tasks, within limits, clear of collisions and near the middle of the limits. The
    search is deterministic, and the log has its result.
    """

    joints: (
        Literal["auto"] | Vector | Annotated[Mapping[str, Number], READ_ONLY] | None
    ) = None
    """Joint positions [rad or m]: nv numbers, some by name with the others at home, or
    ``auto``."""
    coordinates: Vector | None = None
    """Joint coordinates theta = A q [rad or m], where the robot's source defines A."""
    configuration: Vector | None = None
    """The configuration, nq numbers [rad, m, or unit quaternions]."""
    pose: StartPose | None = None
    """Where a frame is, for a robot with a fixed base."""
    ground: Number | None = None
    """Height of the lowest contact [m]; a free-flyer root is moved up or down to it."""
    velocity: Literal["rest", "flow"] | Vector = "rest"
    """Velocity: ``rest``, ``flow`` (that of the law without errors), or nv numbers
    [rad/s or m/s]."""
    relative_to: Vector | None = None
    """The configuration to which relative values refer, such as a circle without a
    centre and ``target: start``, nq numbers [rad, m, or unit quaternions]; by default
    the start itself."""

    def __post_init__(self) -> None:
        given = self._given()
        if len(given) > 1:
            raise ConfigurationError(
                f"the start is given twice; give only one of {given[0]} and {given[1]}"
            )

    def _given(self) -> list[str]:
        """Return the names of the fields that give the configuration."""
        names = "joints", "coordinates", "configuration", "pose"
        return [name for name in names if getattr(self, name) is not None]

    @property
    def is_found(self) -> bool:
        """Whether the configuration is searched instead of given."""
        return self.pose is not None or isinstance(self.joints, str)

    def configuration_of(
        self,
        robot: Robot,
        contacts: Iterable[Contact] = (),
        tasks: Iterable[Task] = (),
        scene: Scene | None = None,
        least: float = 0.03,
    ) -> Array:
        """Return the start configuration, shape (nq,).

        Args:
            robot: The robot.
            contacts: Its contacts, for `ground`.
            tasks: The tasks for which a start that is found must be regular.
            scene: The obstacles of which it must be clear.
            least: Singular value below which it is not regular.

        Raises:
            ConfigurationError: If the numbers are no configuration of the robot, or
                none is found.
            ShapeError: If there is another number of them.
            JointNotFoundError: If a joint does not exist.
            ContactError: If the robot has no free-flyer root, or no contact, to put on
                the ground.
        """
        with within(*self._given()):
            if self.is_found:
                search = posture_search(robot, tasks, scene)
                if self.pose is None:
                    q = search.find(least).q
                else:
                    q = search.find_with(self.pose.target(robot), least).q
            else:
                q = self._configuration(robot)
        if self.ground is None:
            return q
        return _put_on_ground(self.ground, list(contacts), robot, q)

    def relative_to_of(self, robot: Robot, q: Array) -> Array:
        """Return the configuration of relative values, shape (nq,); q is the start."""
        if self.relative_to is None:
            return q
        with within("relative_to"):
            return robot.check_configuration(self.relative_to)

    def velocity_of(self, controller: Controller, t: float, q: Array) -> Array:
        """Return the start velocity at a time [s], shape (nv,)."""
        robot = controller.robot
        if isinstance(self.velocity, str):
            flows = self.velocity == "flow"
            return controller.flow(t, q) if flows else np.zeros(robot.nv)
        with within("velocity"):
            return robot.check_tangent(self.velocity, "v0").copy()

    def _configuration(self, robot: Robot) -> Array:
        if self.configuration is not None:
            return robot.check_configuration(self.configuration)
        if self.coordinates is not None:
            A = robot.joint_coordinates
            if A is None:
                raise ConfigurationError(
                    f"{robot.name} defines no joint coordinates; use joints"
                )
            theta = robot.check_tangent(self.coordinates, "coordinates")
            return robot.integrate(robot.neutral(), np.linalg.solve(A, theta))
        if isinstance(self.joints, Mapping):
            return _moved_joints(robot, self.joints)
        if self.joints is not None:
            joints = robot.check_tangent(self.joints, "joints")
            return robot.integrate(robot.neutral(), joints)
        return robot.home()


def _or_auto(start: InitialState | str) -> InitialState:
    return InitialState(joints="auto") if isinstance(start, str) else start


StartOrAuto = Annotated[
    InitialState, ArrayField(Literal["auto"] | InitialState, _or_auto)
]
"""A start; ``auto`` is short for ``joints: auto``."""


def _moved_joints(robot: Robot, joints: Mapping[str, float]) -> Array:
    """Return home with some joints, by name, at other positions [rad or m]."""
    positions = robot.joint_positions(robot.home())
    for joint, value in joints.items():
        with within(joint):
            where = robot.velocity_index(joint)
            if where.stop - where.start != 1:
                raise ConfigurationError(
                    f"joint {joint!r} has {where.stop - where.start} degrees of "
                    "freedom; use configuration"
                )
        positions[where] = value
    return robot.integrate(robot.neutral(), positions)


def _put_on_ground(
    height: float, contacts: list[Contact], robot: Robot, q: Array
) -> Array:
    """Return q with the root moved vertically: the lowest contact is at a height."""
    if not (robot.unactuated and contacts):
        lacks = "contact" if robot.unactuated else "free-flyer root"
        with within("ground"):
            raise ContactError(f"{robot.name} has no {lacks} to put on the ground")
    state = robot.state(0.0, q, np.zeros(robot.nv))
    lowest = np.inf
    for contact in contacts:
        frame = state.frame(contact.frame)
        heights = (frame.position + contact.arms(frame))[:, 2]
        lowest = min(lowest, float(heights.min()))
    # The displacement of a root is expressed in its own axes.
    root = next(iter(robot.joints.values()))
    lift = np.zeros(robot.nv)
    up = state.data.oMi[1].rotation.T @ np.array([0.0, 0.0, height - lowest])
    lift[root.idx_v : root.idx_v + 3] = up
    return robot.integrate(q, lift)


# --- the search for a start ----------------------------------------------------------


def posture_search(
    robot: Robot, tasks: Iterable[Task] = (), scene: Scene | None = None
) -> PostureSearch:
    """Return the search for postures that are good for tasks and clear of a scene."""
    if robot.unactuated:
        raise ConfigurationError(
            f"{robot.name} has a free-flyer root; a start is found for robots with a "
            "fixed base only: give joints, and ground"
        )
    obstacles = () if scene is None else tuple(scene.values())
    return PostureSearch(robot, _tracked_rows(tasks, robot), obstacles)


def _tracked_rows(tasks: Iterable[Task], robot: Robot) -> list[Rows]:
    """Return the rows of the frame tasks of the highest priority."""
    tasks = list(tasks)
    first = min((task.priority or 1 for task in tasks), default=1)
    found = []
    for task in tasks:
        if (task.priority or 1) > first:
            continue
        match task:
            case FramePosition():
                rows = tuple(axis_indices(task.axes).tolist())
            case FrameOrientation():
                rows = (3, 4, 5)
            case FramePose():
                rows = (0, 1, 2, 3, 4, 5)
            case _:
                continue
        found.append((frame_of(task.frame, robot), rows))
    return found
