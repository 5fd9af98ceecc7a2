"""Plants: what answers the controller's effort."""

from .plant import Plant as Plant
from .rigid_body import RigidBodyPlant as RigidBodyPlant
