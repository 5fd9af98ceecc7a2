"""Simulation: the closed loop and its rollout."""

from hsp_control.common.entry_points import own_names

from .initial_state import InitialState as InitialState
from .rollout import Rollout as Rollout
from .settings import SimulationSettings as SimulationSettings
from .simulate import simulate as simulate
from .start_search import StartPose as StartPose

__dir__ = own_names(__name__)
