"""The robot, its root in the world, and its start."""

from typing import Literal

from hsp_control.config.models.base import Model, Name, Number, Vector, Vector3
from hsp_control.robot.description.sources import Root


class ToolFrameModel(Model):
    """A frame that is fixed to a frame of the robot."""

    parent: str
    """Name of the robot's frame that it is fixed to."""
    translation: Vector3 = [0.0, 0.0, 0.0]
    """Its origin in the parent frame [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """Its roll, pitch and yaw in the parent frame [rad]."""


class LoadModel(Model):
    """How a robot model is loaded."""

    name: str | None = None
    """Name of a bundled robot or of example-robot-data, or the path of a URDF file."""
    root: Root | None = None
    """Connection of the root to the world; by default as the robot's source defines."""
    locked: dict[str, Number] | None = None
    """Locked joints: position [rad or m] by name; by default as the robot's source
    defines."""
    tool_frames: dict[Name, ToolFrameModel] = {}
    """Frames to add, by name."""
    mimic: bool = True
    """Whether mimic joints follow their leading joints; if not, they move freely."""


class PartModel(LoadModel):
    """One of several robots."""

    position: Vector3 = [0.0, 0.0, 0.0]
    """Position of its root in the world [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """Roll, pitch and yaw of its root in the world [rad]."""


class RobotModel(LoadModel):
    """The robot, and its root in the world."""

    parts: dict[Name, PartModel] | None = None
    """Instead of `name`: several robots by name; frames are called
    ``<part>_<frame>``."""
    gravity: Vector3 | None = None
    """Gravitational acceleration in the world [m/s²]; [0, 0, -9.81] by default."""


class StartModel(Model):
    """The start: one of joints, coordinates and configuration; home by default."""

    joints: Vector | dict[str, Number] | None = None
    """Joint positions [rad or m]: nv numbers, or some by name with the others at
    home."""
    coordinates: Vector | None = None
    """Joint coordinates theta = A q [rad or m], where the robot's source defines A."""
    configuration: Vector | None = None
    """The configuration, nq numbers [rad, m, or unit quaternions]."""
    ground: Number | None = None
    """Height of the lowest contact [m]; a free-flyer root is moved up or down to it."""
    velocity: Literal["rest", "flow"] | Vector = "rest"
    """Velocity: ``rest``, ``flow`` (that of the law without errors), or nv numbers
    [rad/s or m/s]."""
