"""Contacts: where a robot stands, and the forces that can act there."""

from .ball_contact import BallContact as BallContact
from .contact import Contact as Contact
from .point_contact import PointContact as PointContact
from .surface_contact import SurfaceContact as SurfaceContact
