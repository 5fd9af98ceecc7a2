"""Shapes of obstacles and links, as Coal computes distances between them.

A capsule's distance to a ball has a continuous gradient. Against a flat face it jumps
wherever the capsule comes to lie along it, and against another capsule when the two are
parallel; a ball's distance to any convex shape does not. `ObstacleClearance` chooses
accordingly.
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
    """A body's form, centred on its own frame.

    Attributes:
        rounded: Whether a capsule's distance to it has a continuous gradient.
    """

    rounded: ClassVar[bool] = False
    reversed: ClassVar[bool] = False
    """Whether Coal gives its witness points, and the normal, the other way round."""

    @abstractmethod
    def geometry(self) -> Any:
        """Return Coal's collision geometry.

        Raises:
            SceneError: If the shape is degenerate or its file cannot be read.
        """

    @property
    @abstractmethod
    def reach(self) -> float:
        """The radius of a ball about its origin that holds it [m]; inf for a plane."""


@dataclass(frozen=True)
class Sphere(Shape):
    """A ball; in the plane, a disk.

    Attributes:
        radius: Its radius [m]; 0 is a point.
    """

    radius: float
    rounded: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        _lengths(self, {"radius": self.radius}, zero=True)

    def geometry(self) -> Any:
        """Return Coal's sphere."""
        return coal.Sphere(self.radius)

    @property
    def reach(self) -> float:
        """Its radius."""
        return self.radius


@dataclass(frozen=True)
class Capsule(Shape):
    """A cylinder with round ends, along its z axis.

    Attributes:
        radius: Its radius [m].
        length: Between the centres of its ends [m].
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        _lengths(self, {"radius": self.radius})
        _lengths(self, {"length": self.length}, zero=True)

    def geometry(self) -> Any:
        """Return Coal's capsule."""
        return coal.Capsule(self.radius, self.length)

    @property
    def reach(self) -> float:
        """Half its overall length."""
        return self.radius + 0.5 * self.length


@dataclass(frozen=True)
class HalfSpace(Shape):
    """All below its own x-y plane: a floor, or a wall when it is turned."""

    def geometry(self) -> Any:
        """Return Coal's half-space."""
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    @property
    def reach(self) -> float:
        """Infinite."""
        return float("inf")


@dataclass(frozen=True)
class Box(Shape):
    """A box.

    Attributes:
        size: Its edges along x, y and z [m].
    """

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        if len(self.size) != 3:
            raise SceneError(f"box: size {list(self.size)} needs 3 edges")
        _lengths(self, dict(zip("xyz", self.size, strict=True)))

    def geometry(self) -> Any:
        """Return Coal's box."""
        return coal.Box(*self.size)

    @property
    def reach(self) -> float:
        """Half its diagonal."""
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
        """Refuse what is no length."""
        _lengths(self, {"radius": self.radius, "length": self.length})

    def geometry(self) -> Any:
        """Return Coal's cylinder."""
        return coal.Cylinder(self.radius, self.length)

    @property
    def reach(self) -> float:
        """Half its diagonal."""
        return float(np.hypot(self.radius, 0.5 * self.length))


@dataclass(frozen=True)
class Mesh(Shape):
    """A triangle mesh from a file, or its convex hull.

    Attributes:
        file: An STL, OBJ or DAE file.
        scale: What its numbers are worth [m].
        convex: Whether its convex hull stands for it.
    """

    file: Path
    scale: float = 1.0
    convex: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        _lengths(self, {"scale": self.scale})

    def geometry(self) -> Any:
        """Return Coal's mesh."""
        return self._load()[0]

    @property
    def reach(self) -> float:
        """The distance of its farthest vertex."""
        return float(np.linalg.norm(self._load()[1], axis=1).max())

    def _load(self) -> tuple[Any, Array]:
        if "\0" in str(self.file) or not Path(self.file).is_file():
            raise SceneError(f"mesh: no file {self.file}")
        if reason := mesh_files.complaint(Path(self.file)):
            raise SceneError(f"mesh: {self.file}: {reason}")
        try:
            mesh = coal.MeshLoader().load(str(self.file), np.full(3, self.scale))
        except (RuntimeError, ValueError) as error:
            reason = str(error).strip().splitlines()[-1]
            raise SceneError(f"mesh: cannot read {self.file}: {reason}") from error
        vertices = np.array(mesh.vertices())
        if len(vertices) == 0:
            raise SceneError(f"mesh: {self.file} holds no triangle")
        if not np.isfinite(vertices).all():
            raise SceneError(f"mesh: {self.file} has a corner at a NaN or an infinity")
        if not self.convex:
            return mesh, vertices
        hull = convex_hull(mesh)
        if hull is None:
            raise SceneError(
                f"mesh: {self.file} is flat and has no convex hull; needs convex: false"
            )
        return hull, vertices


@dataclass(frozen=True)
class PointCloud(Shape):
    """Measured points, each grown to a cube of the resolution (Coal's octree).

    Attributes:
        points: The points, shape (k, 3) [m].
        resolution: Edge of the cubes [m].
    """

    points: Sequence[Sequence[float]]
    resolution: float = 0.02
    reversed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse what is no cloud."""
        _lengths(self, {"resolution": self.resolution})
        try:
            array = np.asarray(self.points, dtype=float)
        except ValueError:  # points differ in length
            array = np.zeros(0)
        if array.shape != (max(len(array), 1), 3) or not np.isfinite(array).all():
            raise SceneError("point cloud: needs one or more points of 3 numbers")

    def geometry(self) -> Any:
        """Return Coal's octree."""
        return coal.makeOctree(np.asarray(self.points, dtype=float), self.resolution)

    @property
    def reach(self) -> float:
        """The distance of its farthest point, and a cube."""
        far = float(np.linalg.norm(self.points, axis=1).max())
        return far + 2.0 * self.resolution


@dataclass(frozen=True)
class HeightField(Shape):
    """A terrain: heights on a regular grid about the origin, as a triangle mesh.

    Coal measures no distance to its own height fields.

    Attributes:
        size: Extent along x and y [m].
        heights: Heights [m], one row for each y, shape (≥ 2, ≥ 2).
    """

    size: tuple[float, float]
    heights: Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        """Refuse what is no grid."""
        if len(self.size) != 2:
            raise SceneError(f"height field: size {list(self.size)} needs 2 extents")
        _lengths(self, dict(zip("xy", self.size, strict=True)))
        grid = self._grid()
        if grid.ndim != 2 or min(grid.shape) < 2 or not np.isfinite(grid).all():
            raise SceneError("height field: heights need 2 rows of 2 numbers or more")

    def geometry(self) -> Any:
        """Return Coal's mesh of two triangles a cell."""
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
    def reach(self) -> float:
        """The distance of its farthest vertex."""
        return float(np.linalg.norm(self._vertices(), axis=1).max())

    def _grid(self) -> Array:
        try:
            return np.asarray(self.heights, dtype=float)
        except ValueError:
            raise SceneError("height field: its rows differ in length") from None

    def _vertices(self) -> Array:
        grid = self._grid()
        x = np.linspace(-0.5, 0.5, grid.shape[1]) * self.size[0]
        y = np.linspace(-0.5, 0.5, grid.shape[0]) * self.size[1]
        X, Y = np.meshgrid(x, y)
        return np.column_stack([X.ravel(), Y.ravel(), grid.ravel()])


def described_shape(kind: str, parameters: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes; None of a kind that is not one of these.

    Raises:
        SceneError: If a shape of this kind has other parameters.
    """
    forms = {form.__name__: form for form in Shape.__subclasses__()}
    form = forms.get(kind)
    if form is None:
        return None
    try:
        known = {k: Path(v) if k == "file" else v for k, v in parameters.items()}
        shape: Shape = form(**known)
    except (TypeError, ValueError):
        needed = ", ".join(signature(form).parameters) or "nothing"
        found = f"{dict(parameters)!r}"[:60]
        raise SceneError(f"{kind.lower()}: needs {needed}; found {found}") from None
    return shape


def _lengths(shape: Shape, values: dict[str, float], *, zero: bool = False) -> None:
    for name, value in values.items():
        if not (value >= 0.0 if zero else value > 0.0) or not value < np.inf:
            least = "at least 0" if zero else "greater than 0"
            raise SceneError(
                f"{type(shape).__name__.lower()}: {name} is {value}; must be {least}"
            )
