"""Many control periods of a simulation as one native call.

Between two rows of a log nothing of a period is recorded, and in Python a period costs
more than its law and its dynamics. So a compiled loop runs them, as long as no limit is
violated and there is no input from outside. It makes the calls that a single period
makes, by their addresses: the motion is the same, to the last bit.
"""

from functools import partial
from typing import NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.control.bound_step import FreeStep
from hsp_control.control.controller import Controller
from hsp_control.engine import Call, Plan
from hsp_control.engine.plans import planned
from hsp_control.robot.integrators import Steps
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.plants import IntegratedPlant

MOST = 100
"""Most periods of one call: then Ctrl-C is noticed, and other threads run."""


class _Timing(NamedTuple):
    """The k-th period begins at start + k span/periods."""

    start: Array  # shapes (1,) [s]
    span: Array
    periods: Indices
    first: Indices  # the period that begins now
    last: Indices  # the first one that is not made

    @classmethod
    def allocate(cls) -> Self:
        """Return zeros."""
        start, span = np.zeros((2, 1))
        return cls(start, span, *np.zeros((3, 1), dtype=np.int64))


class NativeLoop:
    """Advances a plant while its controller's steps are free, see `FreeStep`."""

    def __init__(
        self,
        controller: Controller,
        plant: IntegratedPlant,
        steps: Steps,
        excess: LimitExcess,
    ) -> None:
        self._controller, self._excess = controller, excess
        self._plant, self._steps = plant, steps
        self._step: FreeStep | None = None
        self._loop: Call | None = None
        self._timing = _Timing.allocate()

    def advance(
        self, start: float, end: float, periods: int, k: int, tau: Array
    ) -> tuple[Array, Array, int] | None:
        """Advance from the beginning of period k, under tau, to that of a later one.

        Returns (q, v) there, in new arrays, and which period begins; None where the
        controller has no free steps, or a part of one is no native call.
        """
        if periods - k < 2:
            return None
        go = partial(self._go, start, end - start, periods, k, tau)
        made = self._controller._while_free(go)
        return (*self._plant.moved(self._steps), k + made) if made else None

    def _go(
        self,
        start: float,
        span: float,
        periods: int,
        k: int,
        tau: Array,
        step: FreeStep,
    ) -> int:
        """Run periods from the k-th on; return their number."""
        if step is not self._step:
            self._step, self._loop = step, self._bind(step)
        if self._loop is None:
            return 0
        self._plant.hold(self._steps, tau)
        timing = self._timing
        timing.start[0], timing.span[0], timing.periods[0] = start, span, periods
        timing.first[0], timing.last[0] = k, min(periods, k + MOST)
        return int(self._loop()) - k

    def _bind(self, step: FreeStep) -> Call | None:
        """Return the loop of these steps; None where one of them is in Python."""
        steps, sending = self._steps, Plan(step.sending)
        if steps.take.python or step.move.python or sending.python:
            return None
        seeing = self._excess.recording(self._controller.limits, steps.q, steps.v)
        return engine.Periods(
            moving=Plan([steps.take, *planned(seeing).write]),
            step=step.move,
            sending=sending,
            q=steps.q,
            v=steps.v,
            held=self._plant.effort,
            effort=step.effort,
            interval=steps.interval,
            law=step.law,
            limits=step.limits,
            timing=self._timing,
        )
