"""Actuation: efforts and contact forces for an acceleration, within limits."""

from .actuation import Actuation as Actuation
from .delivered import Delivered as Delivered
from .limited_step import Status as Status
