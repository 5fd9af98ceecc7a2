"""Many control periods of a simulation as one native call.

Between two rows of a log nothing of a period is looked at, and in Python a period costs
more than its law and its dynamics. So they are left to a compiled loop, as long as no
limit is violated and nothing comes from outside. It makes the calls that a single
period makes, by their addresses: the motion is the same, to the last bit.
"""

from functools import partial

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.adapters import run
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.native import NativeCall, are_native, rows_of
from hsp_control.compiled.native_move import NativeMove, make_move
from hsp_control.control.bound_step import FreeStep, is_free
from hsp_control.control.controller import Controller
from hsp_control.robot.integrators import Steps
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.plants import IntegratedPlant

MOST = 100
"""Most periods of one call: then Ctrl-C is noticed, and other threads go on."""


class NativeLoop:
    """Moves a plant on while its controller's steps are free, see `FreeStep`."""

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
        self._loop: NativeCall | None = None
        self._which = np.zeros(5)  # the loop's last argument
        self._seeing: list[NativeCall] = []

    def advance(
        self, start: float, end: float, periods: int, k: int, tau: Array
    ) -> tuple[Array, Array, int] | None:
        """Move on from the beginning of period k, under tau, to that of a later one.

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
        """Make periods from the k-th on; return how many."""
        if step is not self._step:
            self._step, self._loop = step, self._bind(step)
        if self._loop is None:
            return 0
        self._plant.hold(self._steps, tau)
        which = self._which
        which[0], which[1], which[2] = start, span, periods
        which[3], which[4] = k, min(periods, k + MOST)
        return int(self._loop()) - k

    def _bind(self, step: FreeStep) -> NativeCall | None:
        """Return the loop of these steps; None where one of them is not native."""
        steps, move, sending = self._steps, step.move, step.sending
        if not isinstance(move, NativeMove) or not are_native(sending):
            return None
        assert isinstance(steps.take, NativeCall)
        # Rows are addresses: what they lead to is kept, here and in the steps.
        seeing = self._excess.recording(self._controller.limits, steps.q, steps.v)
        self._seeing = [NativeCall.of(*call, timed=False) for call in seeing]
        moving = rows_of([steps.take, *self._seeing])
        own = steps.q, steps.v, self._plant.effort, step.effort, steps.interval
        calls = moving, *move.args, rows_of(sending)
        return NativeCall.of(_periods, (*calls, *own, self._which), timed=False)


@kernel
def _periods(
    moving: Indices,
    law: Indices,
    t_law: Array,
    q_law: Array,
    v_law: Array,
    unit_blocks: Indices,
    stamp: Indices,
    sending: Indices,
    q: Array,
    v: Array,
    held: Array,
    effort: Array,
    interval: Array,
    which: Array,
) -> int:
    """Move on from one period to another, or to one that is not free; return which.

    ``law`` to ``stamp`` are `NativeMove`'s arguments. ``effort`` is written by the
    law, ``held`` is what the plant is under. ``interval`` gets a period's two ends.
    ``which`` holds when period 0 begins, the length of all periods together [s], how
    many they are, the present one, and the one to move on to.
    """
    start, span, periods = which[0], which[1], which[2]
    first, last = int(which[3]), int(which[4])
    t = start + first * span / periods
    for k in range(first + 1, last + 1):
        interval[0] = t
        interval[1] = t = start + k * span / periods
        run(moving, t)
        if k == last:
            break
        code = make_move(law, t_law, q_law, v_law, unit_blocks, stamp, t, q, v)
        if not is_free(code):
            return k
        square = 0.0
        for i in range(effort.shape[0]):
            held[i] = effort[i]
            square += effort[i] * effort[i]
        if not np.isfinite(square):
            return k
        run(sending, t)
    return last
