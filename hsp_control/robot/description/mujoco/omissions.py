"""What a MuJoCo model has and a robot made of it lacks, in words.

A robot is rigid bodies, joints, armatures, symmetric limits and joint friction. All
else that acts on its bodies is named here, so that nothing is silently left out.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from hsp_control.common.suggestions import listing
from hsp_control.robot.description.mujoco import motors
from hsp_control.robot.description.mujoco.constants import constants
from hsp_control.robot.description.mujoco.dynamics import dofs_of
from hsp_control.robot.description.mujoco.selection import Selection
from hsp_control.robot.description.mujoco.shapes import shapeless_geoms

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
