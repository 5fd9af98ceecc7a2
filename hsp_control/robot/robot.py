"""The robot: a model, loaded by name, from a file, MuJoCo or Pinocchio."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.entry_points import entry_points
from hsp_control.common.errors import ModelError
from hsp_control.common.keywords import suggesting
from hsp_control.declaration import within
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.from_pinocchio import take_model
from hsp_control.robot.description.hand import Hand, find_hand
from hsp_control.robot.description.loading import (
    RobotPart,
    combine,
    load_model,
    placement,
    reference_posture,
)
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource, Root
from hsp_control.robot.model import RobotModel
from hsp_control.robot.state import RobotState


class Robot(RobotModel):
    """A robot: its `RobotModel`, the source of that, and states of it.

    Attributes:
        source: Where it was loaded from.
        description: The arguments of `load`; None for a robot made otherwise.
        parts: The robots that it consists of: itself only, unless it was combined.
    """

    def __init__(
        self,
        model: pin.Model,
        source: RobotSource,
        parts: Sequence[RobotPart] = (),
        description: RobotDescription | None = None,
    ) -> None:
        """Wrap a Pinocchio model; `Robot.load` is the usual way to create a robot."""
        home = source.home or reference_posture(model, source)
        super().__init__(model, source.name, home)
        self.source = source
        self.description = description
        self.parts = tuple(parts) or (RobotPart("", source, pin.SE3.Identity()),)

    @classmethod
    @suggesting
    def load(
        cls,
        name: str | Path | RobotDescription,
        *,
        root: Root | None = None,
        locked: Mapping[str, float] | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
        gravity: ArrayLike | None = None,
        mimic: bool = True,
        project_inertias: bool = False,
        xacro_args: Mapping[str, str | bool | float] | None = None,
        srdf: str | Path | None = None,
        motor_inertia: ArrayLike | Mapping[str, float] | str | None = None,
        access: Access = ANYWHERE,
    ) -> Self:
        """Load a bundled robot, one of an installed package, or a URDF or xacro file.

        Args:
            name: For example ``"panda"``, ``"talos_arm"``, ``"gen3_description"`` or
                ``"my_arm/arm.urdf"``; or a whole description, and then nothing else.
            root: How its base is attached to the world: ``fixed``, ``planar``
                (x, y, yaw) or ``free_flyer``. None: as its source defines; ``fixed``
                for a file.
            locked: Joints to lock, name to value [rad or m]. None: as its source
                defines (the bundled Panda locks its fingers); ``{}``: none.
            tool_frames: Frames to add, by name.
            gravity: Acceleration of gravity in the world [m/s²], shape (3,). None:
                -9.81 along z.
            mimic: Whether ``<mimic>`` joints follow their leader. False: they are
                independent joints.
            project_inertias: Whether physically inconsistent inertias are replaced by
                the nearest consistent ones; mass and centre of mass are kept.
            xacro_args: Arguments of a xacro file, by name.
            srdf: An SRDF whose disabled pairs of links never collide. None: the one of
                the same name beside the URDF, if there is one.
            motor_inertia: Inertia of the rotors reflected to the joints [kg·m² or kg]:
                one number, 0 for the bare links, one per joint, by name, or
                ``bundled``: those in the README of a bundled robot. None: those of the
                URDF's transmissions.
            access: Which files may be read: a URDF given by path, and the meshes that
                it names. Use `access.only_within` for untrusted files.

        Raises:
            RobotNotFoundError: If there is no such robot.
            AccessError: If a file is not allowed.
            ModelError: If an option is wrong or does not fit the model, the URDF is
                invalid, or the mass matrix is singular.
            JointNotFoundError: If a joint to lock does not exist.
            FrameNotFoundError: If a tool frame's parent does not exist.
        """
        if isinstance(name, pin.Model):
            raise ModelError("a pinocchio.Model; needs Robot.from_pinocchio(model)")
        given: dict[str, Any] = {
            "root": root,
            "locked": locked,
            "tool_frames": tool_frames,
            "gravity": gravity,
            "mimic": None if mimic else False,
            "project_inertias": project_inertias or None,
            "xacro_args": xacro_args,
            "srdf": srdf,
            "motor_inertia": motor_inertia,
        }
        given = {key: value for key, value in given.items() if value is not None}
        if not isinstance(name, RobotDescription):
            name = RobotDescription(name, **given)
        elif given:
            raise ModelError(
                f"a RobotDescription is complete: give {' and '.join(given)} in it"
            )
        return cls._described(name, access)

    @classmethod
    def from_mujoco(
        cls,
        model: Any,
        root: str | None = None,
        joints: Sequence[str] | None = None,
        *,
        qpos: ArrayLike | None = None,
        keyframe: str | None = None,
        locked: Mapping[str, float] | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
    ) -> Self:
        """Return a robot in a compiled MuJoCo model: with the numbers MuJoCo uses.

        Bodies and sites are its frames, under their names. Bodies that are not below
        the root are not part of it; those above the root stand still. MuJoCo's features
        that the robot lacks, such as a closed loop, are in `source.omitted`, and logged
        once as a warning. `MujocoCoordinates` converts states.

        Args:
            model: The scene, a ``mujoco.MjModel``.
            root: Name of the body whose subtree is the robot, with the body's own
                joints; None: the whole scene.
            joints: Names of its joints that move; None: all. The others are locked.
                q and v have MuJoCo's order, whatever the order here.
            qpos: The scene's configuration, shape (model.nq,), in which the other
                joints are locked and the robot is at home; None: ``model.qpos0``, but
                then the home of a joint that is not within its limits there is in
                their middle.
            keyframe: The name of that configuration in the model, instead.
            locked: Hinges and slides to lock elsewhere, name to value [rad or m].
            tool_frames: Frames to add, by name.

        Raises:
            ModelError: If MuJoCo is not installed, the configuration is not one of the
                scene, no joint moves, or the mass matrix is singular.
            FrameNotFoundError: If the root or a tool frame's parent does not exist.
            JointNotFoundError: If a joint does not exist or is not below the root.
        """
        read = _reader("mujoco")
        return cls(*read(model, root, joints, qpos, keyframe, locked, tool_frames))

    @classmethod
    @suggesting
    def from_pinocchio(
        cls,
        model: pin.Model,
        collision: pin.GeometryModel | None = None,
        visual: pin.GeometryModel | None = None,
        *,
        home: ArrayLike | None = None,
        end_effector: str | None = None,
        tool_frames: Mapping[str, ToolFrame] | None = None,
    ) -> Self:
        """Return the robot of a Pinocchio model, of which it keeps a copy.

        ``hsp.Robot.from_pinocchio(*pin.buildModelsFromUrdf(urdf, folders))`` is the
        robot with its shapes. Without ``collision``, distances use capsules between its
        joints; without ``visual``, the viewer draws its joints and links. YAML can only
        name a robot that `Robot.load` reads.

        Args:
            model: The model; gravity, friction and limits are its own. Lock joints with
                ``pin.buildReducedModel``.
            collision: The shapes for distances. If it has collision pairs, only their
                links can collide with one another.
            visual: The shapes that are drawn.
            home: The home posture, a configuration of shape (nq,); None: see `home`.
            end_effector: The frame of the hand; None: see `end_effector`.
            tool_frames: Frames to add, by name.

        Raises:
            ModelError: If an argument is of another type, a geometry model is of
                another model, the axes of a joint turn with its own configuration, or
                the mass matrix is singular.
            FrameNotFoundError: If the hand, or a tool frame's parent, does not exist.
        """
        given = collision, visual, home, end_effector, tool_frames or {}
        robot = cls(*take_model(model, *given))
        if end_effector is not None:
            robot.frame_id(end_effector)
        return robot

    @classmethod
    def _described(cls, description: RobotDescription, access: Access) -> Self:
        """Return the robot of a description."""
        gravity = description.gravity
        if description.mjcf is not None:
            return cls(*_reader("mjcf")(description, access), description=description)
        if description.parts is None:
            source = description.find(access)
            model = load_model(source, description, gravity)
            return cls(model, source, description=description)
        robots = {}
        for name, part in description.parts.items():
            with within("parts", name, "name" if part.name else "description"):
                source = part.find(access)
                robot = cls(load_model(source, part, gravity), source)
            robots[name] = robot, placement(part.position, part.rotation)
        with within("parts"):
            whole = cls.combine(robots)
        whole.description = description
        return whole

    @classmethod
    def combine(cls, robots: Mapping[str, tuple["Robot", pin.SE3]]) -> Self:
        """Return one robot that consists of several robots in one workspace.

        Args:
            robots: For each name a robot and the placement of its root in the world.
                Joints and frames are renamed to ``<name>_<own name>``.

        Raises:
            ModelError: If there are fewer than two robots, one is already combined,
                their gravity differs, or one has mimic joints.
        """
        parts = [
            (RobotPart(f"{name}_", robot.source, place), robot.model)
            for name, (robot, place) in robots.items()
        ]
        model = combine(parts)
        homes = [robot.joint_positions(robot.home()) for robot, _ in robots.values()]
        source = RobotSource(
            name="+".join(part.source.name for part, _ in parts),
            urdf=parts[0][0].source.urdf,
            origin="combined",
            home=tuple(float(x) for home in homes for x in home),
        )
        return cls(model, source, [part for part, _ in parts])

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, nq={self.nq}, nv={self.nv})"

    def __reduce__(self) -> tuple[Any, ...]:
        if self.mimics:
            # A restored model would crash the process: Pinocchio's archives lose
            # mimic joints (seen with 4.1).
            raise ModelError(
                f"{self.name}: a robot with mimic joints cannot be pickled; "
                "load it in each process, or with mimic=False"
            )
        own = self.model, self.source, self.parts, self.description
        return (type(self), own)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return type(self)(self.model.copy(), self.source, self.parts, self.description)

    @property
    def joint_coordinates(self) -> Array | None:
        """The matrix A of the coordinates theta = A q in the literature, or None.

        Shape (nv, nv). For the planar arm, theta are the absolute angles of its links,
        measured from the horizontal.
        """
        if self.source.joint_coordinates != "absolute":
            return None
        return np.tril(np.ones((self.nv, self.nv)))

    @property
    def end_effector(self) -> str:
        """The frame of the hand: as the source defines, or else the likeliest."""
        return self.hand.frame

    @cached_property
    def hand(self) -> Hand:
        """The frame of the hand, and the reason for this choice; see `find_hand`."""
        named = self.source.end_effector
        if named is not None and named in self._frame_ids:
            return Hand(named, "the robot's source names it")
        return find_hand(self.model)

    def state(self, t: float, q: Any, v: Any) -> "RobotState":
        """Return a new `RobotState` at time t [s], q (nq,) and v (nv,).

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        return RobotState(self).update(
            t, self.check_configuration(q), self.check_tangent(v, "velocity v")
        )


def _reader(kind: str) -> Callable[..., tuple[pin.Model, RobotSource]]:
    """Return the reader of a kind of model that a companion supports."""
    entry = entry_points("robots").get(kind)
    if entry is None:
        raise ModelError(f"the companion that reads {kind} models is not installed")
    reader: Callable[..., tuple[pin.Model, RobotSource]] = entry.load()
    return reader
