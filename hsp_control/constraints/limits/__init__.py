"""Limits of motors, joints and distances."""

from .limits import Limits as Limits
from .minimum_distance import MinimumDistance as MinimumDistance
from .static_effort import StaticEffort as StaticEffort
