"""Mechanical impedance of a task: stiffness and damping, without inertia shaping."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import GainError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Positive, Semidefinite
from hsp_control.robot import Robot
from hsp_control.tasks.feedback import ErrorPart, LargestError, each_part
from hsp_control.tasks.gains import as_matrix, as_numbers

_ROUNDING = 1e-9
"""Relative rounding errors of a matrix that was typed or rotated."""


class Impedance(Part, error=GainError):
    """Λ e'' + (½ Λ' + D) e' + s(e) = -f: a spring and a damper at a task.

    s(e) = K e, up to the spring's largest force.

    Λ(q) = (J M⁻¹ Jᵀ)⁻¹ is the robot's inertia at the task, and f the external force
    there. The inertia is not shaped, so no force has to be measured, and ½ e'ᵀΛe' plus
    the energy of the spring never grows without external work (docs/compliance.md).
    """

    stiffness: Semidefinite
    """K [N/m or N·m/rad]: a number, one per row, or a symmetric matrix without
    negative eigenvalues; along a direction of stiffness 0 the hand can be guided.
    Forces are along the world's axes, moments along those of the desired frame.
    """
    _: KW_ONLY
    damping: Semidefinite | None = None
    """D [N·s/m or N·m·s/rad], as the stiffness; instead of a ratio. Every stiff
    direction must be damped."""
    damping_ratio: Positive | None = None
    """ζ of every mode of the task's inertia and K [-]; 1, critical damping, by default.
    D then depends on the inertia. It damps no direction without stiffness."""
    largest_force: LargestError = "robot"
    """Largest force and moment of the spring [N or N·m]: beyond it the spring slips, so
    that the force of a target far away, or out of reach, is bounded. One number, or one
    for each part of the error; "none": no bound. By default the robot's
    (`Robot.spring_force`), and none for joints."""

    def __post_init__(self) -> None:
        """Check that the damping is given one way, and that energies are positive."""
        if self.damping is not None and self.damping_ratio is not None:
            raise GainError("give either damping or damping_ratio")
        K = _not_negative(self.stiffness, "stiffness")
        if self.damping is not None:
            D = _not_negative(self.damping, "damping")
            _check_damped(K, D)
        elif not K.any():
            raise GainError(
                "stiffness is 0 in every direction, where a damping ratio damps "
                "nothing; give damping, or remove the task"
            )

    def placed(self, parts: Sequence[ErrorPart], robot: Robot) -> Self:
        """Return the impedance with its largest force in numbers.

        Raises:
            GainError: If there is neither one number nor one per part.
        """
        own = dict(zip(("m", "rad"), robot.spring_force, strict=True))
        with within("largest_force"):
            found = each_part(self.largest_force, parts, own, GainError)
        changes: dict[str, Any] = {"largest_force": found}
        return replace(self, **changes)

    def numbers(self, parts: Sequence[ErrorPart]) -> Array:
        """Return K, D, ζ and 1/largest force in one array.

        Interpolated numbers of two impedances are those of an impedance, too, so that
        one may change into the other. `parts_of` is the inverse.
        """
        rows = sum(part.size for part in parts)
        out = np.zeros((2 * rows + 2, rows))
        K, D, ratio, inverse_force = parts_of(out)
        K[:] = as_matrix(as_numbers(self.stiffness, "stiffness"), rows, "stiffness")
        if self.damping is not None:
            D[:] = as_matrix(as_numbers(self.damping, "damping"), rows, "damping")
        else:
            ratio[:] = 1.0 if self.damping_ratio is None else self.damping_ratio
        if isinstance(self.largest_force, tuple):  # before it is placed it has no bound
            sizes = [part.size for part in parts]
            each = [
                0.0 if force is None else 1.0 / force for force in self.largest_force
            ]
            inverse_force[:] = np.repeat(each, sizes)
        return out


class ImpedanceParts(NamedTuple):
    """The numbers of an impedance, as one argument of a call."""

    K: Array  # stiffness, symmetric, shape (m, m) [N/m or N·m/rad]
    D: Array  # damping, symmetric, shape (m, m) [N·s/m or N·m·s/rad]
    ratio: Array  # ζ, the same for all rows, shape (m,) [-]
    # 1/largest force of each row, shape (m,) [1/N or 1/(N·m)]; 0 for no bound
    inverse_force: Array


def parts_of(numbers: Array) -> ImpedanceParts:
    """Return views of the numbers of `Impedance.numbers`."""
    m = numbers.shape[1]
    K, D, rest = numbers[:m], numbers[m : 2 * m], numbers[2 * m :]
    return ImpedanceParts(K, D, rest[0], rest[1])


def _not_negative(value: ArrayLike, name: str) -> Array:
    """Return a number, a list or a symmetric matrix, without negative eigenvalues.

    Raises:
        GainError: If it is not.
    """
    gain = as_numbers(value, name)
    if gain.ndim == 2:
        if not np.allclose(gain, gain.T, rtol=1e-9, atol=0.0):
            raise GainError(f"{name} is {gain.tolist()}; a matrix must be symmetric")
        eigenvalues = np.linalg.eigvalsh(gain)
        if eigenvalues[0] < -_ROUNDING * eigenvalues[-1]:
            raise GainError(
                f"{name} is {gain.tolist()}, with the eigenvalue {eigenvalues[0]:.3g}; "
                "no eigenvalue may be negative"
            )
    elif gain.min() < 0.0:
        raise GainError(f"{name} is {gain.tolist()}; must not be negative")
    return gain


def _check_damped(K: Array, D: Array) -> None:
    """Check that every direction of a spring is damped, so that none oscillates."""
    size = max(K.shape[0] if K.ndim else 1, D.shape[0] if D.ndim else 1)
    if {len(each) for each in (K, D) if each.ndim} - {size}:
        return  # of different sizes, which the task reports
    stiff, damped = as_matrix(K, size, "stiffness"), as_matrix(D, size, "damping")
    values, directions = np.linalg.eigh(damped)
    free = directions[:, values <= _ROUNDING * max(values[-1], 0.0)]
    if np.abs(stiff @ free).max(initial=0.0) > _ROUNDING * np.abs(stiff).max():
        raise GainError(
            f"damping is {D.tolist()}: it does not damp all that the stiffness "
            f"{K.tolist()} moves; give damping there, or a damping_ratio"
        )
