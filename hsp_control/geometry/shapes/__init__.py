"""Shapes of obstacles and contacts, as Coal computes distances between them.

The gradient of a capsule's distance to a sphere is continuous. To a flat face, it jumps
where the capsule becomes parallel to the face; to another capsule, where both become
parallel. The gradient of a sphere's distance to a convex shape is continuous.
`ObstacleClearance` chooses the proxies of links accordingly.
"""

from hsp_control.geometry.shapes.primitives import Box as Box
from hsp_control.geometry.shapes.primitives import Capsule as Capsule
from hsp_control.geometry.shapes.primitives import Cylinder as Cylinder
from hsp_control.geometry.shapes.primitives import HalfSpace as HalfSpace
from hsp_control.geometry.shapes.primitives import HeightField as HeightField
from hsp_control.geometry.shapes.primitives import Mesh as Mesh
from hsp_control.geometry.shapes.primitives import PointCloud as PointCloud
from hsp_control.geometry.shapes.primitives import Shape as Shape
from hsp_control.geometry.shapes.primitives import Sphere as Sphere
from hsp_control.geometry.shapes.primitives import shape_from_log as shape_from_log
from hsp_control.geometry.shapes.primitives import shape_to_log as shape_to_log
