"""MuJoCo as a plant; the package mujoco is imported when such a plant is built."""

from .mjcf import ContactShape as ContactShape
from .mjcf import Ground as Ground
from .mjcf import Solid as Solid
from .plant import Mujoco as Mujoco
from .plant import MujocoIntegrator as MujocoIntegrator
from .plant import MujocoPlant as MujocoPlant
from .scene_plant import MujocoScene as MujocoScene
from .scene_plant import MujocoScenePlant as MujocoScenePlant
