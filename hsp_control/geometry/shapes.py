"""Shapes of obstacles and contacts, as Coal computes distances between them.

The gradient of a capsule's distance to a sphere is continuous. To a flat face, it jumps
where the capsule becomes parallel to the face; to another capsule, where both become
parallel. The gradient of a sphere's distance to a convex shape is continuous.
`ObstacleClearance` chooses the proxies of links accordingly.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Self

import coal
import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.entry_points import own_names
from hsp_control.common.errors import SceneError
from hsp_control.common.regular_file import why_endless
from hsp_control.declaration import Part
from hsp_control.declaration.families import value_fields
from hsp_control.declaration.quantities import (
    FileName,
    Flag,
    Grid,
    NonNegative,
    Points,
    Positive,
    PositiveVector2,
    PositiveVector3,
    plain,
)
from hsp_control.geometry.enclosing import convex_hull
from hsp_control.geometry.mesh_loading import load_mesh, why_unread
from hsp_control.robot.description import mesh_files


class Shape(Part, ABC, family="shapes", error=SceneError):
    """The shape of a body, centred on its own frame; a value.

    A subclass declares its parameters as fields (see `Part`) and implements `geometry`
    and `bounding_radius`. If it names a file, it overrides `located`.

    Attributes:
        rounded: Whether a capsule's distance to it has a continuous gradient.
        witness_reversed: Whether Coal returns the witness points in reverse order, and
            the normal with the opposite sign.
    """

    rounded: ClassVar[bool] = False
    witness_reversed: ClassVar[bool] = False

    @abstractmethod
    def geometry(self) -> Any:
        """Return Coal's collision geometry.

        Raises:
            SceneError: If its file cannot be read.
        """

    @property
    @abstractmethod
    def bounding_radius(self) -> float:
        """Radius of a sphere about its origin that contains it [m]; inf for a plane."""

    def located(self, folder: str | Path) -> Self:
        """Return this shape with the absolute path of its file, if it has one.

        Args:
            folder: Where a relative path begins.
        """
        return self


class Box(Shape, type="box"):
    """A box."""

    size: PositiveVector3
    """Lengths of its edges along x, y and z, shape (3,) [m]."""

    def geometry(self) -> Any:
        """Return Coal's box."""
        return coal.Box(*np.asarray(self.size))

    @property
    def bounding_radius(self) -> float:
        """Half the diagonal."""
        return 0.5 * float(np.linalg.norm(self.size))


class Capsule(Shape, type="capsule"):
    """A cylinder with round ends, along its z axis."""

    radius: Positive
    """Radius [m]."""
    length: NonNegative
    """Distance between the centres of its round ends [m]."""

    def geometry(self) -> Any:
        """Return Coal's capsule."""
        return coal.Capsule(self.radius, self.length)

    @property
    def bounding_radius(self) -> float:
        """Half the overall length."""
        return self.radius + 0.5 * self.length


class Cylinder(Shape, type="cylinder"):
    """A cylinder along its z axis."""

    radius: Positive
    """Radius [m]."""
    length: Positive
    """Height [m]."""

    def geometry(self) -> Any:
        """Return Coal's cylinder."""
        return coal.Cylinder(self.radius, self.length)

    @property
    def bounding_radius(self) -> float:
        """Half the diagonal."""
        return float(np.hypot(self.radius, 0.5 * self.length))


class HalfSpace(Shape, type="plane"):
    """All points below its own x-y plane: a floor, or a wall if it is turned."""

    def geometry(self) -> Any:
        """Return Coal's half-space."""
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    @property
    def bounding_radius(self) -> float:
        """Infinity."""
        return float("inf")


class HeightField(Shape, type="height_field"):
    """A terrain: heights on a regular grid about the origin, as a triangle mesh.

    Coal has height fields, but computes no distances to them.
    """

    size: PositiveVector2
    """Extent along x and y, shape (2,) [m]."""
    heights: Grid
    """Heights, one row per y, shape (≥ 2, ≥ 2) [m]."""

    def geometry(self) -> Any:
        """Return Coal's mesh with two triangles per cell."""
        rows, columns = np.shape(self.heights)
        vertices = self._vertices()
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(2 * (rows - 1) * (columns - 1), len(vertices))
        for i in range(rows - 1):
            for j in range(columns - 1):
                a = i * columns + j
                b, c, d = a + 1, a + columns, a + columns + 1
                mesh.addTriangle(vertices[a], vertices[b], vertices[d])
                mesh.addTriangle(vertices[a], vertices[d], vertices[c])
        mesh.endModel()
        return mesh

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest vertex from the origin."""
        return float(np.linalg.norm(self._vertices(), axis=1).max())

    def _vertices(self) -> Array:
        width, depth = np.asarray(self.size)
        grid = np.asarray(self.heights)
        x = np.linspace(-0.5, 0.5, grid.shape[1]) * width
        y = np.linspace(-0.5, 0.5, grid.shape[0]) * depth
        X, Y = np.meshgrid(x, y)
        return np.column_stack([X.ravel(), Y.ravel(), grid.ravel()])


class Mesh(Shape, type="mesh"):
    """A triangle mesh from a file, or its convex hull.

    The file is read by `geometry` and `bounding_radius`, not by the constructor.
    """

    file: FileName
    """An STL, OBJ, DAE, glTF, PLY or OFF file [-]; in YAML a relative path begins at
    the configuration's folder, see `located`."""
    scale: Positive = 1.0
    """Length of the file's unit [m]; of a DAE, which gives its own unit, a factor
    [-]."""
    convex: Flag = False
    """Whether its convex hull is used instead [-]."""

    def located(self, folder: str | Path) -> Self:
        """Return this mesh with the absolute path of its file; see `Shape.located`."""
        return replace(self, file=(Path(folder) / self.file).absolute())

    def geometry(self) -> Any:
        """Return Coal's mesh.

        Raises:
            SceneError: If the file cannot be read or holds no finite triangles, or the
                mesh is flat and its hull is requested.
        """
        return self._load()[0]

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest vertex from the origin."""
        return float(np.linalg.norm(self._load()[1], axis=1).max())

    def _load(self) -> tuple[Any, Array]:
        file = Path(self.file)
        if "\0" not in str(file) and (why := why_endless(file)):
            raise SceneError(f"mesh: {file}: {why}")
        if "\0" in str(file) or not file.is_file():
            raise SceneError(f"mesh: no such file {file}")
        if reason := mesh_files.find_problem(file):
            raise SceneError(f"mesh: {file}: {reason}")
        try:
            mesh = load_mesh(file, np.full(3, self.scale))
        except (RuntimeError, ValueError) as error:
            reason = why_unread(error)
            raise SceneError(f"mesh: cannot read {file}: {reason}") from error
        vertices = np.array(mesh.vertices())
        if len(vertices) == 0:
            raise SceneError(f"mesh: {file} contains no triangles")
        if not np.isfinite(vertices).all():
            raise SceneError(f"mesh: {file} contains NaN or inf")
        if not self.convex:
            return mesh, vertices
        hull = convex_hull(mesh)
        if hull is None:
            raise SceneError(
                f"mesh: {file} is flat and has no convex hull; use convex: false"
            )
        return hull, vertices


class PointCloud(Shape, type="point_cloud"):
    """Measured points, which become cubes of the resolution (Coal's octree)."""

    witness_reversed: ClassVar[bool] = True

    points: Points
    """The points, shape (k, 3) [m]."""
    resolution: Positive = 0.02
    """Edge of the cube that represents a point [m]."""

    def geometry(self) -> Any:
        """Return Coal's octree."""
        return coal.makeOctree(np.asarray(self.points), self.resolution)

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest point from the origin, and its cube."""
        far = float(np.linalg.norm(self.points, axis=1).max())
        return far + 2.0 * self.resolution


class Sphere(Shape, type="sphere"):
    """A ball; in the plane, a disk."""

    rounded: ClassVar[bool] = True

    radius: NonNegative
    """Radius [m]; 0 is a point."""

    def geometry(self) -> Any:
        """Return Coal's sphere."""
        return coal.Sphere(self.radius)

    @property
    def bounding_radius(self) -> float:
        """The radius."""
        return self.radius


def shape_to_log(shape: Shape) -> dict[str, Any]:
    """Return the fields of a shape as JSON data, for `shape_from_log`."""
    return {f.name: plain(getattr(shape, f.name)) for f in value_fields(shape)}


def shape_from_log(kind: str, parameters: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes, or None if the kind is unknown."""
    assert Shape.family is not None
    members = {each.__name__: each for each in Shape.family.members.values()}
    shape_class = members.get(kind)
    if shape_class is None:
        return None
    shape = shape_class(**parameters)
    assert isinstance(shape, Shape)
    return shape


__dir__ = own_names(__name__)
