"""Small artificial robots of every kind that the dynamics distinguish.

Mimic joints at the end and below free joints, chains of them, a follower before its
leader, continuous, planar and spherical joints, floating bases, a loop closed by a
locked joint, rotors.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from robot_texts import joint, link, robot_xml

from hsp_control import Robot


def follow(leader: str, multiplier: float = 1.0, offset: float = 0.0) -> str:
    """Return a URDF's mimic element."""
    return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def chain(*joints: tuple[str, str, str]) -> str:
    """Return the URDF of a serial chain with joints (name, type, inner elements)."""
    parts = [link("base")]
    for k, (name, kind, inner) in enumerate(joints):
        parent = f"link{k - 1}" if k else "base"
        parts += [link(f"link{k}"), joint(name, parent, f"link{k}", kind, inner)]
    return robot_xml(*parts)


_SLIDES, _TURNS = "prismatic", "revolute"
_LIFT = ("lift", _SLIDES, ""), ("stage", _SLIDES, follow("lift"))
_ARM = ("shoulder", _TURNS, ""), ("elbow", _TURNS, ""), ("wrist", _TURNS, "")

TEXTS = {
    "arm": chain(*_ARM),
    "gripper": chain(*_ARM, ("jaw", _SLIDES, follow("wrist", -0.1, 0.02))),
    "lift below an arm": chain(*_LIFT, *_ARM),
    "chain of mimics": chain(
        *_ARM,
        ("knuckle", _TURNS, follow("wrist", 0.8)),
        ("finger", _TURNS, follow("knuckle", 0.9, 0.1)),
        ("tip", _TURNS, follow("finger", -0.5)),
        ("tool", _TURNS, ""),
    ),
    "follower first": chain(
        ("boom", _TURNS, follow("shoulder", 0.7, 0.1)), *_ARM
    ),
    "continuous": chain(
        ("mast", "continuous", ""), ("counter", "continuous", follow("mast", 2.0)),
        *_ARM,
    ),
    "planar joint": chain(("cart", "planar", ""), *_ARM),
    "follower first on a cart": chain(
        ("cart", "planar", ""), ("boom", _TURNS, follow("shoulder", -0.5, 0.1)), *_ARM
    ),
}  # fmt: skip
"""URDFs by kind."""


def _with_box(
    model: pin.Model, parent: int, kind: pin.JointModel, rng: np.random.Generator
) -> int:
    """Add a joint at a random placement with a box; return its index."""
    k = model.njoints - 1
    place = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-1, 1, 3)), rng.uniform(size=3))
    joint: int = model.addJoint(parent, kind, place, f"joint{k}")
    inertia = pin.Inertia.FromBox(2.0, 0.3, 0.2, 0.1)
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addBodyFrame(f"link{k}", joint, pin.SE3.Identity(), 0)
    return joint


def _of_pinocchio() -> Robot:
    """Return an arm on a spherical joint, with rotors."""
    model, parent = pin.Model(), 0
    rng = np.random.default_rng(3)
    joints = pin.JointModelSpherical(), pin.JointModelRX(), pin.JointModelRUBZ()
    for kind in joints:
        parent = _with_box(model, parent, kind, rng)
    model.armature[:] = rng.uniform(0.1, 0.5, model.nv)
    return Robot.from_pinocchio(model)


def _ball_between() -> Robot:
    """Return a robot with a multi-DOF joint between a leader and its follower."""
    model, rng = pin.Model(), np.random.default_rng(4)
    parent, kinds = 0, [pin.JointModelRY(), pin.JointModelSpherical(), None]
    for given in (*kinds, pin.JointModelPX()):
        kind = given or pin.JointModelMimic(model.joints[1], -0.5, 0.1)
        parent = _with_box(model, parent, kind, rng)
    model.armature[:] = rng.uniform(0.1, 0.5, model.nv)
    return Robot.from_pinocchio(model)


def _of_text(
    name: str, root: str = "fixed", locked: dict[str, float] | None = None
) -> Callable[[Path], Robot]:
    def load(folder: Path) -> Robot:
        file = folder / "robot.urdf"
        file.write_text(TEXTS[name])
        return Robot.load(file, root=root, locked=locked)  # type: ignore[arg-type]

    return load


KINDS: dict[str, Callable[[Path], Robot]] = {
    **{name: _of_text(name) for name in TEXTS},
    "lift on a planar base": _of_text("lift below an arm", "planar"),
    "lift on a floating base": _of_text("lift below an arm", "free_flyer"),
    "follower first, floating": _of_text("follower first", "free_flyer"),
    "arm on a floating base": _of_text("arm", "free_flyer"),
    "locked below mimics": _of_text("chain of mimics", locked={"elbow": 0.4}),
    "locked leader": _of_text("lift below an arm", locked={"lift": 0.1}),
    "ball, rotors": lambda folder: _of_pinocchio(),
    "ball between leader and follower": lambda folder: _ball_between(),
}
"""Functions that load a new robot of a kind from the given folder."""
