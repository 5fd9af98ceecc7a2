"""The scene of a configuration, with the files of its meshes found and allowed."""

from dataclasses import replace
from pathlib import Path

from hsp_control.declaration import within
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.shapes import Mesh
from hsp_control.robot.description.access import Access
from hsp_control.robot.description.mesh_files import check_references


def located_scene(scene: Scene, folder: Path, access: Access) -> Scene:
    """Return the scene with absolute paths of its meshes, checked."""
    return Scene([_located(each, folder, access) for each in scene.values()])


def _located(obstacle: Obstacle, folder: Path, access: Access) -> Obstacle:
    with within("scene", "obstacles", obstacle.name, "shape"):
        shape = obstacle.shape.located(folder)
        if isinstance(shape, Mesh):
            with within("file"):
                access.check(Path(shape.file), "mesh")
                check_references(Path(shape.file), "mesh", access)
        shape.geometry()  # fails here, where the error has a location
        return replace(obstacle, shape=shape)
