"""Where the robot will be when an effort arrives."""

from collections.abc import Iterable

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.control.compensation.checks import refuse_floating_base
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Rk4


class Predictor:
    """The model, carried through a delay by the efforts in flight.

    The law is then evaluated for the state and the time at which its effort will act.

    Attributes:
        effort_delay: Whole control periods that an effort takes to act.
        sensor_delay: Whole control periods that a measurement is old.
    """

    def __init__(self, effort_delay: int = 1, sensor_delay: int = 0) -> None:
        """Set the delay that is known.

        Raises:
            CompensationError: If a delay is no number of periods, or there is none.
        """
        for what, delay in (
            ("effort_delay", effort_delay),
            ("sensor_delay", sensor_delay),
        ):
            if not isinstance(delay, int) or delay < 0:
                raise CompensationError(
                    f"{what} is {delay!r}; needs a number of periods"
                )
        if effort_delay + sensor_delay == 0:
            raise CompensationError(
                "a predictor needs a delay: effort_delay or sensor_delay"
            )
        self.effort_delay = effort_delay
        self.sensor_delay = sensor_delay

    @property
    def periods(self) -> int:
        """Control periods from a measurement until the effort made of it acts."""
        return self.effort_delay + self.sensor_delay

    def check(self, robot: Robot) -> None:
        """Refuse a robot whose motion its efforts alone do not tell.

        Raises:
            CompensationError: If it has a free-flyer root.
        """
        refuse_floating_base(robot, "predictor")

    def ahead(
        self,
        robot: Robot,
        q: Array,
        v: Array,
        efforts: Iterable[Array],
        period: float,
    ) -> tuple[Array, Array]:
        """Return (q, v) after efforts have acted for a period each.

        Args:
            robot: The model.
            q: Configuration as measured, shape (nq,).
            v: Velocity as measured, shape (nv,).
            efforts: What acts on the model, one after the other, shape (nv,) each.
            period: How long each acts [s].
        """
        integrator = Rk4(period)
        for tau in efforts:
            q, v = integrator.advance(
                robot, _Held(robot, tau), 0.0, period, np.asarray(q), np.asarray(v)
            )
        return q, v


class _Held:
    """The model's motion under an effort that is held."""

    def __init__(self, robot: Robot, tau: Array) -> None:
        self._robot, self._tau = robot, tau

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        return self._robot.forward_dynamics(q, v, self._tau)
