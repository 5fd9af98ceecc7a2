"""The last thing between a loop and a robot: limits on what goes out, and no NaN."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.settings import EffortInterface
from hsp_control.robot import Robot


class EffortPort:
    """Turns an effort into what the robot is sent, within effort and rate.

    Attributes:
        sent: What was sent last, shape (nv,): tau, or tau - g(q).
        acting: What the motors then deliver, shape (nv,): tau.
    """

    def __init__(self, robot: Robot, interface: EffortInterface, period: float) -> None:
        """Take the limits over.

        Raises:
            LiveError: If a limit is none.
        """
        self._robot = robot
        self._rest = np.zeros(robot.nv)
        self._compensates = interface.compensates_gravity
        self._most = interface.effort_limits(robot)
        self._step = interface.rate_limits(robot) * period
        self.sent: Array = np.zeros(robot.nv)
        self.acting: Array = np.zeros(robot.nv)
        self.gravity: Array = np.zeros(robot.nv)

    @property
    def greatest(self) -> Array:
        """The greatest effort of the motors, shape (nv,)."""
        return self._most

    def begin(self, q: Array) -> None:
        """Stand where a robot at rest stands: its own brakes or motors bear g(q)."""
        self.gravity = self._robot.inverse_dynamics(q, self._rest, self._rest)
        self.sent = np.zeros(self._robot.nv)
        if not self._compensates:
            self.sent = np.clip(self.gravity, -self._most, self._most)
        self.acting = self.sent + self._borne

    @property
    def _borne(self) -> Array | float:
        return self.gravity if self._compensates else 0.0

    def pass_on(self, tau: Array, q: Array) -> bool:
        """Make ``sent`` of an effort tau, shape (nv,), at a configuration (nq,).

        The effort is clipped to its limits, then what is sent to the rate: where both
        bind and some effort satisfies both, the result does.

        Returns:
            Whether tau was numbers; if not, what was sent last is sent again.
        """
        if not np.isfinite(tau).all():
            return False
        if self._compensates:
            self.gravity = self._robot.inverse_dynamics(q, self._rest, self._rest)
        wanted = np.clip(tau, -self._most, self._most) - self._borne
        np.clip(wanted, self.sent - self._step, self.sent + self._step, out=self.sent)
        self.acting = self.sent + self._borne
        return True
