"""The sampled control loop of a linear error: its transition over one period."""

from dataclasses import dataclass, field

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.elastic_joint import ElasticJoint


@dataclass(frozen=True)
class LinearLoop:
    """The loop x'' = u, held over a period h, with u = -Kp x - Kv x' - Ki ∫x.

    x is the error of a task, or that of the null space, with Kp = K_N A, Kv = K_N + A
    for a field g of slope -A. The loop includes delays and compensators, in the order
    of `Command`. The robot equals its model, or performs a part of each acceleration.
    """

    kp: Array  # Kp, shape (m, m) [1/s²]
    kv: Array  # Kv, shape (m, m) [1/s]
    ki: Array  # Ki, shape (m, m) [1/s³]
    period: float  # h [s]
    effort_delay: int = 0  # delay of efforts, in periods
    sensor_delay: int = 0  # delay of measurements, in periods
    # what counts: velocity filter, predictor, momentum observer; integral action is ki
    compensation: Compensation = field(default_factory=Compensation)
    # part of u that the robot performs: below 1 where it is heavier than its model; a
    # matrix, shape (m, m), where that differs with the direction
    share: float | Array = 1.0
    # elastic joint that performs u; None: a rigid one
    joint: ElasticJoint | None = None

    def transition(self) -> Array:
        """Return the transition matrix over one period, of the robot and all memory."""
        m, own = len(self.kp), self.compensation
        ahead = 0 if own.predictor is None else own.predictor.periods
        moving = 2 if self.joint is None else 4
        # x, v, and those of an elastic joint's motor; ∫x, r, the last momentum; the
        # filter's memory; the efforts sent, for the observer and the predictor; the
        # efforts and measurements under way.
        counts = [moving, 3, 4, 1 + ahead, self.effort_delay, 2 * self.sensor_delay]
        size = m * sum(counts)
        basis = np.eye(size).reshape(-1, m, size)
        parts = np.split(basis, np.cumsum(counts)[:-1])
        after = self._step(*([*part] for part in parts))
        return np.concatenate(after).reshape(size, size)

    def radius(self) -> float:
        """Return the spectral radius: the loop is stable if it is below 1."""
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
        """Return all states one period later, in the order of the arguments."""
        (z, r, momentum), h, own = memory, self.period, self.compensation
        on_motor = self.joint is not None and self.joint.measured == "motor"
        sensors = [*sensors, *(plant[2:] if on_motor else plant[:2])]
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
        u = -self.kp @ x_seen - self.kv @ v_seen - self.ki @ z
        if own.momentum_observer is not None and own.momentum_observer.cancel:
            u = u - r
        integrated = np.any(self.ki != 0.0, axis=0, keepdims=True).T
        z = np.where(integrated, z + h * x_seen, 0.0)
        drives = [*drives, u]
        plant = self._after(plant, self._performed(drives[0]))
        rest = [*past, *sent[1:], u, *drives[1:], *sensors]
        return [each[None] for each in (*plant, z, r, momentum, *rest)]

    def _after(self, plant: list[Array], u: Array) -> list[Array]:
        """Return the plant's state one period later, under the acceleration u."""
        if self.joint is None:
            return [*_moved(plant[0], plant[1], u, self.period)]
        transition, effect = self.joint.transition(self.period)
        moved = np.tensordot(transition, np.array(plant), axes=1)
        return [*(moved + effect[:, None, None] * u)]

    def _performed(self, u: Array) -> Array:
        """Return the acceleration that the robot performs where u is asked for."""
        share = np.asarray(self.share)
        return share @ u if share.ndim else share * u


def _moved(x: Array, v: Array, u: Array, h: float) -> tuple[Array, Array]:
    return x + h * v + 0.5 * h * h * u, v + h * u


def _coupled(A: Array) -> Array:
    """Return the matrix without states that are never written or never read.

    Such states only add eigenvalues of 0. A loop without compensators and delays uses a
    sixth of all states.
    """
    while not (used := A.any(axis=0) & A.any(axis=1)).all():
        A = A[np.ix_(used, used)]
    return A
