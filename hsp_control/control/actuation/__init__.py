"""Actuation: efforts and contact forces that deliver an acceleration, within limits."""

from .actuation import Actuation as Actuation
from .actuation import Delivered as Delivered
from .status import EXACT as EXACT
from .status import LIMITED as LIMITED
from .status import REDISTRIBUTED as REDISTRIBUTED
from .status import RELAXED as RELAXED
