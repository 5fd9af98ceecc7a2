"""The robot's model: loaded, taken from a scene, or combined."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
)
from hsp_control.common.native import NativeCall
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within
from hsp_control.robot.acceleration import Acceleration
from hsp_control.robot.configuration_space import ConfigurationSpace
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.combining import Part, combine, placement
from hsp_control.robot.description.loading import (
    end_effector_frame,
    load_model,
    reference_posture,
)
from hsp_control.robot.description.mujoco.selection import select
from hsp_control.robot.description.mujoco.source import load_mjcf, load_selection
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource, Root
from hsp_control.robot.pinocchio_calls import bind_pinocchio

_ARM_RATE, _LEG_RATE = 11.0, 500.0
"""Maximum rate of an effort in maximum efforts [1/s]: with a fixed base, and of a robot
whose contacts change."""
_LIMB = 4
"""Fewest joints of an arm or a leg; heads and fingers have fewer."""


class RobotModel(ConfigurationSpace):
    """A robot's model: its joints, frames, limits and dynamics.

    Configurations q have shape (nq,). Velocities, accelerations, efforts, gradients
    and errors are tangent vectors of shape (nv,). Nothing assumes nq = nv. A robot does
    not change after it has been built, and it contains no meshes.

    Attributes:
        source: Where it was loaded from.
        description: What `load` was given; None for a robot made otherwise.
        parts: The robots that it consists of: itself only, unless it was combined.
        frame_names: Names of all frames.
    """

    def __init__(
        self,
        model: pin.Model,
        source: RobotSource,
        parts: Sequence[Part] = (),
        description: RobotDescription | None = None,
    ) -> None:
        """Wrap a Pinocchio model; `Robot.load` is the usual way to create a robot."""
        super().__init__(
            model, source.name, source.home or reference_posture(model, source)
        )
        self.source = source
        self.description = description
        self.parts = tuple(parts) or (Part("", source, pin.SE3.Identity()),)
        self.frame_names: tuple[str, ...] = tuple(f.name for f in model.frames)
        # If a joint and a link have the same name, it means the link's frame.
        links = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
        self._frame_ids = {
            frame.name: i
            for i, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.BODY or frame.name not in links
        }
        self._data = model.createData()

    @classmethod
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
        access: Access = ANYWHERE,
    ) -> Self:
        """Load a bundled robot, one of an installed package, or a URDF or xacro file.

        Args:
            name: For example ``"panda"``, ``"talos_arm"``, ``"gen3_description"`` or
                ``"my_arm/arm.urdf"``; or a whole description, and then nothing else.
            root: How its base is attached to the world: ``fixed``, ``planar``
                (x, y, yaw) or ``free_flyer``. None: as its source says; ``fixed`` for a
                file.
            locked: Joints to lock, name to value [rad or m]. None: as its source says
                (the bundled Panda locks its fingers); ``{}``: none.
            tool_frames: Frames to add, by name.
            gravity: Acceleration of gravity in the world [m/s²], shape (3,). None:
                -9.81 along z.
            mimic: Whether ``<mimic>`` joints follow their leader. False: they are
                independent joints.
            project_inertias: Whether inertias that no body can have are replaced by the
                nearest that one can have; mass and centre of mass stay.
            xacro_args: Arguments of a xacro file, by name.
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
        if not isinstance(name, RobotDescription):
            name = RobotDescription(
                name,
                root=root,
                locked=locked,
                tool_frames=tool_frames or {},
                gravity=gravity,
                mimic=mimic,
                project_inertias=project_inertias,
                xacro_args=xacro_args or {},
            )
        elif (
            not mimic
            or project_inertias
            or any(
                option is not None
                for option in (root, locked, tool_frames, gravity, xacro_args)
            )
        ):
            raise ModelError(
                "a RobotDescription says all about the robot: give root, locked, "
                "tool_frames, gravity, mimic, project_inertias and xacro_args in it"
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
        the root are no part of it; those above the root stand still. What MuJoCo has
        and the robot lacks, such as a closed loop, is in `source.omitted`, and logged
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
        selection = select(model, root, joints, qpos, keyframe, locked)
        return cls(*load_selection(selection, tool_frames or {}))

    @classmethod
    def _described(cls, description: RobotDescription, access: Access) -> Self:
        """Return the robot of a description."""
        gravity = description.gravity
        if description.mjcf is not None:
            return cls(*load_mjcf(description, access), description=description)
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
    def combine(cls, robots: Mapping[str, tuple["RobotModel", pin.SE3]]) -> Self:
        """Return one robot that consists of several robots in one workspace.

        Args:
            robots: For each name a robot and the placement of its root in the world.
                Joints and frames are renamed to ``<name>_<own name>``.

        Raises:
            ModelError: If there are fewer than two robots, one is already combined,
                their gravity differs, or one has mimic joints.
        """
        parts = [
            (Part(f"{name}_", robot.source, place), robot.model)
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
            # A restored model would crash the process: Pinocchio's archives omit what
            # mimic joints refer to (seen with 4.1).
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
        """The frame of the hand: as the source says, or else `end_effector_frame`."""
        named = self.source.end_effector
        if named is not None and named in self._frame_ids:
            return named
        return end_effector_frame(self.model)

    @cached_property
    def size(self) -> float:
        """Length of the longest chain from the first joint to a frame [m].

        It is the sum of the distances between the origins of consecutive joints, and of
        the ranges of prismatic ones: an arm reaches no farther from its first joint.
        """
        model, lengths = self.model, np.zeros(self.model.njoints)
        lower, upper = self.position_limits()
        for joint in range(1, model.njoints):
            parent = model.parents[joint]
            if parent > 0:
                away = np.linalg.norm(model.jointPlacements[joint].translation)
                lengths[joint] = lengths[parent] + away
            moved = model.joints[joint]
            if moved.nv == 1 and self.units[moved.idx_v] == "m":
                slid = (upper - lower)[moved.idx_v]
                lengths[joint] += slid if np.isfinite(slid) else 0.0
        longest = lengths.max()
        for frame in model.frames:
            if frame.parentJoint > 0:
                away = np.linalg.norm(frame.placement.translation)
                longest = max(longest, lengths[frame.parentJoint] + away)
        return float(longest)

    @property
    def effort_rate(self) -> Array:
        """Maximum rate of the efforts, shape (nv,) [N·m/s or N/s]; inf for none.

        No URDF has one. It is 11 times the largest maximum effort each second, for all
        joints of the same unit, a little less than a Panda may at 87 N·m: a light wrist
        has to answer a push as quickly as a shoulder. It is 500 times where legs meet
        the ground.
        """
        effort = np.array(self.model.effortLimit)
        effort[(effort <= 0.0) | (effort >= np.finfo(np.float32).max)] = np.inf
        effort[list(self.unactuated)] = np.inf
        rate = np.full(self.nv, np.inf)
        for unit in set(self.units):
            alike = np.isfinite(effort) & (np.array(self.units) == unit)
            rate[alike] = effort[alike].max(initial=0.0)
        return (_LEG_RATE if self.unactuated else _ARM_RATE) * rate

    @cached_property
    def spring_force(self) -> tuple[float, float]:
        """The largest force and moment of springs by default [N, N·m]; inf for none.

        The force is what the strongest motor holds at half of `size`, the moment half
        of that motor's effort. Only motors that slide count as they are.
        """
        effort = np.array(self.model.effortLimit)
        effort[(effort <= 0.0) | (effort >= np.finfo(np.float32).max)] = np.inf
        effort[list(self.unactuated)] = np.inf
        turns = np.array(self.units) == "rad"
        found = effort[turns & np.isfinite(effort)]
        if found.size and self.size > 0.0:
            strongest = float(found.max())
            return strongest / (0.5 * self.size), 0.5 * strongest
        found = effort[~turns & np.isfinite(effort)]
        return (float(found.max()) if found.size else np.inf), np.inf

    @cached_property
    def largest_inertias(self) -> Array:
        """Largest M_ii in any posture, nearly, shape (nv,) [kg·m² or kg].

        It is the largest of home and 64 postures, drawn once and for all.
        """
        rng, largest = np.random.default_rng(0), np.zeros(self.nv)
        q = self.home()
        for _ in range(65):
            self._data.M[:] = 0.0
            largest = np.maximum(largest, np.diag(pin.crba(self.model, self._data, q)))
            turned = rng.uniform(-np.pi, np.pi, self.nv)
            q = pin.integrate(self.model, self.neutral(), turned)
        return largest

    @cached_property
    def typical_inertia(self) -> float:
        """Geometric mean of the joints' largest inertias [kg·m²], nearly."""
        joints = np.setdiff1d(np.arange(self.nv), self.unactuated)
        inertias = self.largest_inertias[joints]
        inertias = inertias[inertias > 0.0]
        return float(np.exp(np.log(inertias).mean())) if inertias.size else 1.0

    # -- names ------------------------------------------------------------------------

    def frame_id(self, name: str) -> int:
        """Return the index of a frame in the Pinocchio model.

        Raises:
            FrameNotFoundError: If there is no such frame; the message suggests one.
        """
        try:
            return self._frame_ids[name]
        except KeyError:
            raise FrameNotFoundError(
                f"no frame {name!r}{did_you_mean(name, self.frame_names)} "
                f"(the model has {listing(self.frame_names)})"
            ) from None

    def velocity_index(self, joint: str) -> slice:
        """Return the indices of a joint's degrees of freedom in v.

        Raises:
            JointNotFoundError: If there is no moving joint with this name.
        """
        if joint not in self.joints:
            raise JointNotFoundError(
                f"no joint {joint!r}{did_you_mean(joint, self.joint_names)} "
                f"(the model has {listing(self.joint_names)})"
            )
        model = self.joints[joint]
        return slice(model.idx_v, model.idx_v + model.nv)

    def is_on_trunk(self, frame: str) -> bool:
        """Return whether a frame belongs to the trunk of a robot with a floating base.

        The trunk is the base, and every body that carries two limbs or more: chains of
        at least four joints, such as arms and legs.

        Raises:
            FrameNotFoundError: If there is no such frame.
        """
        joint = self.model.frames[self.frame_id(frame)].parentJoint
        return bool(self.unactuated) and (joint == 1 or self._limbs(joint)[0] >= 2)

    def _limbs(self, joint: int) -> tuple[int, int]:
        """Return the number of limbs beyond a joint, and the joints of the longest."""
        limbs = longest = 0
        for child in range(joint + 1, self.model.njoints):
            if self.model.parents[child] == joint:
                beyond, length = self._limbs(child)
                longest = max(longest, 1 + length)
                limbs += max(beyond, int(1 + length >= _LIMB))
        return limbs, longest

    # -- dynamics ---------------------------------------------------------------------

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Return the effort M(q) a + N(q, v), shape (nv,) (RNEA)."""
        return np.array(pin.rnea(self.model, self._data, q, v, a))

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration M(q)⁻¹ (tau - N(q, v)), shape (nv,).

        Computed by ABA; with mimic joints, which ABA does not support, by CRBA and a
        linear solve.

        Raises:
            ModelError: If M is singular (only detected with mimic joints).
        """
        if not self.mimics:
            return np.array(pin.aba(self.model, self._data, q, v, tau))
        return self._forward_dynamics_of_mimics(q, v, tau)

    def bind_forward_dynamics(self, q: Array, v: Array, tau: Array) -> Acceleration:
        """Return `forward_dynamics` for what these arrays hold when it is computed."""
        if not self.mimics:
            call = bind_pinocchio("aba", self.model, self._data, q, v, tau)
            native = call if isinstance(call, NativeCall) else None
            return Acceleration(lambda t: call(), self._data.ddq, native)
        value = np.zeros(self.nv)

        def compute(t: float) -> None:
            value[:] = self._forward_dynamics_of_mimics(q, v, tau)

        return Acceleration(compute, value)

    def _forward_dynamics_of_mimics(self, q: Array, v: Array, tau: Array) -> Array:
        mass_matrix = pin.crba(self.model, self._data, q)
        effects = pin.nonLinearEffects(self.model, self._data, q, v)
        try:
            return np.asarray(np.linalg.solve(mass_matrix, tau - effects))
        except np.linalg.LinAlgError:
            raise ModelError(
                f"{self.name}: the mass matrix is singular at this configuration"
            ) from None
