"""The rows that limit static efforts."""

import numpy as np

from hsp_control import RobotState
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import StaticEffort
from hsp_control.constraints.limits.barriers import BarrierRows


def static_rows(
    limit: StaticEffort, state: RobotState, bandwidth: float
) -> tuple[Array, Array]:
    """Return A and b of A a ≥ b, for a robot without contacts."""
    rows = BarrierRows.allocate(limit.room(), state.robot.nv)
    nowhere = np.zeros(0, dtype=np.int64)
    state.run(limit.row_calls(state, bandwidth, nowhere, rows))
    return rows.used
