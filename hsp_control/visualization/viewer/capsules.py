"""The shapes of the links that distances are measured with, as a translucent layer."""

from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin

from hsp_control.control.controller import Controller
from hsp_control.geometry.links import LinkShape
from hsp_control.null_space.fields import Clearance
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import MEASURED, MEASURED_OPACITY
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    set_object,
    set_transform,
)
from hsp_control.visualization.viewer.controller_analysis import terms_of_type
from hsp_control.visualization.viewer.legend import LegendEntry, translucent
from hsp_control.visualization.viewer.materials import material
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.obstacle_shapes import facets, triangles_of
from hsp_control.visualization.viewer.poses import pose_at
from hsp_control.visualization.viewer.scene_path import path_element


class Capsules:
    """The links' shapes that the controller measures, larger than the drawn links."""

    def __init__(self, controller: Controller, root: str) -> None:
        """Find the links that are measured."""
        self._root = root
        self._names = list(controller.robot.model.names)
        measured = list(_clearances(controller))
        self._kinds = dict.fromkeys(each.proxy for each in measured)
        self._links: dict[int, list[LinkShape]] = {}
        for shape in _measured_shapes(controller, measured):
            self._links.setdefault(shape.joint, []).append(shape)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for joint, shapes in self._links.items():
            solids = [_solid(shape) for shape in shapes]
            yield set_object(self._path(joint), threejs.group(solids))
            if joint == 0:  # the world, which has no track
                yield set_transform(self._path(joint), np.eye(4))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        joints = [joint for joint in self._links if joint]
        if not joints:
            return
        poses = np.array(
            [
                [pin.SE3ToXYZQUAT(state.data.oMi[joint]) for joint in joints]
                for state in motion.states()
            ]
        )
        for k, joint in enumerate(joints):
            path = self._path(joint)
            yield Track(path, "position", motion.times, poses[:, k, :3])
            yield Track(path, "quaternion", motion.times, poses[:, k, 3:])

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        if not self._links:
            return []
        name = f"{' and '.join(self._kinds)} of the links (measured)"
        color = translucent(MEASURED, MEASURED_OPACITY)
        return [LegendEntry(name, color, (self._root,))]

    def _path(self, joint: int) -> str:
        return f"{self._root}/{path_element(self._names[joint])}"


def _clearances(controller: Controller) -> Iterator[Clearance]:
    """Yield the clearance fields, and those of the limits on distances."""
    yield from terms_of_type(controller.field, Clearance)  # type: ignore[type-abstract]
    if controller.limits is not None:
        yield from (each.clearance for each in controller.limits.distances)


def _measured_shapes(
    controller: Controller, measured: list[Clearance]
) -> Iterator[LinkShape]:
    """Yield each shape of a link that is in a pair, once."""
    known = set()
    for clearance in measured:
        proximity = clearance.proximity(controller.state)
        links = proximity.links
        used = sorted({k for pair in proximity.pairs for k in pair if k < len(links)})
        for k in used:
            # By identity: a robot has one list of shapes of each kind.
            if id(links[k]) not in known:
                known.add(id(links[k]))
                yield links[k]


def _solid(shape: LinkShape) -> Json:
    """Return a shape as a three.js object in its joint's frame."""
    surface = material(MEASURED, opacity=MEASURED_OPACITY, glow=0.4)
    pose, geometry = shape.placement.homogeneous, shape.geometry
    match geometry:
        case coal.Sphere():
            solid = threejs.sphere(geometry.radius)
        case coal.Capsule():
            length, radius = 2.0 * geometry.halfLength, geometry.radius
            solid = threejs.capsule(length, radius, radius)
            pose = pose @ pose_at([0.0, 0.0, -0.5 * length])
        case coal.Cylinder():
            solid = threejs.cylinder(geometry.radius, 2.0 * geometry.halfLength)
        case coal.Box():
            solid = threejs.box((2.0 * np.asarray(geometry.halfSide)).tolist())
        case _:
            solid = facets(*triangles_of(geometry))
    return threejs.mesh(solid, surface, pose, shadow=False)
