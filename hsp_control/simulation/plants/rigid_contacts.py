"""The plant of rigid bodies with contacts that hold exactly, as a value."""

from dataclasses import KW_ONLY

from hsp_control.declaration.quantities import NonNegative
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.contact_plant import ContactPlant
from hsp_control.simulation.plants.declared import PlantPart
from hsp_control.simulation.plants.rigid_contact import RigidContactsByFrame


class RigidContacts(PlantPart, type="rigid_contacts"):
    """Pinocchio's rigid-body dynamics with rigid contacts."""

    contacts: RigidContactsByFrame
    """The contacts, by frame name [-]."""
    _: KW_ONLY
    damping: NonNegative = 100.0
    """Rate at which the velocity of a contact decays [1/s]."""

    def engine(self, robot: Robot, integrator: Integrator) -> ContactPlant:
        """Return the plant.

        Raises:
            FrameNotFoundError: If a frame does not exist.
        """
        return ContactPlant(
            robot, self.contacts, damping=self.damping, pushes=self.pushes
        )
