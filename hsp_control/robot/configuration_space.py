"""The configuration manifold of a robot, with tangent vectors of shape (nv,)."""

from collections.abc import Mapping, Sequence
from math import atan2
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import ConfigurationError, NonFiniteError, ShapeError
from hsp_control.common.kernels import kernel
from hsp_control.robot.description.loading import moving_joints


class ConfigurationSpace:
    """The configurations q of a robot, shape (nq,), and the operations on them.

    Attributes:
        name: The robot's name, for messages.
        model: The Pinocchio model.
        nq: Size of a configuration.
        nv: Size of a velocity: the number of degrees of freedom.
        joints: Pinocchio's models of the joints with degrees of freedom, by name, in
            the order of v.
        joint_names: Their names.
        dof_names: A name for each degree of freedom: that of its joint, or
            ``root_joint.x`` if the joint has several, ``neck.roll`` if it is a ball.
        units: The unit of each degree of freedom, ``rad`` or ``m``.
        single_dof_joints: (index in v, start in q, size in q) of every joint with one
            degree of freedom, shape (k, 3); the size is 2 for continuous joints.
        unit_blocks: (start, size) of every quaternion and (cos, sin) pair in q.
        flat: Whether every joint has one degree of freedom, so that δ' = v holds
            globally for q = base ⊕ δ.
        linear: Whether moreover q is a vector, so that q = base + δ.
        mimics: Whether some joints mimic others.
        unactuated: Indices in v that have no motor: those of a free-flyer root.
        dof_indices: Index in q of each degree of freedom's coordinate, shape (nv,); -1
            if it has none of its own (roots, continuous joints).
    """

    def __init__(
        self, model: pin.Model, name: str, home: Sequence[float] | None = None
    ) -> None:
        """Set up the space of a model, with the robot's name for messages.

        ``home`` is the displacement from neutral (nv,) of the home posture, ignored if
        it has another size.
        """
        self.model = model
        self.name = name
        self.nq: int = model.nq
        self.nv: int = model.nv
        self.joints = moving_joints(model)
        self.joint_names: tuple[str, ...] = tuple(self.joints)
        self.dof_names: tuple[str, ...] = _dof_names(self.joints)
        self.units: tuple[str, ...] = _units(self.joints)
        self.single_dof_joints: Indices = np.array(
            [(j.idx_v, j.idx_q, j.nq) for j in self.joints.values() if j.nv == 1],
            dtype=np.int64,
        ).reshape(-1, 3)
        self.unit_blocks: tuple[tuple[int, int], ...] = _unit_blocks(self.joints)
        self.flat: bool = all(joint.nv == 1 for joint in self.joints.values())
        self.linear: bool = self.flat and self.nq == self.nv
        self.mimics: bool = model.nvExtended != model.nv
        self.unactuated: tuple[int, ...] = tuple(
            joint.idx_v + k
            for joint in self.joints.values()
            if joint.shortname() == "JointModelFreeFlyer"
            for k in range(6)
        )
        own = np.full(self.nv, -1, dtype=np.int64)
        for joint in self.joints.values():
            if joint.nq == joint.nv == 1:
                own[joint.idx_v] = joint.idx_q
        self.dof_indices: Indices = own
        fits = home is not None and len(home) == self.nv
        self._home = np.array(home) if fits else None
        if self._home is not None:  # some SRDFs give postures beyond the limits
            self._home = np.clip(self._home, *self.position_limits())

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
        for joint in self.joints.values():
            if joint.shortname() == "JointModelFreeFlyer":
                quaternion = rng.standard_normal(4)
                q[joint.idx_q : joint.idx_q + 3] = rng.uniform(-1.0, 1.0, 3)
                q[joint.idx_q + 3 : joint.idx_q + 7] = quaternion / np.linalg.norm(
                    quaternion
                )
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
            ShapeError: If the arguments are not nq numbers each.
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

        They are ±inf where there is no limit: for continuous joints and the root,
        whatever the model says, and for a joint whose two limits are equal, which
        means that its URDF gives none.
        """
        lower = np.full(self.nv, -np.inf)
        upper = np.full(self.nv, np.inf)
        for joint in self.joints.values():
            if joint.nq == 1 and joint.nv == 1:
                low = self.model.lowerPositionLimit[joint.idx_q]
                high = self.model.upperPositionLimit[joint.idx_q]
                if low < high:
                    lower[joint.idx_v], upper[joint.idx_v] = low, high
        largest = np.finfo(float).max  # Pinocchio's value for unlimited
        lower[lower <= -largest] = -np.inf
        upper[upper >= largest] = np.inf
        return lower, upper

    def check_configuration(self, q: ArrayLike) -> Array:
        """Return q as a float array of shape (nq,) after checking that it is valid.

        Raises:
            ShapeError: If its shape is not (nq,).
            NonFiniteError: If it contains NaN or inf.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        configuration = _check_vector(q, self.nq, "configuration q", self)
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
        return _check_vector(vector, self.nv, what, self)


def _units(joints: Mapping[str, Any]) -> tuple[str, ...]:
    roots = {3: ("m", "m", "rad"), 6: ("m", "m", "m", "rad", "rad", "rad")}
    units: list[str] = []
    for joint in joints.values():
        prismatic = joint.shortname().startswith(
            ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismatic")
        )
        single = ("m",) if prismatic else ("rad",)
        several = roots.get(joint.nv, single * joint.nv)
        units.extend(("rad",) * 3 if _is_ball(joint) else several)
    return tuple(units)


def _unit_blocks(joints: Mapping[str, Any]) -> tuple[tuple[int, int], ...]:
    blocks = []
    for joint in joints.values():
        if joint.nq == joint.nv + 1:
            size = 2 if joint.nv in {1, 3} else 4
            if _is_ball(joint):
                size = 4
            blocks.append((joint.idx_q + joint.nq - size, size))
    return tuple(blocks)


def _is_ball(joint: Any) -> bool:
    return bool(joint.shortname() == "JointModelSpherical")


def _dof_names(joints: Mapping[str, Any]) -> tuple[str, ...]:
    suffixes = {3: ("x", "y", "yaw"), 6: ("x", "y", "z", "roll", "pitch", "yaw")}
    names: list[str] = []
    for name, joint in joints.items():
        if joint.nv == 1:
            names.append(name)
        elif _is_ball(joint):
            names.extend(f"{name}.{label}" for label in ("roll", "pitch", "yaw"))
        else:
            labels = suffixes.get(joint.nv, tuple(str(k) for k in range(joint.nv)))
            names.extend(f"{name}.{label}" for label in labels)
    return tuple(names)


def as_numbers(
    vector: ArrayLike, size: int, what: str, space: ConfigurationSpace
) -> Array:
    """Return numbers as doubles (size,); ``what`` is their name in messages."""
    try:
        array = np.asarray(vector)
        if array.dtype.kind not in "fiu" and array.size:
            raise TypeError  # complex numbers, booleans, text, objects
        array = array.astype(float)
    except (TypeError, ValueError):
        shown = f"{vector!r}"
        kind = getattr(getattr(vector, "dtype", None), "name", type(vector).__name__)
        raise ShapeError(
            f"{what} is {shown[:60]}{'...' * (len(shown) > 60)} ({kind}); needs {size} "
            "numbers"
        ) from None
    if array.shape != (size,):
        raise ShapeError(
            f"{what} has shape {array.shape}; {space.name} needs ({size},)"
            + (f" (nq = {space.nq}, nv = {space.nv})" if space.nq != space.nv else "")
        )
    return array


def _check_vector(
    vector: ArrayLike, size: int, what: str, space: ConfigurationSpace
) -> Array:
    array = as_numbers(vector, size, what, space)
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise NonFiniteError(
            f"{what}[{bad[0]}] is {array[bad[0]]}; needs finite numbers"
        )
    return array


@kernel
def joint_displacements(
    q: Array, reference: Array, single_dof_joints: Indices, out: Array
) -> None:
    """Write q ⊖ reference for single-dof joints; continuous joints are within ±π."""
    for k in range(single_dof_joints.shape[0]):
        i, at, size = (
            single_dof_joints[k, 0],
            single_dof_joints[k, 1],
            single_dof_joints[k, 2],
        )
        if size == 1:
            out[i] = q[at] - reference[at]
        else:  # (cos, sin)
            c, s, c_ref, s_ref = q[at], q[at + 1], reference[at], reference[at + 1]
            out[i] = atan2(s * c_ref - c * s_ref, c * c_ref + s * s_ref)
