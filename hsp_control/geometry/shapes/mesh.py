"""A triangle mesh from a file."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import coal
import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SceneError
from hsp_control.declaration.quantities import FileName, Flag, Positive
from hsp_control.geometry.hulls import convex_hull
from hsp_control.geometry.shapes.shape import Shape
from hsp_control.robot.description import mesh_files


class Mesh(Shape, type="mesh"):
    """A triangle mesh from a file, or its convex hull.

    The file is read by `geometry` and `bounding_radius`, not by the constructor.
    """

    file: FileName
    """An STL, OBJ or DAE file [-]; in YAML a relative path begins at the
    configuration's folder, see `located`."""
    scale: Positive = 1.0
    """Length of the file's unit [m]."""
    convex: Flag = False
    """Whether its convex hull is used instead [-]."""

    def located(self, folder: str | Path) -> Self:
        """Return this mesh with the absolute path of its file; see `Shape.located`."""
        return replace(self, file=(Path(folder) / self.file).absolute())

    def geometry(self) -> Any:
        """Return Coal's mesh.

        Raises:
            SceneError: If the file cannot be read or holds no finite triangles, or the
                mesh is flat and its hull is asked for.
        """
        return self._load()[0]

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest vertex from the origin."""
        return float(np.linalg.norm(self._load()[1], axis=1).max())

    def _load(self) -> tuple[Any, Array]:
        file = Path(self.file)
        if "\0" in str(file) or not file.is_file():
            raise SceneError(f"mesh: no such file {file}")
        if reason := mesh_files.find_problem(file):
            raise SceneError(f"mesh: {file}: {reason}")
        try:
            mesh = coal.MeshLoader().load(str(file), np.full(3, self.scale))
        except (RuntimeError, ValueError) as error:
            reason = str(error).strip().splitlines()[-1]
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
