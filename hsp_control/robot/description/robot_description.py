"""The description of a robot: its name or file, and how to load it."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, field, replace
from pathlib import Path
from typing import Annotated, Self, get_args

from hsp_control.common.errors import ModelError
from hsp_control.common.resources import is_file
from hsp_control.common.suggestions import did_you_mean
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    READ_ONLY,
    FileName,
    Flag,
    Name,
    Names,
    Number,
    ReadOnlyDict,
    Vector3,
)
from hsp_control.declaration.rotation import Rotation
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.motor_inertia import MotorInertias
from hsp_control.robot.description.sources import (
    FILE_ENDINGS,
    RobotSource,
    Root,
    find_description,
    find_robot,
)
from hsp_control.robot.description.xacro_files import xacro_text

_ZERO = (0.0, 0.0, 0.0)
_OF_ONE = {
    "root", "locked", "tool_frames", "mimic", "project_inertias", "xacro_args", "srdf",
    "motor_inertia",
}  # fmt: skip


class ToolFrame(Part, error=ModelError):
    """A frame to add to the robot, fixed to one of its frames."""

    parent: str
    """Name of the robot's frame to which it is fixed."""
    translation: Vector3 = _ZERO
    """Its origin in the parent frame [m]."""
    rotation: Rotation = _ZERO
    """Its orientation in the parent frame: roll, pitch and yaw [rad], a quaternion
    (x, y, z, w) [-], or a matrix [-]."""


class OneRobot(Part, error=ModelError):
    """One robot of a name or a file, and how it is loaded."""

    name: FileName | None = None
    """Name of a bundled robot or of example-robot-data, or the path of a URDF or xacro
    file."""
    _: KW_ONLY
    description: Name | None = None
    """Instead of `name`: a robot's name in the package robot_descriptions, such as
    gen3_description."""
    root: Root | Name | None = None
    """Connection of the root to the world; by default as the robot's source defines."""
    locked: Annotated[Mapping[str, Number], READ_ONLY] | None = None
    """Locked joints: position [rad or m] by name; by default as the robot's source
    defines."""
    tool_frames: Annotated[Mapping[Name, ToolFrame], READ_ONLY] = field(
        default_factory=ReadOnlyDict
    )
    """Frames to add, by name."""
    mimic: Flag = True
    """Whether mimic joints follow their leading joints; if not, they move freely."""
    project_inertias: Flag = False
    """Whether physically inconsistent inertias are replaced by the nearest consistent
    ones; mass and centre of mass are kept."""
    xacro_args: Annotated[Mapping[str, str | bool | Number], READ_ONLY] = field(
        default_factory=ReadOnlyDict
    )
    """Arguments of a xacro file, by name; others have their defaults [-]."""
    srdf: FileName | None = None
    """SRDF file whose disabled pairs of links never collide; by default the one of the
    same name beside the URDF, if there is one."""
    motor_inertia: MotorInertias | None = None
    """Inertia of the rotors reflected to the joints, with their reductions squared
    [kg·m² or kg]: one number, or one per joint in a list or by name; 0: the bare
    links. ``bundled``: those in the README of a bundled robot. By default those in the
    ``<transmission>`` elements of the URDF."""

    def find(self, access: Access = ANYWHERE) -> RobotSource:
        """Return its source; see `find_robot` and `find_description`.

        Raises:
            ModelError: If it is several robots.
        """
        arguments = {name: xacro_text(text) for name, text in self.xacro_args.items()}
        if self.description is not None:
            source = find_description(self.description, access, arguments)
        elif self.name is None:
            raise ModelError("several robots come from several files")
        else:
            source = find_robot(self.name, access, arguments)
        if self.srdf is None:
            return source
        srdf = Path(self.srdf).expanduser()
        access.check(srdf, "srdf")
        if not is_file(srdf):
            with within("srdf"):
                raise ModelError(f"no such file {srdf}")
        return replace(source, srdf=srdf)

    def located(self, folder: Path) -> Self:
        """Return it with the full path of each file that is in a folder.

        A relative path is first looked up there, so that a folder with a configuration
        and its robots can be moved.
        """
        located = self
        if self.name is not None:
            located = replace(located, name=_located(self.name, folder))
        if self.srdf is not None and is_file(folder / self.srdf):
            located = replace(located, srdf=str(folder / self.srdf))
        return located

    def _check_one_of(self, *names: str) -> None:
        if sum(getattr(self, name) is not None for name in names) != 1:
            raise ModelError(f"give one of {', '.join(names[:-1])} and {names[-1]}")


class PlacedRobot(OneRobot):
    """One of several robots in a workspace."""

    root: Root | None = None
    """Connection of the root to the world; by default as the robot's source defines."""
    position: Vector3 = _ZERO
    """Position of its root in the world [m]."""
    rotation: Rotation = _ZERO
    """Orientation of its root in the world: roll, pitch and yaw [rad], a quaternion
    (x, y, z, w) [-], or a matrix [-]."""

    def __post_init__(self) -> None:
        self._check_one_of("name", "description")


class RobotDescription(OneRobot):
    """A robot: one of a name or file, one in a MuJoCo scene, or several robots.

    `Robot.load` makes the robot.
    """

    root: Root | Name | None = None
    """Connection of the root to the world; by default as the robot's source defines.
    With `mjcf`: the body whose subtree is the robot; by default the whole scene."""
    mjcf: FileName | None = None
    """Instead of `name`: the path of an MJCF, a scene that contains the robot."""
    joints: Names | None = None
    """With `mjcf`: the joints that move; by default all. The others are locked."""
    keyframe: Name | None = None
    """With `mjcf`: the keyframe where the robot is at home, and the other joints are
    locked; by default the scene's reference configuration."""
    gravity: Vector3 | None = None
    """Gravitational acceleration in the world [m/s²]; [0, 0, -9.81] by default."""
    parts: Annotated[Mapping[Name, PlacedRobot], READ_ONLY] | None = None
    """Instead of `name`: several robots by name; joints and frames are called
    ``<part>_<own name>``."""

    def __post_init__(self) -> None:
        self._check_one_of("name", "description", "mjcf", "parts")
        if self.mjcf is not None:
            if not self.mimic:
                raise ModelError(
                    "mimic is not for mjcf, which has equality constraints"
                )
            for key in ("project_inertias", "xacro_args", "srdf"):
                if getattr(self, key):
                    raise ModelError(f"{key} is not for mjcf")
            if self.motor_inertia is not None:
                raise ModelError(
                    "motor_inertia is not for mjcf, whose joints have an armature"
                )
            return
        allowed = get_args(Root)
        if self.root is not None and self.root not in allowed:
            with within("root"):
                raise ModelError(
                    f"unknown value {self.root!r}{did_you_mean(self.root, allowed)} "
                    f"(allowed: {', '.join(allowed)})"
                )
        for key in ("joints", "keyframe"):
            if getattr(self, key) is not None:
                raise ModelError(f"{key} is only for mjcf")
        of_one = _OF_ONE & {*self.changed_fields()}
        if self.parts is not None and of_one:
            raise ModelError(
                f"{', '.join(sorted(of_one))}: give it for each of the parts"
            )

    def located(self, folder: Path) -> Self:
        """Return it with the full path of each file that is in a folder."""
        if self.mjcf is not None:
            return replace(self, mjcf=_located(self.mjcf, folder))
        if self.parts is None:
            return super().located(folder)
        parts = {name: part.located(folder) for name, part in self.parts.items()}
        return replace(self, parts=parts)


def _located(name: str | Path, folder: Path) -> str:
    text = str(name)
    if text.endswith(FILE_ENDINGS) and is_file(folder / text):
        return str(folder / text)
    return text
