"""The Pinocchio model of a robot in a compiled MuJoCo model, and its bodies' shapes.

It is built from the compiled values of MuJoCo, so that nothing depends on how the MJCF
was written: defaults, included files, inertias from geoms are all resolved.

A body's joints are chained in the body's frame (MuJoCo's documentation,
"Computation", kinematic tree), each about its anchor ``jnt_pos``:

    body in parent = (body_pos, body_quat) Π anchor · motion(qpos - qpos0) · anchor⁻¹

So the bodies' poses at q = qpos are MuJoCo's, and q is qpos except for the order of a
quaternion's components.

A geom collides if its contype or its conaffinity is not zero; the pairing of these
masks is ignored: many models let a robot collide with the floor only, to be faster. As
in MuJoCo, a mesh collides as its convex hull. Geoms that do not collide are visuals, if
they are in one of the groups that MuJoCo's viewers show by default (0 to 2). A body
without visuals shows its colliding geoms.
"""

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import ModelError
from hsp_control.companions.mujoco.scene import (
    Selection,
    constants,
    dofs_of,
    effort_range,
    is_scalar,
    joint_total,
)
from hsp_control.robot.description.sources import BodyShape, ShapeKind

_AXES = np.eye(3)
_HINGES = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
_SLIDES = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ


def pose(position: Array, wxyz: Array) -> pin.SE3:
    """Return a pose from MuJoCo's position [m] and quaternion (w, x, y, z)."""
    w, x, y, z = (float(number) for number in wxyz)
    rotation = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    return pin.SE3(rotation, np.array(position, dtype=float))


def build_model(selection: Selection) -> pin.Model:
    """Return the Pinocchio model, with a frame per body, joint and site."""
    return _ModelBuilder(selection).model


class _ModelBuilder:
    """Adds the bodies of a scene to a model, from the world outwards."""

    def __init__(self, selection: Selection) -> None:
        self._selection, self._scene = selection, selection.model
        self._inside, self._moving = set(selection.bodies), set(selection.moving)
        self._kinds = constants("mjtJoint")
        self.model = pin.Model()
        self.model.name = selection.names.bodies[selection.root]
        off = self._scene.opt.disableflags & constants("mjtDisableBit").mjDSBL_GRAVITY
        gravity = np.array(self._scene.opt.gravity)
        self.model.gravity.linear = np.zeros(3) if off else gravity
        # For each body: its parent joint, and its pose in that joint's frame.
        self._places: list[tuple[int, pin.SE3]] = []
        for body in range(self._scene.nbody):
            self._places.append(self._placed(body))
            if body in self._inside:
                self._fill(body)
        self._add_sites()

    def _placed(self, body: int) -> tuple[int, pin.SE3]:
        """Return the placement of a body, after adding its joints."""
        scene = self._scene
        if body == 0:
            return 0, pin.SE3.Identity()
        parent, place = self._places[scene.body_parentid[body]]
        place = place * pose(scene.body_pos[body], scene.body_quat[body])
        first = int(scene.body_jntadr[body])
        for joint in range(first, first + int(scene.body_jntnum[body])):
            if scene.jnt_type[joint] == self._kinds.mjJNT_FREE:
                place = pin.SE3.Identity()  # its coordinates are the body's pose
            anchor = pin.SE3(np.eye(3), np.array(scene.jnt_pos[joint]))
            if joint in self._moving:
                parent = self._add_joint(parent, place * anchor, joint)
                place = anchor.inverse()
            else:
                place = place * anchor * self._locked(joint) * anchor.inverse()
        return parent, place

    def _locked(self, joint: int) -> pin.SE3:
        """Return the motion of a joint that is locked."""
        at = int(self._scene.jnt_qposadr[joint])
        qpos, kind = self._selection.qpos, self._scene.jnt_type[joint]
        if kind == self._kinds.mjJNT_FREE:
            return pose(qpos[at : at + 3], qpos[at + 3 : at + 7])
        if kind == self._kinds.mjJNT_BALL:
            return pose(np.zeros(3), qpos[at : at + 4])
        return self._moved(joint, float(qpos[at]))

    def _moved(self, joint: int, qpos: float) -> pin.SE3:
        """Return the motion of a hinge or a slide from the reference to a value."""
        scene = self._scene
        way = qpos - float(scene.qpos0[scene.jnt_qposadr[joint]])
        vector = way * np.array(scene.jnt_axis[joint])
        if scene.jnt_type[joint] == self._kinds.mjJNT_HINGE:
            return pin.SE3(pin.exp3(vector), np.zeros(3))
        return pin.SE3(np.eye(3), vector)

    def _add_joint(self, parent: int, place: pin.SE3, joint: int) -> int:
        scene, model, kinds = self._scene, self.model, self._kinds
        name = self._selection.names.joints[joint]
        if model.existJointName(name):
            raise ModelError(f"joint {name!r}: the model has this name already")
        if is_scalar(scene, joint):
            place = place * self._moved(joint, 0.0)  # so that q is qpos, not qpos - ref
            turns = scene.jnt_type[joint] == kinds.mjJNT_HINGE
            made = _scalar_joint(np.array(scene.jnt_axis[joint]), turns=turns)
            index = model.addJoint(parent, made, place, name, *self._limits(joint))
        else:
            free = scene.jnt_type[joint] == kinds.mjJNT_FREE
            made = pin.JointModelFreeFlyer() if free else pin.JointModelSpherical()
            index = model.addJoint(parent, made, place, name)
        dofs, at = dofs_of(scene, joint), model.idx_vs[index]
        own = slice(at, at + dofs.stop - dofs.start)
        model.armature[own] = joint_total(scene, joint, "armature")
        model.damping[own] = joint_total(scene, joint, "damping")
        model.upperDryFrictionLimit[own] = scene.dof_frictionloss[dofs]
        model.lowerDryFrictionLimit[own] = -scene.dof_frictionloss[dofs]
        model.addJointFrame(index)
        return int(index)

    def _limits(self, joint: int) -> list[Array]:
        """Return effort, velocity, lower and upper limit of a hinge or a slide."""
        scene, low, high = self._scene, -np.inf, np.inf
        if scene.jnt_limited[joint]:
            low, high = map(float, scene.jnt_range[joint])
        weakest, strongest = effort_range(scene, joint)
        effort = max(0.0, min(-weakest, strongest))
        return [np.array([limit]) for limit in (effort, np.inf, low, high)]

    def _fill(self, body: int) -> None:
        """Add a body's inertia and its frame."""
        joint, place = self._places[body]
        scene = self._scene
        moments = np.array(scene.body_inertia[body], dtype=float)
        mass = float(scene.body_mass[body])
        if joint and (mass > 0.0 or moments.any()):
            center = self._inertial_frame(body)
            inertia = pin.Inertia(mass, np.zeros(3), np.diag(moments))
            self.model.appendBodyToJoint(joint, center.act(inertia), place)
        name = self._selection.names.bodies[body]
        self.model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.BODY))

    def _inertial_frame(self, body: int) -> pin.SE3:
        """Return the frame of a body's inertia, rounded as in MuJoCo."""
        scene, same = self._scene, constants("mjtSameFrame")
        center = pose(scene.body_ipos[body], scene.body_iquat[body])
        if scene.body_sameframe[body] == same.mjSAMEFRAME_BODY:
            return pin.SE3.Identity()
        if scene.body_sameframe[body] == same.mjSAMEFRAME_BODYROT:
            center.rotation = np.eye(3)
        return center

    def _add_sites(self) -> None:
        scene, names = self._scene, self._selection.names.sites
        for site in range(scene.nsite):
            body = int(scene.site_bodyid[site])
            if body in self._inside:
                joint, place = self._places[body]
                own = pose(scene.site_pos[site], scene.site_quat[site])
                kind = pin.FrameType.OP_FRAME
                self.model.addFrame(pin.Frame(names[site], joint, 0, place * own, kind))


def _scalar_joint(axis: Array, *, turns: bool) -> Any:
    """Return Pinocchio's joint for an axis; the aligned ones are faster."""
    for k in range(3):
        if np.array_equal(axis, _AXES[k]):
            return (_HINGES if turns else _SLIDES)[k]()
    if turns:
        return pin.JointModelRevoluteUnaligned(axis)
    return pin.JointModelPrismaticUnaligned(axis)


# --- shapes --------------------------------------------------------------------------

_SHOWN_GROUPS = 3
_DEFAULT_COLOR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
"""The colour of a geom for which its material's colour is used."""


def body_shapes(selection: Selection) -> tuple[BodyShape, ...]:
    """Return the shapes of the robot's bodies, without those of the world."""
    scene, found = selection.model, []
    meshes: dict[int, tuple[Array, Indices]] = {}  # several geoms may share one
    for body in filter(None, selection.bodies):
        geoms = [g for g in _geoms(scene, body) if int(scene.geom_type[g]) in _kinds()]
        colliding = set(_colliding(scene, body))
        shown = {g for g in geoms if scene.geom_group[g] < _SHOWN_GROUPS}
        seen = (shown - colliding) or colliding
        for geom in geoms:
            if geom not in seen and geom not in colliding:
                continue
            kind, color = _kinds()[int(scene.geom_type[geom])], _color(scene, geom)
            number = int(scene.geom_dataid[geom])
            if kind == "mesh" and number not in meshes:
                meshes[number] = _mesh(scene, number)
            shape = BodyShape(
                body=selection.names.bodies[body],
                kind=kind,
                size=_size(kind, [float(x) for x in scene.geom_size[geom]]),
                pose=pose(scene.geom_pos[geom], scene.geom_quat[geom]).homogeneous,
                color=color,
                seen=geom in seen and color[3] > 0.0,
                collides=geom in colliding,
                mesh=meshes[number] if kind == "mesh" else None,
            )
            found.append(shape)
    return tuple(found)


def excluded_pairs(selection: Selection) -> frozenset[frozenset[str]]:
    """Return the pairs of bodies that the model excludes from collisions, by name."""
    names = selection.names.bodies
    signatures = map(
        int, selection.model.exclude_signature
    )  # two indices in one number
    return frozenset(
        frozenset((names[signature >> 16], names[signature & 0xFFFF]))
        for signature in signatures
    )


def shapeless_geoms(selection: Selection) -> list[str]:
    """Return the colliding geoms of the robot that have no counterpart here."""
    scene = selection.model
    return [
        scene.geom(geom).name or f"geom_{geom}"
        for body in filter(None, selection.bodies)
        for geom in _colliding(scene, body)
        if int(scene.geom_type[geom]) not in _kinds()
    ]


@cache
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


def _mesh(scene: Any, mesh: int) -> tuple[Array, Indices]:
    first, count = int(scene.mesh_vertadr[mesh]), int(scene.mesh_vertnum[mesh])
    vertices = np.array(scene.mesh_vert[first : first + count], dtype=float)
    first, count = int(scene.mesh_faceadr[mesh]), int(scene.mesh_facenum[mesh])
    triangles = np.array(scene.mesh_face[first : first + count], dtype=np.int64)
    return vertices, triangles


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
