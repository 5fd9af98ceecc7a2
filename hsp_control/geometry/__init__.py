"""Geometry of links, and distances between shapes."""

from .links import LinkShape as LinkShape
from .links import Proxy as Proxy
from .links import link_shapes as link_shapes
from .proximity import Proximity as Proximity
from .self_pairs import self_pairs as self_pairs
