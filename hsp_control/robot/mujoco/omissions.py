"""What a MuJoCo model has and the robot made of it lacks, in words.

A robot is rigid bodies, joints, armatures, symmetric limits and joint friction. All
else that acts on its bodies is named here, so that nothing is silently left out.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from hsp_control.common.suggestions import listing
from hsp_control.robot.mujoco.conversion import shapeless_geoms
from hsp_control.robot.mujoco.scene import (
    Selection,
    constants,
    effort_range,
    is_scalar,
    joint_actuators,
    joint_total,
    motor,
)

_OF_TENDONS = "stiffness", "damping", "frictionloss", "limited", "armature"

Lack = tuple[str, list[str], str]
"""What is lacking, the names of those that have it, and what that means."""


def omissions(selection: Selection) -> tuple[str, ...]:
    """Return one sentence for each kind of thing that the robot lacks."""
    parts = _of_joints, _of_bodies, _of_actuators, _of_constraints
    return tuple(
        f"{what} {listing(names)}: {why}"
        for part in parts
        for what, names, why in part(selection)
        if names
    )


def _of_joints(selection: Selection) -> Iterator[Lack]:
    scene, all_names = selection.model, selection.names.joints
    kinds, types = constants("mjtJoint"), scene.jnt_type
    above = _ancestors(scene, selection.root)

    def moving(lacks: Any) -> list[str]:
        return [all_names[joint] for joint in selection.moving if lacks(joint)]

    def curved(joint: int) -> bool:
        return _nonzero(scene, "dof_dampingpoly", int(scene.jnt_dofadr[joint]))

    def heavy(joint: int) -> bool:
        own = joint_total(scene, joint, "armature")
        return types[joint] == kinds.mjJNT_FREE and bool(np.any(own[:3]))

    def lopsided(joint: int) -> bool:
        if not is_scalar(scene, joint):
            return False
        low, high = effort_range(scene, joint)
        return bool(not np.isclose(-low, high) and np.isfinite([low, high]).any())

    there = [name for j, name in enumerate(all_names) if scene.jnt_bodyid[j] in above]
    yield "joints above the root", there, "they stand still"
    springs = moving(lambda joint: _nonzero(scene, "jnt_stiffness", joint))
    yield "springs at joints", springs, "no force"
    yield "joints", moving(curved), "only the linear part of their damping"
    balls = moving(lambda j: types[j] == kinds.mjJNT_BALL and scene.jnt_limited[j])
    yield "ball joints", balls, "no limit"
    yield (
        "free joints",
        moving(heavy),
        "the armature of their translation is in M, but not in the Coriolis forces",
    )
    yield (
        "joints",
        moving(lopsided),
        "their effort has different limits in both directions; the smaller one counts, "
        "and none if that is zero",
    )


def _of_bodies(selection: Selection) -> Iterator[Lack]:
    scene, names = selection.model, selection.names.bodies
    soft = set(map(int, scene.flex_vertbodyid)) if scene.nflex else set()

    def bodies(lacks: Any) -> list[str]:
        return [names[body] for body in selection.bodies if body and lacks(body)]

    mocap = bodies(lambda body: scene.body_mocapid[body] >= 0)
    yield "mocap bodies", mocap, "they stand still"
    light = bodies(lambda body: scene.body_gravcomp[body])
    yield "bodies", light, "no compensation of their gravity"
    plugins = bodies(lambda body: scene.body_plugin[body] >= 0)
    yield "plugins at bodies", plugins, "no force"
    yield "flexes at bodies", bodies(lambda body: body in soft), "no force"
    yield "geoms", shapeless_geoms(selection), "no distance to them is known"
    fluid = scene.opt.density or scene.opt.viscosity
    yield "the fluid", ["around it"] if fluid else [], "no force"


def _of_actuators(selection: Selection) -> Iterator[Lack]:
    scene, names = selection.model, selection.names
    direct = joint_actuators(scene)
    on_joints = [a for joint in selection.moving for a in direct.get(joint, ())]
    of_any_joint = {actuator for each in direct.values() for actuator in each}
    moved = _moved_bodies(selection)
    yield (
        "actuators",
        [names.actuators[a] for a in on_joints if motor(scene, a) is None],
        "they are not torque motors (a servo, a muscle, a motor with dynamics, or one "
        "on a ball or free joint); their forces are not known to the controller",
    )
    yield (
        "actuators",
        [
            name
            for actuator, name in enumerate(names.actuators)
            if actuator not in of_any_joint and _actuated(scene, actuator) & moved
        ],
        "they act through a tendon, a site, a slider-crank or a body, not on a joint; "
        "their forces are not known to the controller",
    )
    free = constants("mjtJoint").mjJNT_FREE
    yield (
        "joints",
        [
            names.joints[joint]
            for joint in selection.moving
            if on_joints and joint not in direct and scene.jnt_type[joint] != free
        ],
        "no actuator acts on them; the controller takes them for actuated",
    )


def _of_constraints(selection: Selection) -> Iterator[Lack]:
    scene, moved = selection.model, _moved_bodies(selection)
    tendons = [
        scene.tendon(tendon).name or f"tendon_{tendon}"
        for tendon in range(scene.ntendon)
        if any(_nonzero(scene, f"tendon_{each}", tendon) for each in _OF_TENDONS)
        and _tendon_bodies(scene, tendon) & moved
    ]
    yield "tendons", tendons, "no stiffness, damping, friction, limit or armature"
    equalities = [
        scene.equality(index).name or f"equality_{index}"
        for index in range(scene.neq)
        if scene.eq_active0[index] and _tied(scene, index) & moved
    ]
    yield "equality constraints", equalities, "no constraint"


def _actuated(scene: Any, actuator: int) -> set[int]:
    """Return the bodies on which an actuator acts that is not on a joint."""
    kind, kinds = scene.actuator_trntype[actuator], constants("mjtTrn")
    first, second = (int(end) for end in scene.actuator_trnid[actuator])
    if kind == kinds.mjTRN_TENDON:
        return _tendon_bodies(scene, first)
    if kind == kinds.mjTRN_BODY:
        return {first}
    return {int(scene.site_bodyid[end]) for end in (first, second) if end >= 0}


def _tied(scene: Any, equality: int) -> set[int]:
    """Return the bodies of an equality constraint; none of a flex, named as such."""
    kind, kinds = scene.eq_type[equality], constants("mjtEq")
    ends = [int(scene.eq_obj1id[equality]), int(scene.eq_obj2id[equality])]
    if kind == kinds.mjEQ_JOINT:
        return {int(scene.jnt_bodyid[end]) for end in ends if end >= 0}
    if kind == kinds.mjEQ_TENDON:
        return set().union(*(_tendon_bodies(scene, end) for end in ends if end >= 0))
    if kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
        return set()
    if scene.eq_objtype[equality] == constants("mjtObj").mjOBJ_SITE:
        return {int(scene.site_bodyid[end]) for end in ends}
    return set(ends)


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


def _nonzero(scene: Any, quantity: str, index: int) -> bool:
    """Return whether a quantity, or its terms of higher order, is not zero."""
    names = quantity, f"{quantity}poly"  # MuJoCo 3.3 lacks some of them
    return any(np.any(getattr(scene, n)[index]) for n in names if hasattr(scene, n))
