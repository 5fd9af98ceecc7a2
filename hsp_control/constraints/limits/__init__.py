"""Limits: what a robot's motors, joints and surroundings allow."""

from .limits import Limits as Limits
from .minimum_distance import MinimumDistance as MinimumDistance
from .static_effort import StaticEffort as StaticEffort
