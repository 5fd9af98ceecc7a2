"""Which robot, how it stands in the world, and where it starts."""

from typing import Literal

from hsp_control.config.models.base import Model, Name, Number, Vector, Vector3
from hsp_control.robot.description.sources import Root


class ToolFrameModel(Model):
    """A frame fixed to one of the robot's own."""

    parent: str
    """The frame that it is fixed to."""
    translation: Vector3 = [0.0, 0.0, 0.0]
    """Its origin in the parent frame [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """Its roll, pitch and yaw in the parent frame [rad]."""


class LoadModel(Model):
    """How a robot is loaded."""

    name: str | None = None
    """A bundled name, a name of example-robot-data, or a path to a URDF file."""
    root: Root | None = None
    """How it stands in the world; as its source says by default."""
    locked: dict[str, Number] | None = None
    """Joints held still, name to value [rad or m]; as its source says by default."""
    tool_frames: dict[Name, ToolFrameModel] = {}
    """Frames to add, by name."""
    mimic: bool = True
    """Whether joints that mimic others follow them, or are free."""


class PartModel(LoadModel):
    """One robot among several in the workspace."""

    position: Vector3 = [0.0, 0.0, 0.0]
    """Where its root stands in the world [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """How its root is turned [rad]."""


class RobotModel(LoadModel):
    """Which robot, and how it stands in the world."""

    parts: dict[Name, PartModel] | None = None
    """Instead of a name: several robots, whose frames are then ``<part>_<frame>``."""
    gravity: Vector3 | None = None
    """Acceleration of gravity in the world [m/s²]; -9.81 along z by default."""


class StartModel(Model):
    """Where the robot starts; at most one way to say it. By default its home."""

    joints: Vector | dict[str, Number] | None = None
    """Joint positions [rad or m], all nv of them or some by name, the rest at home."""
    coordinates: Vector | None = None
    """Joint coordinates theta = A q, where the robot's source defines A."""
    configuration: Vector | None = None
    """The configuration itself, nq numbers."""
    ground: Number | None = None
    """Height that the lowest contact is put at, by moving a free-flyer root [m]."""
    velocity: Literal["rest", "flow"] | Vector = "rest"
    """At rest, on the flow that the law leads to, or nv numbers [rad/s or m/s]."""
