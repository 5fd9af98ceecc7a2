"""Simulation: the closed loop and its rollout."""

from .initial_state import InitialState as InitialState
from .initial_state import StartPose as StartPose
from .rollout import Rollout as Rollout
from .simulate import SimulationSettings as SimulationSettings
from .simulate import simulate as simulate
