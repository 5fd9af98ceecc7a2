"""The effort that a step delivers, and the records that its calls write."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.control.actuation.limited_step import (
    EXACT,
    STATUSES,
    LimitedStep,
    QPOutcome,
    Status,
)


class Delivered(NamedTuple):
    """The delivered part of a law within the limits; the next step overwrites it."""

    effort: Array  # shape (nv,) [N·m or N], zero where there is no motor
    acceleration: Array  # shape (nv,) [rad/s² or m/s²]
    forces: Array  # contact forces in the axes of each contact, shape (size,) [N]
    status: Status
    relaxation: float  # largest violation of a relaxed limit [rad/s² or m/s²]


class DeliveredAlone(NamedTuple):
    """The delivered part of a step without Python: see `Actuation.calls_alone`."""

    a: Array  # acceleration, shape (nv,)
    tau: Array  # effort, shape (nv,) [N·m or N]
    status: Indices  # the `Status`, shape (1,)
    delivered: Indices  # whether there is a finite effort, shape (1,)

    @classmethod
    def allocate(cls, nv: int) -> Self:
        """Return a record before any step."""
        integers = np.zeros((2, 1), dtype=np.int64)
        return cls(np.zeros(nv), np.zeros(nv), *integers)


class Kept(NamedTuple):
    """Which part of a mixture was kept, shapes (1,)."""

    which: Indices  # 0: none, Python decides
    status: Indices  # the `Status` with active contacts


class CarriedStep:
    """Results of a step's calls with active contacts.

    Attributes:
        qp: The QP, solved where the law is not exact.
        exact: Whether the law's acceleration is delivered with the forces of minimum
            norm, shape (1,).
        redistribute: Whether it needs others, shape (1,).
        nearest: Whether it has to change, shape (1,).
        delivered: The delivered effort, and its status.
        forces: The forces, shape (p,) [N].
    """

    def __init__(self, qp: LimitedStep) -> None:
        """Allocate the arrays that the calls write."""
        self.qp = qp
        self.exact, self.redistribute, self.nearest = np.zeros((3, 1), dtype=np.int64)
        self.delivered = DeliveredAlone.allocate(len(qp.result.effort))
        self.forces = np.zeros_like(qp.result.forces)

    def result(self, a: Array, outcome: QPOutcome) -> Delivered:
        """Return the delivered effort for the law's acceleration a, shape (nv,)."""
        own, forces = self.delivered, self.forces
        if (number := own.status.item()) == 0:
            return Delivered(own.tau, a, forces, EXACT, 0.0)
        status, relaxation = STATUSES[number], self.relaxation(outcome)
        if status is not Status.REDISTRIBUTED:
            a = own.a
        return Delivered(own.tau, a, forces, status, relaxation)

    def relaxation(self, outcome: QPOutcome) -> float:
        """Return the largest violation of a relaxed limit [rad/s² or m/s²]."""
        if self.exact.item():
            return 0.0
        return np.inf if outcome.unsolved.item() else self.qp.found()[1]
