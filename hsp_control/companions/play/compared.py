"""A controller that can follow another law, for comparison."""

from collections.abc import Callable

from hsp_control.common.arrays import Array
from hsp_control.control.interface import (
    ActiveStack,
    CompensatedController,
    ControlOutput,
)
from hsp_control.robot import RobotState

Law = Callable[[RobotState, ActiveStack], Array]
"""Another law: its acceleration a, shape (nv,), of which the effort is M a + N."""


class ComparedController(CompensatedController):
    """A controller that can follow another law, within the same limits."""

    compared: Law | None = None

    def _law(self, t: float, q: Array, v: Array) -> ControlOutput:
        if self.compared is None:
            return super()._law(t, q, v)
        return self.controller.compute(t, q, v, modifier=self._compared)

    def _compared(
        self, state: RobotState, active: ActiveStack, a: Array
    ) -> tuple[Array, Array | None]:
        assert self.compared is not None
        return self._modify(state, active, self.compared(state, active))
