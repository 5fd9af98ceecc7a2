from .arm import Arm as Arm
from .box import ControlBox as ControlBox
from .server import DEADLINE as DEADLINE
from .server import Server as Server
