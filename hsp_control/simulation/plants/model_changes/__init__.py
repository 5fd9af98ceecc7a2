"""Differences between the simulated robot and the controller's model of it."""

from .inertias import Inertias as Inertias
from .model_change import ModelChange as ModelChange
from .model_change import changed as changed
from .motor_inertia import MotorInertia as MotorInertia
from .payload import Payload as Payload
