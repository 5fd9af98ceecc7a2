"""Shapes of links and obstacles, and the distances between them."""

from .links import LinkShape as LinkShape
from .links import Proxy as Proxy
from .links import link_shapes as link_shapes
from .links import self_pairs as self_pairs
from .proximity import Proximity as Proximity
from .scene import Obstacle as Obstacle
from .scene import Scene as Scene
from .shapes import Box as Box
from .shapes import Capsule as Capsule
from .shapes import Cylinder as Cylinder
from .shapes import HalfSpace as HalfSpace
from .shapes import HeightField as HeightField
from .shapes import Mesh as Mesh
from .shapes import PointCloud as PointCloud
from .shapes import Shape as Shape
from .shapes import Sphere as Sphere
