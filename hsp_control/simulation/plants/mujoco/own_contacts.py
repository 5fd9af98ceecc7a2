"""Contacts of a robot with itself, which a scene may have by mistake.

MuJoCo has no contacts between a body and its parent, except where the parent stands
still: a base that its first link overlaps holds this link like a brake.
"""

from typing import Any

from hsp_control.robot import Robot
from hsp_control.robot.description.mujoco.names import Names

_DEEP = 1e-3
"""Depth below which parts touch, and do not overlap [m]."""


def own_overlaps(robot: Robot, model: Any, data: Any) -> dict[str, float]:
    """Return how deep [m] parts of a robot overlap, by ``base and link1``.

    Parts are what its joints move, and what they are mounted on.
    """
    names = Names(model)
    joints = [names.joints.index(name) for name in robot.joints]
    jointed = {int(model.jnt_bodyid[joint]) for joint in joints}
    moved = {
        body for body in range(model.nbody) if jointed & _with_parents(model, body)
    }
    mounts = set().union(*(_with_parents(model, body) for body in jointed))
    found: dict[str, float] = {}
    for contact in data.contact[: data.ncon]:
        if min(contact.geom1, contact.geom2) < 0 or contact.dist > -_DEEP:
            continue  # of a flex, or a touch
        pair = {int(model.geom_bodyid[g]) for g in (contact.geom1, contact.geom2)}
        if pair <= moved | mounts and pair & moved:
            name = " and ".join(names.bodies[body] for body in sorted(pair))
            found[name] = max(found.get(name, 0.0), -float(contact.dist))
    return found


def _with_parents(model: Any, body: int) -> set[int]:
    """Return a body and those that carry it, without the world."""
    found = set()
    while body:
        found.add(body)
        body = int(model.body_parentid[body])
    return found
