"""Prediction of the state at which an effort will act."""

from collections.abc import Iterable

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.control.compensation.checks import check_fixed_base
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Count
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Rk4


class Predictor(Part, error=CompensationError):
    """The law is evaluated for the predicted state in which its effort will act.

    The predictor integrates the model over the known delays, with the efforts under
    way.
    """

    effort_delay: Count = 1
    """Delay from an effort to its action [control periods]."""
    sensor_delay: Count = 0
    """Age of a measurement [control periods]."""

    def __post_init__(self) -> None:
        """Check that there is a delay."""
        if self.periods == 0:
            raise CompensationError(
                "a predictor needs a delay: effort_delay or sensor_delay"
            )

    @property
    def periods(self) -> int:
        """The total delay from a measurement to its effort, in control periods."""
        return self.effort_delay + self.sensor_delay

    def check(self, robot: Robot) -> None:
        """Check that the efforts alone determine the robot's motion.

        Raises:
            CompensationError: If the robot has a free-flyer root.
        """
        check_fixed_base(robot)

    def predict(
        self,
        robot: Robot,
        q: Array,
        v: Array,
        efforts: Iterable[Array],
        period: float,
    ) -> tuple[Array, Array]:
        """Return (q, v) after the efforts have acted, each for one period.

        Args:
            robot: The model.
            q: Configuration as measured, shape (nq,).
            v: Velocity as measured, shape (nv,).
            efforts: The efforts on the model in order of time, shape (nv,) each.
            period: How long each effort acts [s].
        """
        integrator = Rk4(period)
        for tau in efforts:
            q, v = integrator.advance(
                robot,
                _ConstantEffort(robot, tau),
                0.0,
                period,
                np.asarray(q),
                np.asarray(v),
            )
        return q, v


class _ConstantEffort:
    """The model's acceleration under a constant effort."""

    def __init__(self, robot: Robot, tau: Array) -> None:
        self._robot, self._tau = robot, tau

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        return self._robot.forward_dynamics(q, v, self._tau)
