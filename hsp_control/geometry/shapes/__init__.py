"""Shapes of obstacles and contacts, as Coal computes distances between them.

The gradient of a capsule's distance to a sphere is continuous. To a flat face, it jumps
where the capsule becomes parallel to the face; to another capsule, where both become
parallel. The gradient of a sphere's distance to a convex shape is continuous.
`ObstacleClearance` chooses the proxies of links accordingly.
"""

from hsp_control.geometry.shapes.box import Box as Box
from hsp_control.geometry.shapes.capsule import Capsule as Capsule
from hsp_control.geometry.shapes.cylinder import Cylinder as Cylinder
from hsp_control.geometry.shapes.half_space import HalfSpace as HalfSpace
from hsp_control.geometry.shapes.height_field import HeightField as HeightField
from hsp_control.geometry.shapes.logged import shape_from_log as shape_from_log
from hsp_control.geometry.shapes.logged import shape_to_log as shape_to_log
from hsp_control.geometry.shapes.mesh import Mesh as Mesh
from hsp_control.geometry.shapes.point_cloud import PointCloud as PointCloud
from hsp_control.geometry.shapes.shape import Shape as Shape
from hsp_control.geometry.shapes.sphere import Sphere as Sphere
