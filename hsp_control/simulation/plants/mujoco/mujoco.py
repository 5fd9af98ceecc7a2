"""The plant that MuJoCo simulates, as a value."""

from dataclasses import KW_ONLY

from hsp_control.declaration.quantities import Flag, Positive
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.frictional import FrictionalPart
from hsp_control.simulation.plants.mujoco.contact_shapes import ContactShapes
from hsp_control.simulation.plants.mujoco.ground import Ground
from hsp_control.simulation.plants.mujoco.plant import MujocoIntegrator, MujocoPlant
from hsp_control.simulation.plants.mujoco.solids import Solids


class Mujoco(FrictionalPart, type="mujoco"):
    """MuJoCo, with its own integrator, friction and contacts."""

    _: KW_ONLY
    timestep: Positive = 0.001
    """Maximum step of MuJoCo [s]."""
    integrator: MujocoIntegrator = "implicitfast"
    """Integrator of MuJoCo [-]."""
    joint_limits: Flag = True
    """Whether MuJoCo keeps joints within their limits [-]."""
    contacts: ContactShapes = ()
    """Shapes that may touch the ground and the solids, by frame name [-]."""
    ground: Ground = Ground()
    """The ground [-]; it exists only if `contacts` has entries."""
    solids: Solids = ()
    """Walls, tables, slopes and stairs, by name [-]."""

    @property
    def longest_step(self) -> float:
        """The longest step of MuJoCo [s]."""
        return self.timestep

    def engine(self, robot: Robot, integrator: Integrator) -> MujocoPlant:
        """Return the plant, which has its own integrator.

        Raises:
            SimulationError: If MuJoCo is not installed or rejects the model.
            ModelError: If a joint has no counterpart in MuJoCo.
            FrameNotFoundError: If a frame does not exist.
        """
        return MujocoPlant(
            robot,
            timestep=self.timestep,
            integrator=self.integrator,
            contacts=self.contacts,
            ground=self.ground,
            solids=self.solids,
            joint_limits=self.joint_limits,
            friction=self.joint_friction(robot),
            pushes=self.pushes,
        )
