"""Rotor inertias, which motors add to the diagonal of the mass matrix.

A rotor of inertia I behind a gear of reduction k turns k times as fast as its joint,
and adds I k² [kg·m²] to it: on a light wrist most of its inertia. A URDF's links do not
contain it. Some URDFs give it in a ``<transmission>``: the ``<mechanicalReduction>``
and the rotor's inertia of its ``<actuator>``, which Drake calls ``drake:gear_ratio``
and ``drake:rotor_inertia``.
"""

import logging
from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Any, Literal
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import Field

from hsp_control.common.errors import JointNotFoundError, ModelError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration.quantities import ArrayField, NonNegative, ReadOnlyDict
from hsp_control.robot.description.sources import RobotSource

_log = logging.getLogger(__name__)

MOST = 1e3
"""Largest inertia of a rotor [kg·m² or kg]: a large machine's first axis has 10."""

_REDUCTION = {"mechanicalReduction", "mechanical_reduction", "gear_ratio"}
_ROTOR = {"rotorInertia", "rotor_inertia", "motorInertia", "motor_inertia"}


def _stored(value: Any) -> Any:
    if isinstance(value, Mapping):
        return ReadOnlyDict(value)
    return tuple(value) if isinstance(value, list) else value


MotorInertias = Annotated[
    ArrayLike | Mapping[str, float] | Literal["bundled"],
    ArrayField(
        Literal["bundled"]
        | NonNegative
        | Annotated[list[NonNegative], Field(min_length=1)]
        | Annotated[dict[str, NonNegative], Field(min_length=1)],
        _stored,
    ),
]
"""A number, one per joint in a list or by name, or ``bundled``; 0: bare links."""


def write_motor_inertia(
    model: pin.Model,
    given: Any,
    source: RobotSource,
    of_file: Mapping[str, float],
) -> None:
    """Set a model's armature: as given, else from its file, by joint.

    Joints of several degrees of freedom, such as a root, have no motor.
    """
    joints = {
        name: joint
        for name, joint in [*zip(model.names, model.joints, strict=True)][1:]
        if joint.nv == 1
    }
    if given == "bundled":
        if not source.motor_inertia:
            raise ModelError(
                f"{source.name} comes without motor inertias; give them: one number "
                "[kg m²], or one for each joint"
            )
        # of the joints that are not locked
        given = {k: each for k, each in source.motor_inertia.items() if k in joints}
    inertias = {name: of_file[name] for name in joints if name in of_file}
    if isinstance(given, Mapping):
        for name in given:
            if name not in joints:
                raise JointNotFoundError(
                    f"no joint {name!r} with one degree of freedom"
                    f"{did_you_mean(name, list(joints))} (there are {listing(joints)})"
                )
        inertias |= given
    elif given is not None:
        each = np.atleast_1d(np.asarray(given, dtype=float))
        if len(each) not in (1, len(joints)):
            raise ModelError(
                f"has {len(each)} numbers; needs one, or one for each of the "
                f"{len(joints)} joints {listing(joints)}"
            )
        inertias = dict(zip(joints, np.resize(each, len(joints)), strict=True))
    for name, inertia in inertias.items():
        if not inertia <= MOST:
            raise ModelError(
                f"the motor of {name!r} has {inertia:g} kg m² (or kg); at most {MOST:g}"
            )
        model.armature[joints[name].idx_v] = inertia


def rotors_of_urdf(robot: Element) -> dict[str, float]:
    """Return I k² of joints with a ``<transmission>`` that gives it [kg·m² or kg].

    Raises:
        ModelError: If a number is none, or negative, or a rotor's reduction is 0.
    """
    found: dict[str, float] = {}
    for transmission in robot.findall("transmission"):
        joints = [each.get("name") for each in transmission.findall("joint")]
        actuators = transmission.findall("actuator")
        if len(joints) != 1 or joints[0] is None or len(actuators) != 1:
            continue  # a differential, or nothing
        own = [*actuators[0], *transmission]
        rotor = _number(own, _ROTOR, joints[0])
        reduction = _number(own, _REDUCTION, joints[0])
        if rotor is not None:
            if reduction == 0.0:
                raise ModelError(
                    f"transmission of {joints[0]!r}: its reduction is 0, and its rotor "
                    "would not turn; it is the rotor's speed over the joint's"
                )
            gear = 1.0 if reduction is None else reduction
            found[joints[0]] = rotor * gear * gear
    return found


def transmissions(robot: Element) -> dict[str, list[str]]:
    """Return the names of a URDF's transmissions, by the names of their joints."""
    found: dict[str, list[str]] = {}
    for transmission in robot.findall("transmission"):
        for driven in transmission.findall("joint"):
            names = found.setdefault(driven.get("name", ""), [])
            names.append(transmission.get("name", ""))
    return found


def name_unknown_joints(robot: Element, file: object) -> None:
    """Log which transmissions of a URDF are of joints that it does not have."""
    joints = [joint.get("name", "") for joint in robot.findall("joint")]
    for joint, names in transmissions(robot).items():
        if joint not in joints:
            _log.warning(
                "%s: transmission %s: its rotor is assigned to no joint: there is no "
                "joint %r%s",
                file, listing(map(repr, names)), joint, did_you_mean(joint, joints),
            )  # fmt: skip


def _number(elements: list[Element], names: set[str], joint: str) -> float | None:
    """Return the number that one of some elements has as its text or its value."""
    for element in elements:
        kind = element.tag.rpartition("}")[2].rpartition(":")[2]
        if kind not in names:
            continue
        text = element.get("value", element.text or "").strip()
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or (kind in _ROTOR and value < 0.0):
            raise ModelError(
                f"transmission of {joint!r}: <{kind}> is {text!r}; must be a finite "
                "number" + (", not negative" if kind in _ROTOR else "")
            )
        return value
    return None
