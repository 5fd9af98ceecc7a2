"""The geoms of a robot in a MuJoCo model: what collides, and what is seen.

A geom collides if its contype or its conaffinity is not zero; with what, does not
matter here: many models let a robot collide with the floor only, to be faster. As in
MuJoCo, a mesh collides as its convex hull.

What does not collide is there to be seen, if it is in one of the groups that MuJoCo's
viewers show at first (0 to 2). Of a body without such geoms, those are seen that
collide.
"""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.robot.description.body_shape import BodyShape, ShapeKind
from hsp_control.robot.description.mujoco.constants import constants
from hsp_control.robot.description.mujoco.dynamics import pose
from hsp_control.robot.description.mujoco.selection import Selection

_SHOWN_GROUPS = 3
_DEFAULT_COLOR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
"""Where a geom has this colour, that of its material counts."""


def body_shapes(selection: Selection) -> tuple[BodyShape, ...]:
    """Return the shapes of the robot's bodies, without those of the world."""
    shapes = _Shapes(selection)
    return tuple(
        shape
        for body in selection.bodies
        if body
        for shape in shapes.of_body(body)
    )  # fmt: skip


def excluded_pairs(selection: Selection) -> frozenset[frozenset[str]]:
    """Return the pairs of bodies that the model excludes from collisions, by name."""
    names = selection.names.bodies
    signatures = map(int, selection.model.exclude_signature)  # two numbers in one
    return frozenset(
        frozenset((names[signature >> 16], names[signature & 0xFFFF]))
        for signature in signatures
    )


def shapeless_geoms(selection: Selection) -> list[str]:
    """Return the colliding geoms of the robot that have no counterpart here."""
    scene = selection.model
    return [
        scene.geom(geom).name or f"geom_{geom}"
        for body in selection.bodies
        if body
        for geom in _colliding(scene, body)
        if int(scene.geom_type[geom]) not in _kinds()
    ]


class _Shapes:
    """Makes the shapes; a mesh that several geoms have is read once."""

    def __init__(self, selection: Selection) -> None:
        self._scene, self._names = selection.model, selection.names.bodies
        self._meshes: dict[int, tuple[Array, Indices]] = {}

    def of_body(self, body: int) -> list[BodyShape]:
        """Return the shapes of a body."""
        scene = self._scene
        geoms = [g for g in _geoms(scene, body) if int(scene.geom_type[g]) in _kinds()]
        colliding = set(_colliding(scene, body))
        shown = {g for g in geoms if scene.geom_group[g] < _SHOWN_GROUPS}
        seen = (shown - colliding) or colliding
        return [
            self._shape(body, geom, seen=geom in seen, collides=geom in colliding)
            for geom in geoms
            if geom in seen or geom in colliding
        ]

    def _shape(self, body: int, geom: int, *, seen: bool, collides: bool) -> BodyShape:
        scene = self._scene
        kind = _kinds()[int(scene.geom_type[geom])]
        color = _color(scene, geom)
        return BodyShape(
            body=self._names[body],
            kind=kind,
            size=_size(kind, [float(x) for x in scene.geom_size[geom]]),
            pose=pose(scene.geom_pos[geom], scene.geom_quat[geom]).homogeneous,
            color=color,
            seen=seen and color[3] > 0.0,
            collides=collides,
            mesh=self._mesh(geom) if kind == "mesh" else None,
        )

    def _mesh(self, geom: int) -> tuple[Array, Indices]:
        scene, mesh = self._scene, int(self._scene.geom_dataid[geom])
        if mesh not in self._meshes:
            first, count = int(scene.mesh_vertadr[mesh]), int(scene.mesh_vertnum[mesh])
            vertices = np.array(scene.mesh_vert[first : first + count], dtype=float)
            first, count = int(scene.mesh_faceadr[mesh]), int(scene.mesh_facenum[mesh])
            triangles = np.array(scene.mesh_face[first : first + count], dtype=np.int64)
            self._meshes[mesh] = vertices, triangles
        return self._meshes[mesh]


def _kinds() -> dict[int, ShapeKind]:
    kinds = constants("mjtGeom")
    return {
        kinds.mjGEOM_SPHERE: "sphere",
        kinds.mjGEOM_CAPSULE: "capsule",
        kinds.mjGEOM_ELLIPSOID: "ellipsoid",
        kinds.mjGEOM_CYLINDER: "cylinder",
        kinds.mjGEOM_BOX: "box",
        kinds.mjGEOM_MESH: "mesh",
    }


def _size(kind: ShapeKind, half: list[float]) -> tuple[float, ...]:
    if kind == "box":
        return tuple(2.0 * x for x in half)
    if kind == "ellipsoid":
        return tuple(half)
    return {"sphere": (half[0],), "mesh": ()}.get(kind, (half[0], 2.0 * half[1]))


def _geoms(scene: Any, body: int) -> range:
    first = int(scene.body_geomadr[body])
    return range(first, first + int(scene.body_geomnum[body]))


def _colliding(scene: Any, body: int) -> list[int]:
    return [
        geom
        for geom in _geoms(scene, body)
        if scene.geom_contype[geom] or scene.geom_conaffinity[geom]
    ]


def _color(scene: Any, geom: int) -> tuple[float, float, float, float]:
    own, material = scene.geom_rgba[geom], int(scene.geom_matid[geom])
    if material >= 0 and np.array_equal(own, _DEFAULT_COLOR):
        own = scene.mat_rgba[material]
    red, green, blue, opacity = map(float, own)
    return red, green, blue, opacity
