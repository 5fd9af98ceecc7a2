"""MuJoCo: robots from its models, and its engine as a plant.

The package mujoco is imported when it is needed, not before.
"""

from hsp_control.common.entry_points import own_names

from .coordinates import MujocoCoordinates as MujocoCoordinates
from .mjcf import ContactShape as ContactShape
from .mjcf import Ground as Ground
from .mjcf import Solid as Solid
from .plant import Mujoco as Mujoco
from .scene_plant import MujocoScene as MujocoScene
from .scene_plant import MujocoScenePlant as MujocoScenePlant

__dir__ = own_names(__name__)
