"""Shapes of obstacles and links, as Coal computes distances between them.

The gradient of a capsule's distance to a sphere is continuous. To a flat face, it jumps
where the capsule becomes parallel to the face; to another capsule, where both become
parallel. The gradient of a sphere's distance to a convex shape is continuous.
`ObstacleClearance` chooses the proxies of links accordingly.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any, ClassVar

import coal
import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SceneError
from hsp_control.geometry.hulls import convex_hull
from hsp_control.robot.description import mesh_files


class Shape(ABC):
    """The shape of a body, centred on its own frame.

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
            SceneError: If the shape is degenerate or its file cannot be read.
        """

    @property
    @abstractmethod
    def bounding_radius(self) -> float:
        """Radius of a sphere about its origin that contains it [m]; inf for a plane."""


@dataclass(frozen=True)
class Sphere(Shape):
    """A sphere; in the plane, a disk.

    Attributes:
        radius: Its radius [m]; 0 is a point.
    """

    radius: float
    rounded: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the lengths."""
        _check_lengths(self, {"radius": self.radius}, zero=True)

    def geometry(self) -> Any:
        """Return Coal's sphere."""
        return coal.Sphere(self.radius)

    @property
    def bounding_radius(self) -> float:
        """The radius."""
        return self.radius


@dataclass(frozen=True)
class Capsule(Shape):
    """A cylinder with round ends, along its z axis.

    Attributes:
        radius: Its radius [m].
        length: Distance of the centres of its round ends [m].
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        """Check the lengths."""
        _check_lengths(self, {"radius": self.radius})
        _check_lengths(self, {"length": self.length}, zero=True)

    def geometry(self) -> Any:
        """Return Coal's capsule."""
        return coal.Capsule(self.radius, self.length)

    @property
    def bounding_radius(self) -> float:
        """Half the overall length."""
        return self.radius + 0.5 * self.length


@dataclass(frozen=True)
class HalfSpace(Shape):
    """All points below its own x-y plane: a floor, or a rotated one, a wall."""

    def geometry(self) -> Any:
        """Return Coal's half-space."""
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    @property
    def bounding_radius(self) -> float:
        """Infinity."""
        return float("inf")


@dataclass(frozen=True)
class Box(Shape):
    """A box.

    Attributes:
        size: Lengths of its edges along x, y and z [m].
    """

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check the lengths."""
        if len(self.size) != 3:
            raise SceneError(f"box: size is {list(self.size)}; needs 3 lengths")
        _check_lengths(self, dict(zip("xyz", self.size, strict=True)))

    def geometry(self) -> Any:
        """Return Coal's box."""
        return coal.Box(*self.size)

    @property
    def bounding_radius(self) -> float:
        """Half the diagonal."""
        return 0.5 * float(np.linalg.norm(self.size))


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder along its z axis.

    Attributes:
        radius: Its radius [m].
        length: Its height [m].
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        """Check the lengths."""
        _check_lengths(self, {"radius": self.radius, "length": self.length})

    def geometry(self) -> Any:
        """Return Coal's cylinder."""
        return coal.Cylinder(self.radius, self.length)

    @property
    def bounding_radius(self) -> float:
        """Half the diagonal."""
        return float(np.hypot(self.radius, 0.5 * self.length))


@dataclass(frozen=True)
class Mesh(Shape):
    """A triangle mesh from a file, or its convex hull.

    Attributes:
        file: An STL, OBJ or DAE file.
        scale: The unit of length of the file [m].
        convex: Whether to use its convex hull.
    """

    file: Path
    scale: float = 1.0
    convex: bool = False

    def __post_init__(self) -> None:
        """Check the lengths."""
        _check_lengths(self, {"scale": self.scale})

    def geometry(self) -> Any:
        """Return Coal's mesh."""
        return self._load()[0]

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest vertex from the origin."""
        return float(np.linalg.norm(self._load()[1], axis=1).max())

    def _load(self) -> tuple[Any, Array]:
        if "\0" in str(self.file) or not Path(self.file).is_file():
            raise SceneError(f"mesh: no such file {self.file}")
        if reason := mesh_files.find_problem(Path(self.file)):
            raise SceneError(f"mesh: {self.file}: {reason}")
        try:
            mesh = coal.MeshLoader().load(str(self.file), np.full(3, self.scale))
        except (RuntimeError, ValueError) as error:
            reason = str(error).strip().splitlines()[-1]
            raise SceneError(f"mesh: cannot read {self.file}: {reason}") from error
        vertices = np.array(mesh.vertices())
        if len(vertices) == 0:
            raise SceneError(f"mesh: {self.file} contains no triangles")
        if not np.isfinite(vertices).all():
            raise SceneError(f"mesh: {self.file} contains NaN or inf")
        if not self.convex:
            return mesh, vertices
        hull = convex_hull(mesh)
        if hull is None:
            raise SceneError(
                f"mesh: {self.file} is flat and has no convex hull; use convex: false"
            )
        return hull, vertices


@dataclass(frozen=True)
class PointCloud(Shape):
    """Measured points; each becomes a cube of the resolution (Coal's octree).

    Attributes:
        points: The points, shape (k, 3) [m].
        resolution: Edge length of the cubes [m].
    """

    points: Sequence[Sequence[float]]
    resolution: float = 0.02
    witness_reversed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the resolution and the points."""
        _check_lengths(self, {"resolution": self.resolution})
        try:
            array = np.asarray(self.points, dtype=float)
        except ValueError:  # points of different sizes
            array = np.zeros(0)
        if array.shape != (max(len(array), 1), 3) or not np.isfinite(array).all():
            raise SceneError(
                "point cloud: needs one or more points of 3 finite numbers"
            )

    def geometry(self) -> Any:
        """Return Coal's octree."""
        return coal.makeOctree(np.asarray(self.points, dtype=float), self.resolution)

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest point from the origin, and its cube."""
        far = float(np.linalg.norm(self.points, axis=1).max())
        return far + 2.0 * self.resolution


@dataclass(frozen=True)
class HeightField(Shape):
    """A terrain: heights on a regular grid about the origin, as a triangle mesh.

    Coal has height fields, but computes no distances to them.

    Attributes:
        size: Extent along x and y [m].
        heights: Heights [m], one row for each y, shape (≥ 2, ≥ 2).
    """

    size: tuple[float, float]
    heights: Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        """Check the extents and the grid."""
        if len(self.size) != 2:
            raise SceneError(
                f"height field: size is {list(self.size)}; needs 2 lengths"
            )
        _check_lengths(self, dict(zip("xy", self.size, strict=True)))
        grid = self._grid()
        if grid.ndim != 2 or min(grid.shape) < 2 or not np.isfinite(grid).all():
            raise SceneError(
                "height field: heights must be at least 2 rows of 2 finite numbers"
            )

    def geometry(self) -> Any:
        """Return Coal's mesh with two triangles per cell."""
        rows, columns = self._grid().shape
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

    def _grid(self) -> Array:
        try:
            return np.asarray(self.heights, dtype=float)
        except ValueError:
            raise SceneError("height field: its rows have different lengths") from None

    def _vertices(self) -> Array:
        grid = self._grid()
        x = np.linspace(-0.5, 0.5, grid.shape[1]) * self.size[0]
        y = np.linspace(-0.5, 0.5, grid.shape[0]) * self.size[1]
        X, Y = np.meshgrid(x, y)
        return np.column_stack([X.ravel(), Y.ravel(), grid.ravel()])


def shape_from_log(kind: str, parameters: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes, or None if the kind is unknown.

    Args:
        kind: Name of the shape's class.
        parameters: Its attributes.

    Raises:
        SceneError: If the parameters are not those of this kind, or invalid.
    """
    classes = {shape.__name__: shape for shape in Shape.__subclasses__()}
    shape_class = classes.get(kind)
    if shape_class is None:
        return None
    try:
        known = {k: Path(v) if k == "file" else v for k, v in parameters.items()}
        shape: Shape = shape_class(**known)
    except (TypeError, ValueError):
        needed = ", ".join(signature(shape_class).parameters) or "nothing"
        found = f"{dict(parameters)!r}"[:60]
        raise SceneError(f"{kind.lower()}: needs {needed}; got {found}") from None
    return shape


def _check_lengths(
    shape: Shape, values: dict[str, float], *, zero: bool = False
) -> None:
    """Check that lengths are finite and positive, or not negative if ``zero``."""
    for name, value in values.items():
        if not (value >= 0.0 if zero else value > 0.0) or not value < np.inf:
            needed = "at least 0" if zero else "greater than 0"
            raise SceneError(
                f"{type(shape).__name__.lower()}: {name} is {value}; must be {needed}"
            )
