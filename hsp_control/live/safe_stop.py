"""The safe stop: first damping, then hold."""

from enum import IntEnum

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.settings import StopSettings
from hsp_control.robot import Robot, RobotState


class Phase(IntEnum):
    """Where a robot under a loop is on its way from the start to the stop."""

    WAITING = 0
    RUNNING = 1
    DAMPING = 2
    HOLDING = 3


class SafeStop:
    """Brings a robot to rest, and holds it there.

    Damping: tau = g(q) - s k M(q) v. The kinetic energy obeys T' = -s k vᵀM v, less
    than zero whatever the robot's true inertia is, since M of the model is positive
    definite. (Coriolis terms do no work; compensating them with a wrong model would.)
    With a right model T falls like exp(-2 k t), for heavy joints as for light ones, so
    that one number suits all. s, within 0 and 1, keeps the whole vector within the
    efforts: clipped joint by joint it might drive.

    Hold: tau = g(q) - ω² M₀ (q ⊖ q₀) - 2 ω M₀ v with M₀ of the configuration q₀ where
    it came to rest: the PD control with gravity compensation of Takegaki and Arimoto
    (1981), stable for any inertia.

    Attributes:
        phase: `Phase.DAMPING` or `Phase.HOLDING`.
    """

    def __init__(
        self, robot: Robot, settings: StopSettings, effort: Array, period: float
    ) -> None:
        """Prepare it.

        Args:
            robot: The model.
            settings: How hard.
            effort: Greatest effort, shape (nv,).
            period: Time between two calls of `effort` [s].

        Raises:
            LiveError: If the period is too long for the settings.
        """
        settings.check_period(period)
        self._robot, self._settings, self._most = robot, settings, effort
        self._period = period
        self._rest = np.zeros(robot.nv)
        self.begin()

    def begin(self) -> None:
        """Start from the beginning."""
        self.phase = Phase.DAMPING
        self.damped_for = self.held_for = 0.0
        self._held_q: Array = self._robot.neutral()
        self._held_mass = np.zeros((self._robot.nv, self._robot.nv))

    @property
    def done(self) -> bool:
        """Whether it has been held for long enough."""
        held = self.held_for >= self._settings.hold - 0.5 * self._period
        return self.phase == Phase.HOLDING and held

    def effort(self, state: RobotState) -> Array:
        """Return the effort of this period at the state, shape (nv,)."""
        settings, v = self._settings, state.v
        if self.phase == Phase.DAMPING and (
            float(np.abs(v).max()) <= settings.rest_speed
            or self.damped_for >= settings.longest_damping
        ):
            self.phase = Phase.HOLDING
            self._held_q, self._held_mass = state.q.copy(), state.mass_matrix.copy()
        if self.phase == Phase.DAMPING:
            self.damped_for += self._period
            braking = -settings.damping * (state.mass_matrix @ v)
        else:
            self.held_for += self._period
            w = settings.natural_frequency
            away = self._robot.difference(self._held_q, state.q)
            braking = -(self._held_mass @ (w * w * away + 2.0 * w * v))
        gravity = self._robot.inverse_dynamics(state.q, self._rest, self._rest)
        return gravity + share_within(gravity, braking, self._most) * braking


def share_within(base: Array, direction: Array, most: Array) -> float:
    """Return the greatest s in [0, 1] with |base + s direction| ≤ most; 0 if none is.

    Args:
        base: Shape (n,).
        direction: Shape (n,).
        most: Greatest magnitudes, shape (n,).
    """
    room = np.maximum(most - np.sign(direction) * base, 0.0)
    size = np.abs(direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(size > room, room / size, 1.0)
    return float(shares.min(initial=1.0))
