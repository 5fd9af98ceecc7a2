"""Simulation: the closed loop and its rollout."""

from hsp_control.common.entry_points import own_names

from .initial_state import InitialState as InitialState
from .initial_state import StartPose as StartPose
from .rollout import Rollout as Rollout
from .simulate import SimulationSettings as SimulationSettings
from .simulate import simulate as simulate

__dir__ = own_names(__name__)
