"""The geoms of a robot in a MuJoCo model, and what a robot made of it lacks, in words.

A geom collides if its contype or its conaffinity is not zero; with what, does not
matter here: many models let a robot collide with the floor only, to be faster. As in
MuJoCo, a mesh collides as its convex hull.

What does not collide is there to be seen, if it is in one of the groups that MuJoCo's
viewers show at first (0 to 2). Of a body without such geoms, those are seen that
collide.

A robot is rigid bodies, joints, armatures, symmetric limits and joint friction. All
else that acts on its bodies is named here, so that nothing is silently left out.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.suggestions import listing
from hsp_control.robot.description.body_shape import BodyShape, ShapeKind
from hsp_control.robot.description.mujoco import motors
from hsp_control.robot.description.mujoco.constants import constants
from hsp_control.robot.description.mujoco.dynamics import dofs_of, pose
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


_OF_TENDONS = "stiffness", "damping", "frictionloss", "limited", "armature"


def omissions(selection: Selection) -> tuple[str, ...]:
    """Return one sentence for each kind of thing that the robot lacks."""
    parts = _of_joints, _of_bodies, _of_actuators, _of_tendons, _of_equalities
    return tuple(sentence for part in parts for sentence in part(selection))


def _sentence(what: str, names: Iterable[str], why: str) -> Iterator[str]:
    found = list(names)
    if found:
        yield f"{what} {listing(found)}: {why}"


def _of_joints(selection: Selection) -> Iterator[str]:
    scene, names = selection.model, selection.names.joints
    kinds = constants("mjtJoint")
    kind = {joint: int(scene.jnt_type[joint]) for joint in selection.moving}
    scalar = [j for j in kind if kind[j] in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)]
    above = [
        joint
        for joint in range(scene.njnt)
        if int(scene.jnt_bodyid[joint]) in _ancestors(scene, selection.root)
    ]
    yield from _sentence(
        "joints above the root", (names[j] for j in above), "they stand still"
    )
    springs = [j for j in kind if _nonzero(scene, "jnt_stiffness", j)]
    yield from _sentence("springs at joints", (names[j] for j in springs), "no force")
    curved = [j for j in kind if _nonzero(scene, "dof_dampingpoly", _first(scene, j))]
    yield from _sentence(
        "joints", (names[j] for j in curved), "only the linear part of their damping"
    )
    limited = [j for j in kind if kind[j] == kinds.mjJNT_BALL and scene.jnt_limited[j]]
    yield from _sentence("ball joints", (names[j] for j in limited), "no limit")
    heavy = [
        j
        for j in kind
        if kind[j] == kinds.mjJNT_FREE
        and np.any(motors.armature(scene, j, dofs_of(scene, j))[:3])
    ]
    yield from _sentence(
        "free joints",
        (names[j] for j in heavy),
        "the armature of their translation is in M, but not in the Coriolis forces",
    )
    lopsided = [j for j in scalar if _lopsided(scene, j)]
    yield from _sentence(
        "joints",
        (names[j] for j in lopsided),
        "their effort has different limits in both directions; the smaller one counts, "
        "and none if that is zero",
    )


def _of_bodies(selection: Selection) -> Iterator[str]:
    scene, names = selection.model, selection.names.bodies
    bodies = [body for body in selection.bodies if body]
    moved = [b for b in bodies if scene.body_mocapid[b] >= 0]
    yield from _sentence("mocap bodies", (names[b] for b in moved), "they stand still")
    light = [b for b in bodies if scene.body_gravcomp[b]]
    yield from _sentence(
        "bodies", (names[b] for b in light), "no compensation of their gravity"
    )
    plugins = [b for b in bodies if scene.body_plugin[b] >= 0]
    yield from _sentence("plugins at bodies", (names[b] for b in plugins), "no force")
    soft = set(map(int, scene.flex_vertbodyid)) & set(bodies) if scene.nflex else set()
    yield from _sentence(
        "flexes at bodies", (names[b] for b in sorted(soft)), "no force"
    )
    yield from _sentence(
        "geoms", shapeless_geoms(selection), "no distance to them is known"
    )
    if scene.opt.density or scene.opt.viscosity:
        yield "the fluid around it: no force"


def _of_actuators(selection: Selection) -> Iterator[str]:
    scene, names = selection.model, selection.names
    direct = motors.joint_actuators(scene)
    on_joints = [a for joint in selection.moving for a in direct.get(joint, ())]
    servos = [a for a in on_joints if motors.motor(scene, a) is None]
    yield from _sentence(
        "actuators", (names.actuators[a] for a in servos),
        "they are not torque motors (a servo, a muscle, a motor with dynamics, or one "
        "on a ball or free joint); their forces are not known to the controller",
    )  # fmt: skip
    others = [
        actuator
        for actuator in range(len(scene.actuator_trntype))
        if actuator not in {a for each in direct.values() for a in each}
        and _acts_on(selection, actuator)
    ]
    yield from _sentence(
        "actuators", (names.actuators[a] for a in others),
        "they act through a tendon, a site, a slider-crank or a body, not on a joint; "
        "their forces are not known to the controller",
    )  # fmt: skip
    if on_joints:
        kinds = constants("mjtJoint")
        passive = [
            joint
            for joint in selection.moving
            if joint not in direct and scene.jnt_type[joint] != kinds.mjJNT_FREE
        ]
        yield from _sentence(
            "joints", (names.joints[j] for j in passive),
            "no actuator acts on them; the controller takes them for actuated",
        )  # fmt: skip


def _of_tendons(selection: Selection) -> Iterator[str]:
    scene = selection.model
    acting = []
    for tendon in range(scene.ntendon):
        acts = any(
            _nonzero(scene, f"tendon_{quantity}", tendon) for quantity in _OF_TENDONS
        )
        if acts and _tendon_bodies(scene, tendon) & _moved_bodies(selection):
            acting.append(scene.tendon(tendon).name or f"tendon_{tendon}")
    yield from _sentence(
        "tendons", acting, "no stiffness, damping, friction, limit or armature"
    )


def _of_equalities(selection: Selection) -> Iterator[str]:
    scene, kinds = selection.model, constants("mjtEq")
    moved = _moved_bodies(selection)
    found = []
    for index in range(scene.neq):
        kind = scene.eq_type[index]
        ends = [int(scene.eq_obj1id[index]), int(scene.eq_obj2id[index])]
        if kind == kinds.mjEQ_JOINT:
            bodies = {int(scene.jnt_bodyid[end]) for end in ends if end >= 0}
        elif kind == kinds.mjEQ_TENDON:
            bodies = set().union(*(_tendon_bodies(scene, e) for e in ends if e >= 0))
        elif kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            continue  # of flexes, which are named as such
        elif scene.eq_objtype[index] == constants("mjtObj").mjOBJ_SITE:
            bodies = {int(scene.site_bodyid[end]) for end in ends}
        else:
            bodies = set(ends)
        if scene.eq_active0[index] and bodies & moved:
            found.append(scene.equality(index).name or f"equality_{index}")
    yield from _sentence("equality constraints", found, "no constraint")


def _acts_on(selection: Selection, actuator: int) -> bool:
    """Return whether an actuator that is not on a joint acts on the robot."""
    scene, kinds = selection.model, constants("mjtTrn")
    first, second = (int(end) for end in scene.actuator_trnid[actuator])
    kind = scene.actuator_trntype[actuator]
    if kind == kinds.mjTRN_TENDON:
        bodies = _tendon_bodies(scene, first)
    elif kind == kinds.mjTRN_BODY:
        bodies = {first}
    else:
        bodies = {int(scene.site_bodyid[end]) for end in (first, second) if end >= 0}
    return bool(bodies & _moved_bodies(selection))


def _tendon_bodies(scene: Any, tendon: int) -> set[int]:
    kinds = constants("mjtWrap")
    first = int(scene.tendon_adr[tendon])
    bodies = set()
    for wrap in range(first, first + int(scene.tendon_num[tendon])):
        kind, what = scene.wrap_type[wrap], int(scene.wrap_objid[wrap])
        if kind == kinds.mjWRAP_JOINT:
            bodies.add(int(scene.jnt_bodyid[what]))
        elif kind == kinds.mjWRAP_SITE:
            bodies.add(int(scene.site_bodyid[what]))
    return bodies


def _moved_bodies(selection: Selection) -> set[int]:
    """Return the bodies that a joint of the robot moves."""
    scene = selection.model
    carrying = {int(scene.jnt_bodyid[joint]) for joint in selection.moving}
    moved: set[int] = set()
    for body in selection.bodies:
        if body in carrying or int(scene.body_parentid[body]) in moved:
            moved.add(body)
    return moved


def _ancestors(scene: Any, body: int) -> set[int]:
    found = set()
    while body:
        body = int(scene.body_parentid[body])
        found.add(body)
    return found


def _lopsided(scene: Any, joint: int) -> bool:
    low, high = motors.effort_range(scene, joint)
    return bool(not np.isclose(-low, high) and np.isfinite([low, high]).any())


def _first(scene: Any, joint: int) -> int:
    return int(scene.jnt_dofadr[joint])


def _nonzero(scene: Any, quantity: str, index: int) -> bool:
    """Return whether a quantity, or its terms of higher order, is not zero."""
    names = quantity, f"{quantity}poly"  # MuJoCo 3.3 lacks some of them
    return any(np.any(getattr(scene, n)[index]) for n in names if hasattr(scene, n))
