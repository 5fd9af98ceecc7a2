"""A robot's joints and frames: configurations, names, and where they are in q and v."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.common.errors import (
    ConfigurationError,
    FrameNotFoundError,
    JointNotFoundError,
    NonFiniteError,
    ShapeError,
    SimulationError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.robot.description.loading import (
    frames_by_name,
    guarded,
    moving_joints,
)

_LIMB = 4
"""Fewest joints of an arm or a leg; heads and fingers have fewer."""


class Structure:
    """A robot's joints and frames, and their names and limits.

    Configurations q have shape (nq,). Velocities, accelerations, efforts, gradients
    and errors are tangent vectors of shape (nv,). Nothing assumes nq = nv. A model does
    not change after it has been built, and it contains no meshes.

    Attributes:
        name: The robot's name, for messages.
        model: The Pinocchio model.
        nq: Size of a configuration.
        nv: Size of a velocity: the number of degrees of freedom.
        joints: Pinocchio's models of the joints with degrees of freedom, by name, in
            the order of v.
        joint_names: Their names.
        frame_names: Names of all frames.
        dof_names: A name per degree of freedom: that of its joint, or
            ``root_joint.x`` if the joint has several, ``neck.roll`` if it is a ball.
        units: The unit of each degree of freedom, ``rad`` or ``m``.
        single_dof_joints: (index in v, start in q, size in q) of every joint with one
            degree of freedom, and of each slide of a joint of several, shape (k, 3);
            the size is 2 for continuous joints.
        unit_blocks: (start, size) of every quaternion and (cos, sin) pair in q.
        flat: Whether every joint has one degree of freedom, so that δ' = v holds
            globally for q = base ⊕ δ.
        linear: Whether moreover q is a vector, so that q = base + δ.
        mimics: Whether some joints mimic others.
        unactuated: Indices in v that have no motor: those of a free-flyer root.
        dof_indices: Index in q of each degree of freedom's coordinate, shape (nv,); -1
            if it has none (roots, continuous joints).
    """

    def __init__(
        self, model: pin.Model, name: str, home: Sequence[float] | None = None
    ) -> None:
        """Wrap a Pinocchio model.

        ``home`` is the displacement from neutral (nv,) of the home posture, ignored if
        it has another size.
        """
        self.model = guarded(model)
        self.name = name
        self.nq: int = model.nq
        self.nv: int = model.nv
        self.joints = moving_joints(model)
        self.joint_names: tuple[str, ...] = tuple(self.joints)
        self.frame_names: tuple[str, ...] = tuple(f.name for f in model.frames)
        self._frame_ids = frames_by_name(model)
        joints = self.joints.values()
        dofs = [
            (joint, f"{name}.{label}" if label else name, label)
            for name, joint in self.joints.items()
            for label in _dof_labels(joint)
        ]
        self.dof_names: tuple[str, ...] = tuple(name for _, name, _ in dofs)
        self.units: tuple[str, ...] = tuple(
            "m" if label in ("x", "y", "z") or (not label and _slides(joint)) else "rad"
            for joint, _, label in dofs
        )
        self.single_dof_joints: Indices = np.array(
            [row for joint in joints for row in _coordinates(joint)], dtype=np.int64
        ).reshape(-1, 3)
        self.unit_blocks: tuple[tuple[int, int], ...] = tuple(
            _unit_block(joint) for joint in joints if joint.nq == joint.nv + 1
        )
        self.flat: bool = all(joint.nv == 1 for joint in joints)
        self.linear: bool = self.flat and self.nq == self.nv
        self.mimics: bool = model.nvExtended != model.nv
        self.unactuated: tuple[int, ...] = tuple(
            joint.idx_v + k for joint in joints if _floats(joint) for k in range(6)
        )
        self.dof_indices: Indices = np.full(self.nv, -1, dtype=np.int64)
        for i, at, size in self.single_dof_joints:
            if size == 1:
                self.dof_indices[i] = at
        self._home: Array | None = None
        if home is not None and len(home) == self.nv:
            # some SRDFs give postures beyond the limits
            self._home = np.clip(np.array(home), *self.position_limits())

    # -- configurations ---------------------------------------------------------------

    def neutral(self) -> Array:
        """Return the configuration with all joints at zero, shape (nq,)."""
        return np.asarray(pin.neutral(self.model))

    def home(self) -> Array:
        """Return the home posture of the robot's source, shape (nq,).

        If the source has none, it is the neutral configuration, with joints whose
        limits do not contain zero in the middle of their limits.
        """
        if self._home is not None:
            return self.integrate(self.neutral(), self._home)
        lower, upper = self.position_limits()
        bounded = np.isfinite(lower) & np.isfinite(upper)
        middle = np.zeros(self.nv)
        middle[bounded] = 0.5 * (lower[bounded] + upper[bounded])
        inside = (lower < 0.0) & (upper > 0.0)
        middle[inside] = 0.0
        return self.integrate(self.neutral(), middle)

    def random_configuration(self, rng: np.random.Generator) -> Array:
        """Return a random configuration, shape (nq,).

        Joints are uniform within their limits, or in ±π if they have none. A free-flyer
        root is uniform in a box of ±1 m, with a uniform orientation.
        """
        lower, upper = self.position_limits()
        bounded = np.isfinite(lower) & np.isfinite(upper)
        low = np.where(bounded, lower, -np.pi)
        high = np.where(bounded, upper, np.pi)
        q = self.integrate(self.neutral(), rng.uniform(low, high))
        for joint in filter(_floats, self.joints.values()):
            turn, i = rng.standard_normal(4), joint.idx_q
            q[i : i + 3] = rng.uniform(-1.0, 1.0, 3)
            q[i + 3 : i + 7] = turn / np.linalg.norm(turn)
        return q

    def integrate(self, q: Any, displacement: Any) -> Array:
        """Return q ⊕ displacement, shape (nq,), for shapes (nq,) and (nv,).

        Raises:
            ShapeError: If the arguments are not nq and nv numbers.
        """
        try:
            return np.asarray(pin.integrate(self.model, q, displacement))
        except (TypeError, ValueError):  # lists are converted, wrong shapes reported
            q = self.check_configuration(q)
            displacement = self.check_tangent(displacement, "displacement")
            return np.asarray(pin.integrate(self.model, q, displacement))

    def difference(self, start: Any, end: Any) -> Array:
        """Return end ⊖ start: the displacement from start to end, shape (nv,).

        Raises:
            ShapeError: If an argument does not have nq numbers.
        """
        try:
            return np.asarray(pin.difference(self.model, start, end))
        except (TypeError, ValueError):
            start, end = self.check_configuration(start), self.check_configuration(end)
            return np.asarray(pin.difference(self.model, start, end))

    def joint_positions(self, q: Array) -> Array:
        """Return q ⊖ neutral: the joint positions [rad or m], shape (nv,).

        Continuous joints have angles in (-π, π].
        """
        if self.linear:  # then neutral is 0
            return q.copy()
        return self.difference(self.neutral(), q)

    def position_limits(self) -> tuple[Array, Array]:
        """Return lower and upper joint position limits, shape (nv,) [rad or m].

        They are ±inf where there is no limit: for continuous joints and the root, also
        if the model has limits, and for a joint whose two limits are equal, which means
        that its URDF gives none.
        """
        i = np.flatnonzero(self.dof_indices >= 0)
        lower, upper = np.full(self.nv, -np.inf), np.full(self.nv, np.inf)
        lower[i] = self.model.lowerPositionLimit[self.dof_indices[i]]
        upper[i] = self.model.upperPositionLimit[self.dof_indices[i]]
        none, largest = lower >= upper, np.finfo(float).max  # Pinocchio's: unlimited
        lower[none | (lower <= -largest)] = -np.inf
        upper[none | (upper >= largest)] = np.inf
        return lower, upper

    def check_configuration(self, q: ArrayLike) -> Array:
        """Return q as a float array of shape (nq,) after checking that it is valid.

        Raises:
            ShapeError: If its shape is not (nq,).
            NonFiniteError: If it contains NaN or inf.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        configuration = self._finite(q, self.nq, "configuration q")
        for start, size in self.unit_blocks:
            block = configuration[start : start + size]
            norm = float(np.linalg.norm(block))
            if abs(norm - 1.0) > 1e-6:
                kind = "(cos, sin) pair" if size == 2 else "quaternion"
                raise ConfigurationError(
                    f"q[{start}:{start + size}] = {block.tolist()} is a {kind} "
                    f"of norm {norm:.6g}; needs norm 1"
                )
        return configuration

    def check_tangent(self, vector: ArrayLike, what: str) -> Array:
        """Return a velocity, acceleration or effort as a float array of shape (nv,).

        Args:
            vector: The numbers.
            what: Their name, for messages.

        Raises:
            ShapeError: If the shape is not (nv,).
            NonFiniteError: If it contains NaN or inf.
        """
        return self._finite(vector, self.nv, what)

    def _finite(self, vector: ArrayLike, size: int, what: str) -> Array:
        """Return numbers as doubles (size,); ``what`` is their name in messages."""
        try:
            array = np.asarray(vector)
            if array.dtype.kind not in "fiu" and array.size:
                raise TypeError  # complex numbers, booleans, text, objects
            array = array.astype(float)
        except (TypeError, ValueError):
            text = f"{vector!r}"
            dtype = getattr(vector, "dtype", None)
            kind = getattr(dtype, "name", type(vector).__name__)
            raise ShapeError(
                f"{what} is {text[:60]}{'...' * (len(text) > 60)} ({kind}); needs "
                f"{size} numbers"
            ) from None
        if array.shape != (size,):
            sizes = f" (nq = {self.nq}, nv = {self.nv})" if self.nq != self.nv else ""
            raise ShapeError(
                f"{what} has shape {array.shape}; {self.name} needs ({size},){sizes}"
            )
        for bad in np.flatnonzero(~np.isfinite(array)):
            raise NonFiniteError(f"{what}[{bad}] is {array[bad]}; needs finite numbers")
        return array

    def is_single_dof(self) -> Flags:
        """Return a mask of the degrees of freedom of single-dof joints, shape (nv,)."""
        mask = np.zeros(self.nv, dtype=bool)
        mask[self.single_dof_joints[:, 0]] = True
        return mask

    def per_dof(self, value: ArrayLike) -> Array:
        """Return a setting per dof (nv,); one number is for single-dof joints.

        Raises:
            SimulationError: If it is neither one number nor nv numbers.
        """
        array = np.asarray(value, dtype=float)
        if array.shape not in ((), (self.nv,)):
            raise SimulationError(
                f"has shape {array.shape}; needs one number, or one for each of the "
                f"{self.nv} degrees of freedom of {self.name}"
            )
        return np.where(self.is_single_dof(), array, 0.0) if array.ndim == 0 else array

    # -- names ------------------------------------------------------------------------

    def frame_id(self, name: str) -> int:
        """Return the index of a frame in the Pinocchio model.

        Raises:
            FrameNotFoundError: If there is no such frame; the message suggests one.
        """
        try:
            return self._frame_ids[name]
        except (KeyError, TypeError):  # also objects that are no names, such as a list
            raise FrameNotFoundError(
                f"no frame {name!r}{did_you_mean(name, self.frame_names)} "
                f"(the model has {listing(self.frame_names)})"
            ) from None

    def velocity_index(self, joint: str) -> slice:
        """Return the indices of a joint's degrees of freedom in v.

        Raises:
            JointNotFoundError: If there is no moving joint with this name.
        """
        if not isinstance(joint, str) or joint not in self.joints:
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


def _floats(joint: Any) -> bool:
    return bool(joint.shortname() == "JointModelFreeFlyer")


def _is_ball(joint: Any) -> bool:
    return bool(joint.shortname() == "JointModelSpherical")


def _slides(joint: Any) -> bool:
    kinds = "JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismatic"
    return bool(joint.shortname().startswith(kinds))


def _dof_labels(joint: Any) -> tuple[str, ...]:
    """Return suffixes of the names of a joint's degrees of freedom; of one: empty."""
    if joint.nv == 1:
        return ("",)
    if _is_ball(joint):
        return "roll", "pitch", "yaw"
    if joint.shortname() == "JointModelTranslation":
        return "x", "y", "z"
    roots = {3: ("x", "y", "yaw"), 6: ("x", "y", "z", "roll", "pitch", "yaw")}
    return roots.get(joint.nv, tuple(map(str, range(joint.nv))))


def _coordinates(joint: Any) -> list[tuple[int, int, int]]:
    """Return (index in v, start in q, size in q) of each separate coordinate."""
    if joint.nv == 1:
        return [(joint.idx_v, joint.idx_q, joint.nq)]
    if joint.nq != joint.nv:  # a ball, a plane, a root
        return []
    return [(joint.idx_v + k, joint.idx_q + k, 1) for k in range(joint.nv)]


def _unit_block(joint: Any) -> tuple[int, int]:
    """Return start and size of a joint's (cos, sin) pair or quaternion in q."""
    size = 2 if joint.nv in {1, 3} and not _is_ball(joint) else 4
    return joint.idx_q + joint.nq - size, size
