"""Build the obstacles."""

from pathlib import Path

import numpy as np

from hsp_control.config.build_motion import orientation_trajectory, position_trajectory
from hsp_control.config.document import Document
from hsp_control.config.keys import KeyPath
from hsp_control.config.models import scene as s
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    PointCloud,
    Shape,
    Sphere,
)
from hsp_control.robot.description.mesh_files import check_references


def located_scene(model: s.SceneModel, folder: Path) -> s.SceneModel:
    """Return the scene with absolute paths of its meshes, for the log."""

    def located(obstacle: s.ObstacleModel) -> s.ObstacleModel:
        if not isinstance(obstacle.shape, s.MeshModel):
            return obstacle
        file = str(folder / obstacle.shape.file)
        shape = obstacle.shape.model_copy(update={"file": file})
        return obstacle.model_copy(update={"shape": shape})

    obstacles = {name: located(each) for name, each in model.obstacles.items()}
    return model.model_copy(update={"obstacles": obstacles})


def build_scene(document: Document, model: s.SceneModel, folder: Path) -> Scene:
    """Return the scene; ``folder`` is where relative paths of files begin."""
    obstacles = []
    for name, obstacle in model.obstacles.items():
        where = ("scene", "obstacles", name)
        with document.at(*where):
            with document.at(*where, "shape"):
                if isinstance(obstacle.shape, s.MeshModel):
                    _check_mesh(
                        document, (*where, "shape", "file"), obstacle.shape, folder
                    )
                shape = build_shape(obstacle.shape, folder)
                shape.geometry()  # fails here, where the error has a location
            with document.at(*where, "center"):
                center = position_trajectory(obstacle.center, None)
            orientation = None
            if obstacle.orientation is not None:
                with document.at(*where, "orientation"):
                    orientation = orientation_trajectory(
                        obstacle.orientation, np.eye(3)
                    )
            obstacles.append(Obstacle(name, shape, center, orientation))
    return Scene(obstacles)


def _check_mesh(
    document: Document, at: KeyPath, model: s.MeshModel, folder: Path
) -> None:
    """Check that the document may use a mesh file."""
    with document.at(*at):
        document.access.check(folder / model.file, "mesh")
        check_references(folder / model.file, "mesh", document.access)


def build_shape(model: s.AnyShape, folder: Path) -> Shape:
    """Return a shape; ``folder`` is where relative paths of files begin."""
    match model:
        case s.SphereModel():
            return Sphere(model.radius)
        case s.CapsuleModel():
            return Capsule(model.radius, model.length)
        case s.CylinderModel():
            return Cylinder(model.radius, model.length)
        case s.BoxModel():
            x, y, z = model.size
            return Box((x, y, z))
        case s.PlaneModel():
            return HalfSpace()
        case s.MeshModel():
            return Mesh(folder / model.file, model.scale, model.convex)
        case s.PointCloudModel():
            return PointCloud(model.points, model.resolution)
        case s.HeightFieldModel():
            width, depth = model.size
            return HeightField((width, depth), model.heights)
