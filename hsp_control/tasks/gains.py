"""Gains of a task, e'' + Kv e' + Kp e = 0, or its mechanical impedance."""

from dataclasses import KW_ONLY
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import GainError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import ArrayField, Gain, Positive, read_only


class Gains(Part, error=GainError):
    """e'' + Kv e' + Kp e = 0: stiffness and damping, or frequency and damping ratio.

    Each gain is a number, one number for each row of the task, or (not ω0 and ζ) a full
    matrix.
    """

    kp: Gain | None = None
    """Stiffness Kp [1/s²], together with `kv`."""
    kv: Gain | None = None
    """Damping Kv [1/s], together with `kp`."""
    _: KW_ONLY
    natural_frequency: Gain | None = None
    """ω0 [rad/s], instead of kp and kv: Kp = ω0², Kv = 2 ζ ω0."""
    damping_ratio: Gain | None = None
    """ζ [-]; 1, critical damping, by default."""

    def __post_init__(self) -> None:
        """Check that the gains are given one way, and positive."""
        stiff = self.kp is not None or self.kv is not None
        if stiff and not (
            self.natural_frequency is None and self.damping_ratio is None
        ):
            raise GainError(
                "give either kp and kv, or natural_frequency and damping_ratio"
            )
        if stiff and (self.kp is None or self.kv is None):
            raise GainError("give both kp and kv; one of them is missing")
        if not stiff and self.natural_frequency is None:
            raise GainError("give either kp and kv, or natural_frequency")
        self._pair()

    def _pair(self) -> tuple[Array, Array]:
        """Return Kp and Kv, each of shape (), (m,) or (m, m)."""
        if self.kp is not None and self.kv is not None:
            return as_gain(self.kp, "kp"), as_gain(self.kv, "kv")
        assert self.natural_frequency is not None
        frequency = as_gain(self.natural_frequency, "natural_frequency")
        ratio = 1.0 if self.damping_ratio is None else self.damping_ratio
        damping = as_gain(ratio, "damping_ratio")
        if frequency.ndim > 1 or damping.ndim > 1:
            raise GainError(
                "natural_frequency and damping_ratio must be numbers or lists"
            )
        if frequency.ndim and damping.ndim and len(frequency) != len(damping):
            raise GainError(
                f"natural_frequency has {len(frequency)} entries, damping_ratio "
                f"{len(damping)}"
            )
        return frequency**2, 2.0 * damping * frequency

    def matrices(self, rows: int) -> tuple[Array, Array]:
        """Return Kp and Kv as matrices of shape (rows, rows)."""
        kp, kv = self._pair()
        Kp = as_matrix(kp, rows, "kp")
        Kv = as_matrix(kv, rows, "kv")
        companion = np.block([[np.zeros((rows, rows)), np.eye(rows)], [-Kp, -Kv]])
        slowest = float(np.linalg.eigvals(companion).real.max())
        if slowest >= 0.0:
            raise GainError(
                "with these gains the error does not decay: e'' + Kv e' + Kp e = 0 has "
                f"an eigenvalue with real part {slowest:.3g} 1/s; needs less than 0"
            )
        return Kp, Kv


def as_matrix(gain: Array, size: int, name: str) -> Array:
    """Return a scalar, per-row or matrix gain as a matrix of shape (size, size)."""
    if gain.ndim == 0:
        return np.asarray(np.eye(size) * gain)
    if gain.shape not in {(size,), (size, size)}:
        raise GainError(
            f"{name} has shape {gain.shape}; needs a number, {size} numbers or a "
            f"{size} × {size} matrix"
        )
    return np.diag(gain) if gain.ndim == 1 else gain.copy()


def as_gain(value: ArrayLike, name: str) -> Array:
    """Return a gain as an array of 0, 1 or 2 dimensions."""
    try:
        gain = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise GainError(
            f"{name} is {value!r}; needs numbers, a list or a matrix"
        ) from None
    if gain.size == 0:
        raise GainError(f"{name} is empty; needs numbers")
    if gain.ndim > 2 or (gain.ndim == 2 and gain.shape[0] != gain.shape[1]):
        raise GainError(f"{name} has shape {gain.shape}; a matrix gain must be square")
    if not np.isfinite(gain).all():
        raise GainError(f"{name} is {gain.tolist()}; needs finite numbers")
    smallest = float(np.diag(gain).min() if gain.ndim == 2 else gain.min())
    if smallest <= 0.0:
        raise GainError(f"{name} is {gain.tolist()}; must be greater than 0")
    return gain


Bound = Annotated[ArrayLike, ArrayField(Positive | list[Positive], read_only)]
"""A number, or one number for each row."""


class Impedance(Part, error=GainError):
    """Λ e'' + (½ Λ' + D) e' + K sat(e) = -f: a spring and a damper at a task.

    Λ(q) = (J M⁻¹ Jᵀ)⁻¹ is the inertia that the robot has at the task, and f the
    external force there. The robot's own inertia is kept, so no force has to be
    measured, and ½ e'ᵀΛe' plus the energy of the spring never grows by itself
    (docs/compliance.md).
    """

    stiffness: Gain
    """K [N/m or N·m/rad]: a number, one for each row, or a symmetric positive definite
    matrix. Forces are along the world's axes, moments along those of the desired frame.
    """
    _: KW_ONLY
    damping: Gain | None = None
    """D [N·s/m or N·m·s/rad], as the stiffness; instead of a ratio."""
    damping_ratio: Positive | None = None
    """ζ of every mode of the task's inertia and K [-]; 1, critical damping, by default.
    D then follows the inertia."""
    largest_error: Bound | None = None
    """Error at which the spring's force stops growing [m or rad], a number or one for
    each row; it needs a diagonal stiffness. Unlimited by default."""

    def __post_init__(self) -> None:
        """Check that the damping is given one way, and that energies are positive."""
        if self.damping is not None and self.damping_ratio is not None:
            raise GainError("give either damping or damping_ratio")
        stiffness = _definite(self.stiffness, "stiffness")
        if self.damping is not None:
            _definite(self.damping, "damping")
        if self.largest_error is not None:
            as_gain(self.largest_error, "largest_error")
            check_bounded(stiffness)

    def numbers(self, rows: int) -> Array:
        """Return K, D, ζ and 1/largest error, shape (2 rows + 2, rows), see `parts_of`.

        Numbers between those of two impedances are those of an impedance as well.
        """
        out = np.zeros((2 * rows + 2, rows))
        K, D, ratio, inverse_bound = parts_of(out)
        K[:] = as_matrix(as_gain(self.stiffness, "stiffness"), rows, "stiffness")
        if self.damping is not None:
            D[:] = as_matrix(as_gain(self.damping, "damping"), rows, "damping")
        else:
            ratio[:] = 1.0 if self.damping_ratio is None else self.damping_ratio
        if self.largest_error is not None:
            bound = as_gain(self.largest_error, "largest_error")
            inverse_bound[:] = 1.0 / np.diag(as_matrix(bound, rows, "largest_error"))
        return out


def parts_of(numbers: Array) -> tuple[Array, Array, Array, Array]:
    """Return views: K and D, shape (m, m), ζ and 1/largest error, shape (m,)."""
    m = numbers.shape[1]
    return numbers[:m], numbers[m : 2 * m], numbers[2 * m], numbers[2 * m + 1]


def check_bounded(stiffness: Array) -> None:
    """Check that a bounded force has an energy: its stiffness must be diagonal."""
    if stiffness.ndim == 2 and np.any(stiffness != np.diag(np.diag(stiffness))):
        raise GainError(
            "largest_error needs a diagonal stiffness: with "
            f"{stiffness.tolist()} the bounded force would have no energy"
        )


def _definite(value: ArrayLike, name: str) -> Array:
    """Return a number, a list or a matrix that is symmetric positive definite."""
    gain = as_gain(value, name)
    if gain.ndim == 2:
        if not np.allclose(gain, gain.T, rtol=1e-9, atol=0.0):
            raise GainError(f"{name} is {gain.tolist()}; a matrix must be symmetric")
        smallest = float(np.linalg.eigvalsh(gain).min())
        if smallest <= 0.0:
            raise GainError(
                f"{name} is {gain.tolist()}, with the eigenvalue {smallest:.3g}; a "
                "matrix must be positive definite"
            )
    return gain
