"""The excess of a robot beyond its limits, independent of the law's status."""

from typing import Any

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits
from hsp_control.control.measurement import LogChannel
from hsp_control.engine.plans import PartCall
from hsp_control.robot import Robot

POSITION, VELOCITY = "position_excess", "velocity_excess"
BEYOND_POSITION = "beyond the position limit, most since the row before"
BEYOND_SPEED = "beyond the speed limit, most since the row before"


class LimitExcess:
    """The joints' largest excesses over their limits since the last reading.

    The law keeps limits for its model, and `Status` reports that. An unknown push, or a
    plant that differs, can take a joint beyond them: only the state shows it. It is
    checked once a control period, so that no row of a log misses it.
    """

    def __init__(self, robot: Robot) -> None:
        joints = [j for j in robot.joints.values() if j.nq == 1 and j.nv == 1]
        # Only such a joint has a range; see `Robot.position_limits`.
        self._coordinates = np.array([j.idx_q for j in joints], dtype=np.int64)
        self._dofs = np.array([j.idx_v for j in joints], dtype=np.int64)
        unit = " or ".join(dict.fromkeys(robot.units))
        self._units = unit, f"{unit}/s"
        # beyond the limits, shape (nv,) [rad or m, rad/s or m/s]
        self.position, self.velocity = np.zeros(robot.nv), np.zeros(robot.nv)
        self._q, self._v = robot.neutral(), np.zeros(robot.nv)  # for `record`
        self._limits: RobotLimits | None = None

    def record(self, limits: RobotLimits | None, q: Array, v: Array) -> None:
        """Record a true state."""
        if limits is None:
            return
        if limits is not self._limits:
            self._limits = limits
            given = self._arguments(limits, self._q, self._v)
            self._record = engine.LimitExcess(**given)
        self._q[:], self._v[:] = q, v
        self._record()

    def recording(
        self, limits: RobotLimits | None, q: Array, v: Array
    ) -> list[PartCall]:
        """Return `record` of the contents of these arrays, as calls."""
        if limits is None:
            return []
        return [PartCall(engine.LimitExcess, **self._arguments(limits, q, v))]

    def _arguments(self, limits: RobotLimits, q: Array, v: Array) -> dict[str, Any]:
        return {
            "coordinates": self._coordinates,
            "dofs": self._dofs,
            "q": q,
            "v": v,
            "lower": limits.lower,
            "upper": limits.upper,
            "speed": limits.velocity,
            "position": self.position,
            "velocity": self.velocity,
        }

    def collect(self, limits: RobotLimits | None) -> dict[str, LogChannel]:
        """Return the logged values, and begin anew; nothing without limits."""
        if limits is None:
            return {}
        found = {
            POSITION: LogChannel(self.position.copy(), self._units[0], BEYOND_POSITION),
            VELOCITY: LogChannel(self.velocity.copy(), self._units[1], BEYOND_SPEED),
        }
        self.position.fill(0.0)
        self.velocity.fill(0.0)
        return found
