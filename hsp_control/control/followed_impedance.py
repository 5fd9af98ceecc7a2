"""An impedance that follows the planned one, and waits instead of adding energy.

With E = ½ e'ᵀΛe' + U(e), U the energy of the spring, and an external force f,

    E' = fᵀx' - e'ᵀ(D + D_ζ) e' + ∂U/∂t.

A spring that becomes stiffer while it is stretched stores additional energy. So
the values in force follow the planned ones only as fast as ∂U/∂t is at most
the power of the damping: E' <= fᵀx', to first order in the period. Where they
are behind, they catch up in half of the change's ramp, so that no effort jumps.
"""

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.engine import Call
from hsp_control.tasks.feedback import FeedbackInForce


class FollowedImpedance:
    """The numbers of one task's impedance, from one period to the next.

    Attributes:
        numbers: In force, shape (2 m + 2, m); see `Impedance.numbers`.
        planned: For the present time, likewise.
        then: For the end of the period, likewise.
        error: The task's error e, shape (m,).
        rate: e', shape (m,).
        period: [s], shape (1,).
        ramp: Duration of the change, shape (1,) [s].
        waits: Whether the numbers in force are not those that are planned, shape (1,).
        call: Lets the numbers in force be those of the next period.
    """

    def __init__(self, in_force: FeedbackInForce, ends: Indices) -> None:
        """Bind the numbers that are in force.

        Args:
            in_force: Of the task.
            ends: Ends of the parts of its error, shape (parts,).
        """
        self.numbers = in_force.numbers
        rows = self.numbers.shape[1]
        self.planned, self.then = self.numbers.copy(), self.numbers.copy()
        self.error, self.rate = np.zeros(rows), np.zeros(rows)
        self.period, self.ramp = np.zeros(1), np.zeros(1)
        self.waits = np.zeros(1, dtype=np.int64)
        self.call: Call = engine.FollowImpedance(
            numbers=self.numbers,
            planned=self.planned,
            then=self.then,
            ends=ends,
            G=in_force.mobility,
            e=self.error,
            e_dot=self.rate,
            period=self.period,
            ramp=self.ramp,
            waits=self.waits,
        )

    def move(
        self, planned: Array, then: Array, error: Array, rate: Array, period: float
    ) -> bool:
        """Advance to the next period; return whether the numbers in force wait."""
        self.planned[:], self.then[:] = planned, then
        self.error[:], self.rate[:], self.period[0] = error, rate, period
        self.call()
        return bool(self.waits[0])
