"""Prediction of the state at which an effort will act."""

from collections.abc import Iterable
from itertools import islice
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError
from hsp_control.control.compensation.stage import Run, Stage
from hsp_control.control.controller import Controller
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Count
from hsp_control.robot.integrators import Rk4
from hsp_control.robot.kinematics import Term


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


class RunningPredictor(Stage):
    """Integrates the model under the efforts that have not acted yet."""

    def __init__(self, declared: Predictor, controller: Controller) -> None:
        self._declared, self._controller = declared, controller
        self._robot, self._period = controller.robot, 0.0
        self._tau = np.zeros(controller.robot.nv)

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy's state: its integrator begins anew, with its own memory."""
        state = vars(self) | {"_period": 0.0, "_tau": self._tau.copy()}
        state.pop("_advance", None)
        return state

    def measure(self, run: Run) -> None:
        """Return when and where the next effort will act; see `Stage.measure`."""
        # Before any effort is sent, the robot is assumed to be at rest.
        efforts = (tau + run.disturbance for tau in islice(run.under_way, 1, None))
        run.q, run.v = self.predict(run.q, run.v, efforts, run.period)
        run.t += self._declared.effort_delay * run.period

    def predict(
        self, q: Array, v: Array, efforts: Iterable[Array], period: float
    ) -> tuple[Array, Array]:
        """Return (q, v) after the efforts on the model, each for one period."""
        if period != self._period:
            self._period = period
            self._advance = Rk4(period).begin(self._robot, self._bind)
        for tau in efforts:
            self._tau[:] = tau
            q, v = self._advance(0.0, period, q, v)
        return np.asarray(q), np.asarray(v)

    def _bind(self, q: Array, v: Array) -> Term:
        # Of the controller's model, with payloads and gravity as they are now.
        dynamics = self._controller.state.dynamics
        return self._robot.bind_forward_dynamics(q, v, self._tau, dynamics)
