"""The external effort on the joints before a safe stop."""

from math import ceil

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.engine.plans import PartCall
from hsp_control.robot import RobotState

_RATE = 3.0
"""Rate K of the low-pass [1/s]."""
_HEAD_START = 0.05
"""Time T₀ added to that since the first state [s]: 1/k, so that an error
of a velocity in the first period moves a braked joint no faster than the error."""
_BEFORE = 0.2
"""Age of the estimate that is used [s]: a fault is detected within this time,
or is small."""
_CONTACT = 0.3
"""Largest load of a joint, relative to its effort limit: that of a contact [-]."""
_LONGEST_GAP = 0.02
"""Time between two states across which the load is not estimated [s]."""


class LoadEstimate:
    """A slow momentum observer, whose estimate a safe stop compensates.

    With d the load, M v' = tau - N + d, so d' = K (M v' - (tau - N) - d). It is
    estimated while measurements are consistent, in a live loop also in the stop, which
    then uses the newest estimate. (M v' is small there, so that the estimate hardly
    depends on its own use, whatever M is.) From the first contradiction on, the one of
    0.2 s before is frozen.

    At first, t after the first state, the gain is 1/(t + T₀) instead of K, until that
    is smaller. Then the estimate is the mean ∫ (M v' - (tau - N)) dt / (t + T₀), and a
    constant load is known up to T₀/(t + T₀) of it: 17 % after 0.25 s, 47 % with K.

    Until a sensor is found to be dead, the effort that moves its joint seems to hold a
    load. Of such a joint the estimate before the last change of its readings is used.

    How much a wrong measurement leaves in it is bounded: an error x of the velocity is
    an impulse M x, and changes the estimate by M x times the gain at most; one that
    begins less than 0.2 s before the stop by nothing. Frozen in the stop, that moves
    joints that are braked by -k M v at K x / k: 0.15 x with k = 20 1/s. An error that
    begins at a time t in the first 0.3 s moves them at x / (k (t + T₀)): x at most.

    Attributes:
        bound: Largest load, shape (nv,) [N·m or N].
        load: The estimate that is used, that of 0.2 s ago unless `use` chooses,
            shape (nv,) [N·m or N].
    """

    def __init__(self, nv: int, period: float) -> None:
        """Begin without a load; ``period`` is that between two states [s]."""
        self.bound, self.load = np.zeros((2, nv))
        self._learnt, self._time = np.zeros((2, 1))
        self._v, self._driving, self._estimate, self._changed = np.zeros((4, nv))
        self._past = np.zeros((max(ceil(_BEFORE / period - 1e-9), 1), nv))
        self._count: Indices = np.zeros(1, dtype=np.int64)

    def permit(self, limits: Array) -> None:
        """Set the bound by the efforts' limits, shape (nv,); inf: unknown.

        Where no limit is known, no load is estimated.
        """
        self.bound[:] = np.where(np.isfinite(limits), _CONTACT * limits, 0.0)

    def changed(self, joints: Flags) -> None:
        """Record the joints whose readings change at the next state, shape (nv,)."""
        self._changed[joints] = self._estimate[joints]

    def use(self, *, newest: bool, dead: Flags) -> None:
        """Set `load` to the newest estimate, or to the one of 0.2 s ago.

        ``dead`` are the joints whose sensors have died, shape (nv,).
        """
        oldest = self._past[self._count.item() % len(self._past)]
        chosen = self._estimate if newest else oldest
        chosen = np.where(dead, self._changed, chosen)
        self.load[:] = np.clip(chosen, -self.bound, self.bound)

    def forget(self) -> None:
        """Begin anew."""
        for each in self._memory:
            each[:] = 0

    def go_on(self, before: "LoadEstimate") -> None:
        """Continue from another estimate of the robot."""
        for mine, its in zip(self._memory, before._memory, strict=True):
            mine[:] = its

    @property
    def _memory(self) -> tuple[Array | Indices, ...]:
        times = self._learnt, self._time
        numbers = self._v, self._driving, self._estimate, self._changed, self._past
        return *times, *numbers, self._count, self.load

    def call(self, state: RobotState, acts: Array) -> PartCall:
        """Return the call that learns from a state; ``acts`` is its effort, (nv,)."""
        return PartCall(
            engine.EstimateLoad,
            rate=_RATE,
            head_start=_HEAD_START,
            longest_gap=_LONGEST_GAP,
            time=state.time,
            M=state.inertia,
            v=state.v,
            nonlinear_effects=state.effects,
            acts=acts,
            bound=self.bound,
            learnt=self._learnt,
            last_time=self._time,
            last_v=self._v,
            driving=self._driving,
            estimate=self._estimate,
            past=self._past,
            count=self._count,
            load=self.load,
        )
