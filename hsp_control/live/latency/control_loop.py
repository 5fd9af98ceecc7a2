"""A controller and a robot to control, one period at a time."""

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.control.controller import Controller
from hsp_control.robot import RobotState
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    RigidBodyPlant,
    SampledPlant,
)


class ControlLoop:
    """What runs in a period: `control` on the clock, `move` in the robot's place.

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
        """Stand at the start.

        Args:
            controller: The controller.
            q0: Start configuration, shape (nq,).
            v0: Start velocity, shape (nv,).
            period: Length of a period [s].
            plant: What the effort moves; None: the controller's own model. A continuous
                one takes one semi-implicit step a period.
        """
        self._controller = controller
        plant = RigidBodyPlant(controller.robot) if plant is None else plant
        if isinstance(plant, ContinuousPlant):
            plant = IntegratedPlant(plant, SemiImplicitEuler(period))
        if not isinstance(plant, SampledPlant):
            raise SimulationError(f"{type(plant).__name__} is no plant that can move")
        self._plant = plant
        self._state = RobotState(controller.robot)
        self._start = q0.copy(), v0.copy()
        self.period = period
        self.restart()

    def restart(self) -> None:
        """Stand at the start again."""
        self.periods = 0
        self.t = 0.0
        self.q, self.v = (part.copy() for part in self._start)
        self._plant.reset(self.t, self.q, self.v)
        self._controller.restart()
        self.tau = self._controller.compute(
            self._state.update(self.t, self.q, self.v)
        ).tau

    def control(self) -> None:
        """Compute the effort: all that a user's loop would do, but for its I/O."""
        state = self._state.update(self.t, self.q, self.v)
        self.tau = self._controller.compute(state).tau

    def move(self) -> None:
        """Let the effort act for a period, in one step."""
        end = (self.periods + 1) * self.period
        self._controller.applied(self.tau, self.period)
        self.q, self.v = self._plant.advance(self.t, end, self.tau)
        self.periods += 1
        self.t = end
