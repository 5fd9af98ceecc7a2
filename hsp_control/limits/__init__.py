"""Limits: what a robot's motors, joints and surroundings allow."""

from .limits import Limits as Limits
