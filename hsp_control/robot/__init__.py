"""The robot: its model, its state, and the kinematic and dynamic terms there."""

from hsp_control.common.entry_points import own_names

from .description.robot_description import PlacedRobot as PlacedRobot
from .description.robot_description import RobotDescription as RobotDescription
from .description.robot_description import ToolFrame as ToolFrame
from .friction import JointFriction as JointFriction
from .integrators import Dop853 as Dop853
from .integrators import Integrator as Integrator
from .integrators import Rk4 as Rk4
from .integrators import SemiImplicitEuler as SemiImplicitEuler
from .robot import Robot as Robot
from .state import RobotState as RobotState

__dir__ = own_names(__name__)
