"""Actuation: efforts and contact forces for an acceleration, within limits."""

from .actuation import Actuation as Actuation
from .actuation import Delivered as Delivered
from .status import Status as Status
