"""What is odd about a robot's description: findings with the element and the cure."""

from .inspect import Finding as Finding
from .inspect import Inspection as Inspection
from .inspect import inspect as inspect
