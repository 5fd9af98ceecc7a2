"""MuJoCo as a plant; the package mujoco is imported when such a plant is built."""

from .contact_shapes import ContactShape as ContactShape
from .ground import Ground as Ground
from .mujoco import Mujoco as Mujoco
from .mujoco_scene import MujocoScene as MujocoScene
from .plant import MujocoIntegrator as MujocoIntegrator
from .plant import MujocoPlant as MujocoPlant
from .scene_plant import MujocoScenePlant as MujocoScenePlant
from .solids import Solid as Solid
