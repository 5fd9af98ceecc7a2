"""A controller and a simulated robot, one period at a time."""

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.control.controller import Controller
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    RigidBodyPlant,
    SampledPlant,
)


class ControlLoop:
    """The work of a period: `control` is timed, `move` simulates the robot.

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
    ) -> None:
        """Set controller and plant to the start.

        Args:
            controller: The controller.
            q0: Start configuration, shape (nq,).
            v0: Start velocity, shape (nv,).
            period: Length of a period [s].
            plant: The plant; None: the controller's own model. A continuous one is
                integrated with one semi-implicit Euler step a period.

        Raises:
            SimulationError: If the plant is neither continuous nor sampled.
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
        self._start = q0.copy(), v0.copy()
        self.period = period
        self.restart()

    def restart(self) -> None:
        """Set controller and plant back to the start."""
        self.periods = 0
        self.t = 0.0
        self.q, self.v = (part.copy() for part in self._start)
        self._plant.reset(self.t, self.q, self.v)
        self._controller.restart()
        self.control()

    def control(self) -> None:
        """Update the state and compute the effort: a user's period without its I/O."""
        self.tau = self._controller.compute(self.t, self.q, self.v).tau

    def move(self) -> None:
        """Apply the effort to the plant for a period."""
        end = (self.periods + 1) * self.period
        self._controller.applied(self.tau, self.period)
        self.q, self.v = self._plant.advance(self.t, end, self.tau)
        self.periods += 1
        self.t = end
