"""Contacts: where a robot stands, and the forces that can act there."""

from .ball_contact import BallContact as BallContact
from .commanded_force import CommandedForce as CommandedForce
from .contact import Contact as Contact
from .point_contact import PointContact as PointContact
from .sliding_contact import SlidingContact as SlidingContact
from .surface_contact import SurfaceContact as SurfaceContact
