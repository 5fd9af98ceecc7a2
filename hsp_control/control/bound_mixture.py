"""A step of several sets of tasks or of limits that are mixed, as one call."""

from collections.abc import Sequence

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation, Delivered
from hsp_control.control.actuation.limited_step import EXACT, LIMITED
from hsp_control.engine import Plan
from hsp_control.engine.plans import PartCall, Step, planned


class BoundMixture:
    """The law of each set of tasks within each set of limits, and the weighted mean.

    It is one call, where each part is M a + N or the solution of one QP. Elsewhere
    `Mixture` makes the step, part by part.

    Attributes:
        stacks: The sets of tasks, in order of the mixture.
    """

    def __init__(
        self,
        effort: Array,
        stacks: Sequence[ActiveStack],
        actuations: Sequence[Actuation],
    ) -> None:
        """Bind the calls.

        Args:
            effort: Where M a + N is written, shape (nv,) [N·m or N].
            stacks: The sets of tasks.
            actuations: The actuations of the law of each of them, within each set of
                limits: those of the first one first. No contact is active.
        """
        self.stacks, self._first = tuple(stacks), actuations[0]
        nv, count = len(effort), len(actuations)
        self._shares, parts = np.zeros(count), np.zeros((count, 2 * nv))
        self._kept, mean = np.zeros(count, dtype=np.int64), np.zeros(2 * nv)
        self._single = count == 1
        each = count // len(stacks)
        steps: list[Step] = []
        for k, actuation in enumerate(actuations):
            if k % each == 0:
                steps += stacks[k // each].calls
            steps += actuation.calls()
            keep = actuation.keeping(
                parts[k, :nv], parts[k, nv:], self._kept[k : k + 1]
            )
            steps += planned([keep]).steps()
        mix = PartCall(
            engine.MixParts,
            shares=self._shares,
            parts=parts,
            kept=self._kept,
            mean=mean,
        )
        self._make = Plan([*steps, *planned([mix]).steps()])
        none = self._first.own.forces
        self._mean = Delivered(mean[nv:], mean[:nv], none, EXACT, 0.0)
        self._limited = self._mean._replace(status=LIMITED)

    def make(self, t: float, shares: Sequence[float]) -> Delivered | None:
        """Return the result at the state and its time [s]; None: use Python.

        Args:
            t: The time.
            shares: The share of each part, in the order of the actuations; their sum
                is 1.
        """
        self._shares[:] = shares
        if not self._make(t):
            return None
        limited = LIMITED_PART in self._kept.tolist()
        if self._single:
            return self._first.nearest if limited else self._first.own
        return self._limited if limited else self._mean


LIMITED_PART = 2
"""The engine's status of a part that a QP has limited (``KeepPart``)."""
