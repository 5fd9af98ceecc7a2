"""Feedback gains of a task: e'' + Kv e' + Kp e = 0."""

from typing import Any, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import GainError


class Gains:
    """e'' + Kv e' + Kp e = 0: stiffness Kp [1/s²] and damping Kv [1/s] of a task.

    Each is a number, one number per row of the task, or a full matrix.

    Attributes:
        kp: Stiffness as given, shape (), (m,) or (m, m) [1/s²].
        kv: Damping as given, shape (), (m,) or (m, m) [1/s].
    """

    def __init__(self, kp: Any, kv: Any) -> None:
        """Set the gains.

        Args:
            kp: Stiffness Kp > 0 [1/s²]: scalar, shape (m,) or (m, m).
            kv: Damping Kv > 0 [1/s]: scalar, shape (m,) or (m, m).

        Raises:
            GainError: If a gain is not positive (a matrix: on its diagonal), not
                finite, or has another shape.
        """
        self.kp = as_gain(kp, "kp")
        self.kv = as_gain(kv, "kv")

    @classmethod
    def from_frequency(cls, natural_frequency: Any, damping_ratio: Any = 1.0) -> Self:
        """Return the gains Kp = ω0², Kv = 2 ζ ω0.

        Args:
            natural_frequency: ω0 > 0 [rad/s]: scalar or shape (m,).
            damping_ratio: ζ > 0 [-]: scalar or shape (m,); 1 is critically damped.

        Raises:
            GainError: If either is not positive, or is a matrix.
        """
        frequency = as_gain(natural_frequency, "natural_frequency")
        ratio = as_gain(damping_ratio, "damping_ratio")
        if frequency.ndim > 1 or ratio.ndim > 1:
            raise GainError(
                "natural_frequency and damping_ratio must be numbers or lists"
            )
        try:
            return cls(frequency**2, 2.0 * ratio * frequency)
        except ValueError as error:
            raise GainError(f"natural_frequency and damping_ratio: {error}") from error

    def __repr__(self) -> str:
        return f"Gains(kp={self.kp.tolist()}, kv={self.kv.tolist()})"

    def matrices(self, rows: int) -> tuple[Array, Array]:
        """Return Kp and Kv as matrices of shape (rows, rows).

        Raises:
            GainError: If a gain has another size, or the solution of
                e'' + Kv e' + Kp e = 0 does not decay.
        """
        Kp = as_matrix(self.kp, rows, "kp")
        Kv = as_matrix(self.kv, rows, "kv")
        companion = np.block([[np.zeros((rows, rows)), np.eye(rows)], [-Kp, -Kv]])
        slowest = float(np.linalg.eigvals(companion).real.max())
        if slowest >= 0.0:
            raise GainError(
                "with these gains the error does not decay: e'' + Kv e' + Kp e = 0 has "
                f"an eigenvalue with real part {slowest:.3g} 1/s; needs less than 0"
            )
        return Kp, Kv


def as_matrix(gain: Array, size: int, name: str) -> Array:
    """Return a scalar, per-row or matrix gain as a matrix of shape (size, size).

    Raises:
        GainError: If a list or a matrix has another size.
    """
    if gain.ndim == 0:
        return np.asarray(np.eye(size) * gain)
    if gain.shape not in {(size,), (size, size)}:
        raise GainError(
            f"{name} has shape {gain.shape}; needs a number, {size} numbers or a "
            f"{size} × {size} matrix"
        )
    return np.diag(gain) if gain.ndim == 1 else gain.copy()


def as_gain(value: Any, name: str) -> Array:
    """Return a gain as an array of 0, 1 or 2 dimensions.

    Raises:
        GainError: If it is not numeric, empty, a matrix that is not square, not finite,
            or not positive (a matrix: on its diagonal).
    """
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
