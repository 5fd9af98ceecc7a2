"""Differences between the simulated robot and the controller's model of it."""

from .model_change import ModelChange as ModelChange
from .model_change import changed as changed
from .motor_inertia import MotorInertia as MotorInertia
from .payload import Payload as Payload
from .random_inertias import RandomInertias as RandomInertias
from .scaled_inertias import ScaledInertias as ScaledInertias
