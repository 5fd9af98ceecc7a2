"""Simulation: the closed loop and its rollout."""

from .rollout import Rollout as Rollout
from .simulate import simulate as simulate
