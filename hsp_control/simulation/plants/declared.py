"""Plants that a configuration can name: for packages that add one."""

from abc import ABC, abstractmethod

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.plant import Plant


class PlantPart(Part, ABC, family="plants", error=SimulationError):
    """What YAML says about a plant: ``plant: {type: mine, ...}``.

    A package declares its parameters as fields (see `Part`), implements `build`, and
    names the class as an entry point of the group ``hsp_control.plants``.
    """

    @abstractmethod
    def build(self, robot: Robot, integrator: Integrator) -> Plant:
        """Return the plant.

        Args:
            robot: The controller's robot; the plant may change it.
            integrator: The integrator of the simulation.
        """
