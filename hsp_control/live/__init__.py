"""Real-time control: run a controller on a robot each period, ending in a safe stop."""

from .backends import connect as connect
from .backends import publish as publish
from .deadlines import Deadlines as Deadlines
from .effort_source import EffortSource as EffortSource
from .faults import Faults as Faults
from .hardware import Hardware as Hardware
from .hardware import Measurement as Measurement
from .link import Link as Link
from .loop import run_loop as run_loop
from .operator_requests import OperatorRequests as OperatorRequests
from .report import LoopReport as LoopReport
from .safe_stop import Phase as Phase
from .safe_stop import SafeStop as SafeStop
from .sensor_layout import SensorLayout as SensorLayout
from .settings import LiveSettings as LiveSettings
from .settings import StopSettings as StopSettings
from .simulated_robot import InProcessRobot as InProcessRobot
from .simulated_robot import SimulatedRobot as SimulatedRobot
from .udp_hardware import UdpHardware as UdpHardware
from .udp_robot import serve as serve
