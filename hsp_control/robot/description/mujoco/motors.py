"""The motors of a MuJoCo model: which actuators give an effort, and how much."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot.description.mujoco.constants import constants


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
    kinds = constants("mjtJoint")
    scalar = kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE
    if (
        joint not in range(model.njnt)
        or actuator not in joint_actuators(model).get(joint, ())
        or int(model.jnt_type[joint]) not in scalar
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

    It is the sum of what its actuators give, within the range of the joint's own total
    (``actuatorfrcrange``). An actuator that is no motor gives what its ``forcerange``
    allows. Without any actuator there is no limit.
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


def _added(model: Any, joint: int, quantity: str) -> float:
    """Return what a joint's actuators add to its armature or damping."""
    owner = getattr(model, "jnt_actuatorid", None)
    if owner is None or owner[joint] < 0:
        return 0.0
    actuator = int(owner[joint])
    gear = float(model.actuator_gear[actuator, 0])
    return gear**2 * float(getattr(model, f"actuator_{quantity}")[actuator])


def armature(model: Any, joint: int, dofs: slice) -> Array:
    """Return the rotor inertia of a joint's degrees of freedom [kg·m² or kg]."""
    return np.asarray(model.dof_armature[dofs] + _added(model, joint, "armature"))


def damping(model: Any, joint: int, dofs: slice) -> Array:
    """Return the viscous friction of a joint: [N·m·s/rad or N·s/m] for each dof."""
    return np.asarray(model.dof_damping[dofs] + _added(model, joint, "damping"))
