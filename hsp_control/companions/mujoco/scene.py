"""A compiled MuJoCo model: its names, its motors, and which part of it is the robot."""

import importlib
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within

_log = logging.getLogger(__name__)


def import_mujoco() -> Any:
    """Return the module ``mujoco``; its warnings go to our log, not to a file."""
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError as error:
        raise ModelError(
            "a MuJoCo model needs MuJoCo, which is not installed; install it with: "
            "pip install 'hsp_control[mujoco]'"
        ) from error
    if mujoco.get_mju_user_warning() is None:  # otherwise MuJoCo writes a log file
        mujoco.set_mju_user_warning(_log.info)
    return mujoco


@cache
def constants(kind: str) -> Any:
    """Return the members of ``mjtJoint`` and so on, as integers: these compare."""
    members = getattr(import_mujoco(), kind).__members__
    return SimpleNamespace(**{name: int(value) for name, value in members.items()})


def is_scalar(model: Any, joint: int) -> bool:
    """Return whether a joint is a hinge or a slide."""
    kinds = constants("mjtJoint")
    return int(model.jnt_type[joint]) in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)


# --- names ---------------------------------------------------------------------------


class Names:
    """The names of the bodies, joints, sites and actuators of a model, by number.

    Unnamed objects are called by kind and number in the model: ``joint_3``. The
    first body is ``world``. A site that is called like a body is called
    ``site:<name>``, so that both are frames.
    """

    def __init__(self, model: Any) -> None:
        self.bodies = _distinct("body", model.body, model.nbody)
        self.joints = _distinct("joint", model.joint, model.njnt)
        count = len(
            model.actuator_trntype
        )  # nu is the number of controls since MuJoCo 4
        self.actuators = _distinct("actuator", model.actuator, count)
        bodies, sites = set(self.bodies), _distinct("site", model.site, model.nsite)
        self.sites = tuple(f"site:{name}" if name in bodies else name for name in sites)


def _distinct(kind: str, get: Callable[[int], Any], count: int) -> tuple[str, ...]:
    names = [str(get(index).name) for index in range(count)]
    taken = set(names)
    for index, given in enumerate(names):
        name = given or f"{kind}_{index}"
        while not given and name in taken:
            name += "_"
        names[index] = name
    return tuple(names)


# --- motors --------------------------------------------------------------------------


@dataclass(frozen=True)
class Motor:
    """An actuator whose force on one hinge or slide is its control, times a factor."""

    actuator: int  # its number
    control: int  # the address of its control in ``ctrl``
    factor: float  # effort per control: its gain times its gear
    lower: float  # its lowest effort [N·m or N]
    upper: float  # its highest effort [N·m or N]


def joint_actuators(model: Any) -> dict[int, list[int]]:
    """Return the actuators that act on a joint directly, by joint."""
    kinds = constants("mjtTrn")
    direct = {kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT}
    of_balls = getattr(kinds, "mjTRN_SO3", None)  # since MuJoCo 4: of two sites, too
    found: dict[int, list[int]] = {}
    for actuator, kind in enumerate(map(int, model.actuator_trntype)):
        target, second = map(int, model.actuator_trnid[actuator])
        if kind in direct or (kind == of_balls and second < 0):
            found.setdefault(target, []).append(actuator)
    return found


def motor(model: Any, actuator: int) -> Motor | None:
    """Return a direct torque motor, or None if the actuator is of another kind."""
    joint = int(model.actuator_trnid[actuator, 0])
    if (
        joint not in range(model.njnt)
        or actuator not in joint_actuators(model).get(joint, ())
        or not is_scalar(model, joint)
        or int(model.actuator_gaintype[actuator]) != constants("mjtGain").mjGAIN_FIXED
        or int(model.actuator_biastype[actuator]) != constants("mjtBias").mjBIAS_NONE
        or int(model.actuator_dyntype[actuator]) != constants("mjtDyn").mjDYN_NONE
        or int(model.actuator_plugin[actuator]) >= 0
        or float(getattr(model, "actuator_delay", np.zeros(actuator + 1))[actuator])
    ):
        return None
    addresses = getattr(model, "actuator_ctrladr", None)  # since MuJoCo 4
    control = actuator if addresses is None else int(addresses[actuator])
    gear = float(model.actuator_gear[actuator, 0])
    gain = float(model.actuator_gainprm[actuator, 0])
    low, high = -np.inf, np.inf
    if model.actuator_ctrllimited[control]:
        low, high = sorted(float(x) * gain for x in model.actuator_ctrlrange[control])
    if model.actuator_forcelimited[actuator]:
        low = max(low, float(model.actuator_forcerange[actuator, 0]))
        high = min(high, float(model.actuator_forcerange[actuator, 1]))
    low, high = sorted((low * gear, high * gear)) if gear else (0.0, 0.0)
    return Motor(actuator, control, gain * gear, low, high)


def effort_range(model: Any, joint: int) -> tuple[float, float]:
    """Return the lowest and the highest effort on a joint [N·m or N].

    It is the sum of its actuators' limits, within the range of the joint's own total
    (``actuatorfrcrange``). An actuator that is no motor has its ``forcerange``.
    Without any actuator there is no limit.
    """
    ranges = [_range(model, each) for each in joint_actuators(model).get(joint, ())]
    low, high = np.sum(ranges, axis=0) if ranges else (-np.inf, np.inf)
    if model.jnt_actfrclimited[joint]:
        low = max(low, model.jnt_actfrcrange[joint, 0])
        high = min(high, model.jnt_actfrcrange[joint, 1])
    return float(low), float(high)


def _range(model: Any, actuator: int) -> tuple[float, float]:
    found = motor(model, actuator)
    if found is not None:
        return found.lower, found.upper
    if not model.actuator_forcelimited[actuator]:
        return -np.inf, np.inf
    limits = model.actuator_forcerange[actuator] * model.actuator_gear[actuator, 0]
    low, high = sorted(map(float, limits))
    return low, high


def dofs_of(model: Any, joint: int) -> slice:
    """Return the indices of a joint's degrees of freedom in qvel."""
    kinds = constants("mjtJoint")
    sizes = {kinds.mjJNT_FREE: 6, kinds.mjJNT_BALL: 3}
    first = int(model.jnt_dofadr[joint])
    return slice(first, first + sizes.get(int(model.jnt_type[joint]), 1))


def joint_total(model: Any, joint: int, quantity: str) -> Array:
    """Return ``armature`` or ``damping`` of a joint's dofs, with its actuators'.

    These are the rotor inertia [kg·m² or kg] and the viscous friction [N·m·s/rad or
    N·s/m].
    """
    own = getattr(model, f"dof_{quantity}")[dofs_of(model, joint)]
    owner = getattr(model, "jnt_actuatorid", None)
    if owner is None or owner[joint] < 0:
        return np.asarray(own + 0.0)
    actuator = int(owner[joint])
    gear = float(model.actuator_gear[actuator, 0])
    added = gear**2 * float(getattr(model, f"actuator_{quantity}")[actuator])
    return np.asarray(own + added)


# --- which part of it is the robot ---------------------------------------------------


@dataclass(frozen=True, eq=False)
class Selection:
    """A robot in a MuJoCo scene."""

    model: Any  # the compiled model of the scene
    names: Names  # its names
    root: int  # the body whose subtree is the robot; 0: the robot is the whole scene
    bodies: tuple[int, ...]  # the bodies of that subtree, in ascending order
    # the joints that move, in ascending order: the order of q and v
    moving: tuple[int, ...]
    # the scene's configuration, shape (model.nq,): all other joints are locked there,
    # and the robot's home is there
    qpos: Array
    # whether that configuration was chosen; otherwise it is the model's own
    chosen: bool

    @property
    def locked(self) -> tuple[int, ...]:
        """The joints of the robot that do not move."""
        model, moving = self.model, set(self.moving)
        return tuple(
            joint
            for joint in range(model.njnt)
            if model.jnt_bodyid[joint] in self.bodies and joint not in moving
        )


def select(
    model: Any,
    root: str | None = None,
    joints: Sequence[str] | None = None,
    qpos: ArrayLike | None = None,
    keyframe: str | None = None,
    locked: Mapping[str, float] | None = None,
) -> Selection:
    """Return the robot that a root and the names of its moving joints select.

    ``root`` None: the whole scene; ``joints`` None: all of the subtree. The scene's
    configuration is ``qpos`` (model.nq,), or that of a ``keyframe``. ``locked`` joints
    stay at these values [rad or m], whatever the configuration declares.
    """
    names, locked, top = Names(model), locked or {}, 0
    if root is not None:
        if root not in names.bodies:
            with within("root"):
                raise FrameNotFoundError(
                    f"no body {root!r}{did_you_mean(root, names.bodies)} "
                    f"(the scene has {listing(names.bodies)})"
                )
        top = names.bodies.index(root)
    bodies = _subtree(model, top)
    inside = {
        names.joints[joint]: joint
        for joint in range(model.njnt)
        if int(model.jnt_bodyid[joint]) in bodies
    }
    chosen = set(inside if joints is None else joints) - set(locked)
    with within("joints"):
        _check_joints(names, joints or (), inside)
    with within("locked"):
        _check_joints(names, locked, inside)
        for name in locked:
            if name in (joints or ()):
                raise ModelError(f"{name!r} is one of the joints that move")
    moving = tuple(joint for name, joint in inside.items() if name in chosen)
    if not moving:
        raise ModelError(
            f"no joint of {names.bodies[top]!r} moves; at least one must be left to "
            "control"
        )
    configuration = _configuration(model, qpos, keyframe)
    with within("locked"):
        for name, value in locked.items():
            if not is_scalar(model, inside[name]):
                raise ModelError(f"{name!r} is neither a hinge nor a slide")
            if not np.isfinite(value):
                raise ModelError(f"{name!r} at {value}; needs a finite number")
            configuration[model.jnt_qposadr[inside[name]]] = value
    posed = qpos is not None or keyframe is not None
    everything = tuple(sorted(bodies))
    return Selection(model, names, top, everything, moving, configuration, posed)


def _subtree(model: Any, top: int) -> set[int]:
    bodies = {top}
    for body in range(top + 1, model.nbody):  # parents come first
        if int(model.body_parentid[body]) in bodies:
            bodies.add(body)
    return bodies


def _check_joints(
    names: Names, joints: Iterable[str], inside: Mapping[str, int]
) -> None:
    """Check that joints exist and are below the root."""
    if isinstance(joints, str):
        raise ModelError(f"{joints!r} is text; needs a list of names")
    for name in joints:
        if name in inside:
            continue
        if name in names.joints:
            raise JointNotFoundError(
                f"{name!r} is a joint of the scene, but not below the root (which has "
                f"{listing(list(inside))})"
            )
        raise JointNotFoundError(
            f"no joint {name!r}{did_you_mean(name, list(inside))} "
            f"(the robot has {listing(list(inside))})"
        )


def _configuration(model: Any, qpos: ArrayLike | None, keyframe: str | None) -> Array:
    if qpos is not None and keyframe is not None:
        raise ModelError("give one of qpos and keyframe")
    if keyframe is not None:
        known = [model.key(i).name for i in range(model.nkey)]
        if keyframe not in known:
            with within("keyframe"):
                raise ModelError(
                    f"no keyframe {keyframe!r}{did_you_mean(keyframe, known)} (the "
                    f"scene has {listing(known) or 'none'})"
                )
        return np.array(model.key_qpos[known.index(keyframe)], dtype=float)
    if qpos is None:
        return np.array(model.qpos0, dtype=float)
    array = np.array(qpos, dtype=float)
    if array.shape != (model.nq,) or not np.isfinite(array).all():
        raise ModelError(
            f"qpos has shape {array.shape}; the scene's configuration has "
            f"({model.nq},), and finite numbers"
        )
    return array
