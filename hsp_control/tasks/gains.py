"""Feedback gains of a task: e'' + Kv e' + Kp e = 0."""

from dataclasses import KW_ONLY

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import GainError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Gain


class Gains(Part, error=GainError):
    """e'' + Kv e' + Kp e = 0: stiffness and damping, or frequency and damping ratio.

    A gain is a number, one number per row of the task, or (not ω0 and ζ) a full
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
        """Check that the gains are given in one way, and positive."""
        stiff = self.kp is not None or self.kv is not None
        if stiff and not (
            self.natural_frequency is None and self.damping_ratio is None
        ):
            raise GainError(
                "give either kp and kv, or natural_frequency and damping_ratio"
            )
        if stiff and (self.kp is None or self.kv is None):
            raise GainError("give both kp and kv, or natural_frequency; one is missing")
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
        for name in ("natural_frequency", "damping_ratio"):
            given = getattr(self, name)
            if given is not None and np.ndim(given) and len(given) != rows:
                raise GainError(
                    f"{name} has {len(given)} entries; needs a number, or {rows}"
                )
        Kp = as_matrix(kp, rows, "kp")
        Kv = as_matrix(kv, rows, "kv")
        check_decay(Kp, Kv)
        return Kp, Kv


def check_decay(Kp: Array, Kv: Array) -> None:
    """Check that e'' + Kv e' + Kp e = 0 is stable, shapes (m, m)."""
    zero, one = np.zeros_like(Kp), np.eye(len(Kp))
    slowest = float(np.linalg.eigvals(np.block([[zero, one], [-Kp, -Kv]])).real.max())
    if slowest >= 0.0:
        raise GainError(
            "with these gains the error does not decay: e'' + Kv e' + Kp e = 0 has "
            f"an eigenvalue with real part {slowest:.3g} 1/s; needs less than 0"
        )


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
    """Return a gain as an array of 0, 1 or 2 dimensions; its diagonal is positive."""
    gain = as_numbers(value, name)
    diagonal = np.diag(gain) if gain.ndim == 2 else gain.reshape(-1)
    if diagonal.min() <= 0.0:
        place = [int(diagonal.argmin())] * gain.ndim
        where = f"{name}{place}" if place else name
        raise GainError(f"{where} is {diagonal.min():g}; must be greater than 0")
    return gain


def as_numbers(value: ArrayLike, name: str) -> Array:
    """Return a number, one per row, or a square matrix, as an array."""
    try:
        if isinstance(value, str) or np.asarray(value).dtype == bool:
            raise TypeError
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
    return gain
