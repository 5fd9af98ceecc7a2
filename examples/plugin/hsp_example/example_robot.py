"""A robot for ``hsp live --robot example://SECONDS``: a simulated one, in-process.

A real backend talks to its robot here, and waits in `read` for the robot's clock.
"""

import numpy as np

from hsp_control.live import Hardware, InProcessRobot, SimulatedRobot
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant


def connect(address: str, robot: Robot, period: float) -> Hardware:
    """Return a robot at its home configuration; the address is not used."""
    plant = IntegratedPlant(RigidBodyPlant(robot), Rk4(period))
    simulated = SimulatedRobot(plant, robot.home(), np.zeros(robot.nv), period)
    return InProcessRobot(simulated)
