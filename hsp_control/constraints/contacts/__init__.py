"""Contacts: the surfaces on which a robot stands, and the forces that can act there."""

from hsp_control.common.entry_points import own_names

from .contact import CommandedForce as CommandedForce
from .contact import Contact as Contact
from .kinds import BallContact as BallContact
from .kinds import PointContact as PointContact
from .kinds import SlidingContact as SlidingContact
from .kinds import SurfaceContact as SurfaceContact

__dir__ = own_names(__name__)
