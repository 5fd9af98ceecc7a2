"""A controller and a simulated robot, one period at a time."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.control.compensation import Command
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import Measurement
from hsp_control.estimation import Estimator
from hsp_control.plans import Plan
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.plants import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    RigidBodyPlant,
    SampledPlant,
)


class ControlLoop:
    """The work of a period: `control` is timed, `move` simulates the robot.

    With a plan or estimators `control` is their work, too, and `move` measures what
    they need: that is what sensors do.

    Attributes:
        period: Length of a period [s].
        t: Time [s].
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        tau: The last effort, shape (nv,).
    """

    def __init__(
        self,
        controller: Controller,
        q0: Array,
        v0: Array,
        period: float,
        plant: Plant | None = None,
        plan: Plan | None = None,
        estimators: Sequence[Estimator] = (),
    ) -> None:
        """Set controller and plant to the start.

        Args:
            controller: The controller.
            q0: Start configuration, shape (nq,).
            v0: Start velocity, shape (nv,).
            period: Length of a period [s].
            plant: The plant; None: the controller's own model. A continuous one is
                integrated with one semi-implicit Euler step a period.
            plan: What the robot follows; the controller is made of its parts.
            estimators: What completes each measurement.

        Raises:
            SimulationError: If the plant is neither continuous nor sampled.
            HspControlError: If the plan or an estimator does not fit.
        """
        self._controller = controller
        plant = RigidBodyPlant(controller.robot) if plant is None else plant
        if isinstance(plant, ContinuousPlant):
            plant = IntegratedPlant(plant, SemiImplicitEuler(period))
        if not isinstance(plant, SampledPlant):
            raise SimulationError(
                f"{type(plant).__name__} is neither a continuous nor a sampled plant"
            )
        self._plant = plant
        self._chain = ControlChain(Command(controller), plan, estimators)
        self._start = q0.copy(), v0.copy()
        self.period = period
        self.restart()

    def restart(self) -> None:
        """Set controller and plant back to the start."""
        self.periods = 0
        self.t = 0.0
        self.q, self.v = (part.copy() for part in self._start)
        self.tau = np.zeros(len(self.v))
        self._plant.reset(self.t, self.q, self.v)
        if self._chain.needs_sensors:
            self._chain.begin(self._plant.inertial())
            self._measure()
        else:
            self._controller.restart()
            self.control()

    def control(self) -> None:
        """Update the state and compute the effort: a user's period without its I/O."""
        if self._chain.needs_sensors:
            self.tau = self._chain.effort(self._measured, self.period).copy()
        else:
            self.tau = self._controller.compute(self.t, self.q, self.v).tau

    def move(self) -> None:
        """Apply the effort to the plant for a period.

        Raises:
            SimulationError: If the motion diverges.
        """
        end = (self.periods + 1) * self.period
        if not self._chain.needs_sensors:  # otherwise the command has told it
            self._controller.applied(self.tau, self.period)
        self.q, self.v = self._plant.advance(self.t, end, self.tau)
        self.periods += 1
        self.t = end
        if self._chain.needs_sensors:
            self._measure()

    def _measure(self) -> None:
        """Measure what plan and estimators need."""
        t, plant = self.t, self._plant
        q, v = plant.measure(t, self.q, self.v)
        self._measured = Measurement(
            self.periods,
            t,
            q,
            v,
            applied=self.tau,
            wrenches=plant.contact_wrenches(t, self.q, self.v, self.tau),
            inertial=plant.inertial(),
        )
