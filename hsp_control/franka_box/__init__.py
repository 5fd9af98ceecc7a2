"""A Franka's control box without a robot: for unmodified clients of libfranka."""

from .arm import Arm as Arm
from .box import Box as Box
from .server import DEADLINE as DEADLINE
from .server import Server as Server
