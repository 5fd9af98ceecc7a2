"""Simulation: the closed loop and its rollout."""

from .initial_state import InitialState as InitialState
from .rollout import Rollout as Rollout
from .settings import SimulationSettings as SimulationSettings
from .simulate import simulate as simulate
from .start_search import StartPose as StartPose
