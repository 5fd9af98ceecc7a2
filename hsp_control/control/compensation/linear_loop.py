"""The sampled loop of one linear mode: what a period of it makes of its state."""

from dataclasses import dataclass, field

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.compensation import Compensation


@dataclass(frozen=True)
class LinearLoop:
    """x'' = u held over a period h, u = -Kp x - Kv x' - Ki ∫x, and all that is between.

    That is a task's error, and the null space with Kp = K_N A, Kv = K_N + A for a field
    g of slope -A: `Command` is followed link by link, on a model that is exact, or of
    whose accelerations the robot does a part.

    Attributes:
        kp: Kp, shape (m, m) [1/s²].
        kv: Kv, shape (m, m) [1/s].
        ki: Ki, shape (m, m) [1/s³].
        period: h [s].
        effort_delay: Periods that an effort comes late.
        sensor_delay: Periods that a measurement is old.
        compensation: What of it acts on a linear mode: the velocity filter, the
            predictor and the momentum observer.
        share: The part of u that the robot does: below 1 where it is heavier than its
            model.
    """

    kp: Array
    kv: Array
    ki: Array
    period: float
    effort_delay: int = 0
    sensor_delay: int = 0
    compensation: Compensation = field(default_factory=Compensation)
    share: float = 1.0

    def transition(self) -> Array:
        """Return the matrix of one period, on everything that is remembered."""
        m, own = len(self.kp), self.compensation
        ahead = 0 if own.predictor is None else own.predictor.periods
        # x, v; ∫x, r, the last momentum; the filter's past; what was sent, for the
        # observer and the predictor; what is still in the drives and in the sensors.
        counts = [2, 3, 4, 1 + ahead, self.effort_delay, 2 * self.sensor_delay]
        size = m * sum(counts)
        basis = np.eye(size).reshape(-1, m, size)
        parts = np.split(basis, np.cumsum(counts)[:-1])
        after = self._step(*([*part] for part in parts))
        return np.concatenate(after).reshape(size, size)

    def radius(self) -> float:
        """Return the spectral radius: below 1 all dies, above it something grows."""
        return float(np.abs(np.linalg.eigvals(_coupled(self.transition()))).max())

    def _step(
        self,
        plant: list[Array],
        memory: list[Array],
        past: list[Array],
        sent: list[Array],
        drives: list[Array],
        sensors: list[Array],
    ) -> list[Array]:
        """Return everything after a period, in the order of the arguments."""
        (x, v), (z, r, momentum), h, own = plant, memory, self.period, self.compensation
        sensors = [*sensors, x, v]
        x_seen, v_seen, sensors = sensors[0], sensors[1], sensors[2:]
        if own.velocity_filter is not None:
            v_seen, kept = own.velocity_filter.step(v_seen, tuple(past), h)
            past = [*kept]
        else:
            past = [0.0 * each for each in past]
        if own.momentum_observer is not None:
            disturbance = (v_seen - momentum) / h - sent[0]
            share = 1.0 - np.exp(-own.momentum_observer.bandwidth * h)
            r = r + share * (disturbance - r)
            momentum = v_seen
        else:
            r, momentum = 0.0 * r, 0.0 * momentum
        for u in sent[1:]:
            x_seen, v_seen = _moved(x_seen, v_seen, u + r, h)
        u = -self.kp @ x_seen - self.kv @ v_seen - self.ki @ z - r
        z = z + h * x_seen if self.ki.any() else 0.0 * z
        drives = [*drives, u]
        x, v = _moved(x, v, self.share * drives[0], h)
        rest = [*past, *sent[1:], u, *drives[1:], *sensors]
        return [each[None] for each in (x, v, z, r, momentum, *rest)]


def _moved(x: Array, v: Array, u: Array, h: float) -> tuple[Array, Array]:
    return x + h * v + 0.5 * h * h * u, v + h * u


def _coupled(A: Array) -> Array:
    """Return a matrix without what is never written or never read.

    Its eigenvalues are 0, and those of the rest are the others: a loop without
    compensation and delays uses a sixth of what it could remember.
    """
    while not (used := A.any(axis=0) & A.any(axis=1)).all():
        A = A[np.ix_(used, used)]
    return A
