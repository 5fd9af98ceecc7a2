"""Real-time control: run a controller on a robot, ending in a safe stop."""

from hsp_control.common.entry_points import own_names
from hsp_control.simulation.control_chain import EffortSource as EffortSource

from .hardware import Hardware as Hardware
from .hardware import Measurement as Measurement
from .hardware import Publisher as Publisher
from .hardware import connect as connect
from .hardware import publish as publish
from .link import Faults as Faults
from .link import Link as Link
from .loop import run_loop as run_loop
from .operator_requests import OperatorRequests as OperatorRequests
from .report import Deadlines as Deadlines
from .report import LoopReport as LoopReport
from .safe_stop import Phase as Phase
from .safe_stop import SafeStop as SafeStop
from .settings import LiveSettings as LiveSettings
from .settings import StopSettings as StopSettings
from .simulated_robot import InProcessRobot as InProcessRobot
from .simulated_robot import SimulatedRobot as SimulatedRobot
from .udp import SensorLayout as SensorLayout
from .udp import UdpHardware as UdpHardware
from .udp import serve as serve

__dir__ = own_names(__name__)
