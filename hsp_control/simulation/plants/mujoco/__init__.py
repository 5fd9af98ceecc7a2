"""MuJoCo as a plant; the package mujoco is imported when such a plant is built."""

from .contact_shapes import ContactShape as ContactShape
from .mjcf import Ground as Ground
from .plant import MujocoIntegrator as MujocoIntegrator
from .plant import MujocoPlant as MujocoPlant
