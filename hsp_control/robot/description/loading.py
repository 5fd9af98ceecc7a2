"""Build the Pinocchio model of a robot from its URDF, without meshes, or of several.

Of several robots in one workspace the Jacobians are decoupled, so every one follows the
control law as if it were alone. For collision avoidance a robot is an obstacle for the
others, and its true velocity is known.
"""

import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, cast
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.errors import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within
from hsp_control.declaration.rotation import matrix_of
from hsp_control.robot.description.inertias import impossible_inertias, project_inertias
from hsp_control.robot.description.mesh_files import check_mesh_name
from hsp_control.robot.description.mimics import (
    name_coordinates,
    name_frames,
    write_for_pinocchio,
)
from hsp_control.robot.description.motor_inertia import (
    name_unknown_joints,
    rotors_of_urdf,
    write_motor_inertia,
)
from hsp_control.robot.description.planar_axes import write_planar_axes
from hsp_control.robot.description.robot_description import (
    OneRobot,
    RobotDescription,
    ToolFrame,
)
from hsp_control.robot.description.soft_limits import write_soft_limits
from hsp_control.robot.description.sources import RobotSource, Root
from hsp_control.robot.description.urdf import named_files, parser_text, read_urdf

_ROOT_JOINTS = {"planar": pin.JointModelPlanar, "free_flyer": pin.JointModelFreeFlyer}


def load_model(
    source: RobotSource,
    settings: OneRobot | None = None,
    gravity: ArrayLike | None = None,
) -> pin.Model:
    """Return the Pinocchio model of a URDF; followers of a locked joint are locked."""
    if settings is None:
        settings = RobotDescription(source.name)
    xml = read_urdf(source)
    try:
        rotors = rotors_of_urdf(xml)
    except ModelError as error:
        raise ModelError(f"{source.urdf}: {error}") from None
    name_unknown_joints(xml, source.urdf)
    model = _parse(source, settings, xml)
    locks = source.locked if settings.locked is None else settings.locked
    if locks:
        model = _lock(model, locks)
    name_frames(model)
    with within("motor_inertia"):
        write_motor_inertia(model, settings.motor_inertia, source, rotors)
    return completed(model, source, settings.tool_frames, gravity)


def completed(
    model: pin.Model,
    source: RobotSource,
    tool_frames: Mapping[str, ToolFrame],
    gravity: ArrayLike | None,
) -> pin.Model:
    """Return a checked model, with the user's own frames and gravity."""
    for name, tool in tool_frames.items():
        _add_frame(model, name, tool)
    if gravity is not None:
        model.gravity.linear = np.asarray(gravity)
    _check_order(model, source)
    _check_limits(model, source)
    _check_mass_matrix(model, source)
    return model


def moving_joints(model: pin.Model) -> dict[str, Any]:
    """Return the joints with degrees of freedom, by name, in the order of v."""
    named = list(zip(model.names, model.joints, strict=True))
    return {name: joint for name, joint in named[1:] if joint.nv > 0}  # no universe


def frames_by_name(model: pin.Model) -> dict[str, int]:
    """Return the frames' indices; of a link and a joint of one name the link's."""
    links = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
    return {
        frame.name: i
        for i, frame in enumerate(model.frames)
        if frame.type == pin.FrameType.BODY or frame.name not in links
    }


def guarded(model: pin.Model) -> pin.Model:
    """Return a model to which no joints can be added; they can be added to a copy.

    Data that were made for it would not fit: Pinocchio would write beyond them and end
    the process.
    """
    model.addJoint = _refuse_joint
    return model


def _refuse_joint(*_: object, **__: object) -> None:
    raise ModelError(
        "joints cannot be added to the model of a robot, whose arrays have their "
        "sizes already; add them to a copy: model = robot.model.copy(), "
        "model.addJoint(...), Robot.from_pinocchio(model)"
    )


def reference_posture(
    model: pin.Model, source: RobotSource
) -> tuple[float, ...] | None:
    """Return the reference posture of the source's SRDF, from neutral, shape (nv,)."""
    if source.srdf is None or source.posture is None:
        return None
    model = model.copy()  # Pinocchio stores the postures in the model
    pin.loadReferenceConfigurations(model, str(source.srdf), False)
    postures = {pair.key(): pair.data() for pair in model.referenceConfigurations}
    q = postures.get(source.posture)
    if q is None or q.shape != (model.nq,) or not np.isfinite(q).all():
        return None
    return tuple(pin.difference(model, pin.neutral(model), pin.normalize(model, q)))


def _parse(source: RobotSource, settings: OneRobot, xml: Element) -> pin.Model:
    urdf, mimic = source.urdf, settings.mimic
    if source.access.strict:
        for name, where in named_files(xml):
            check_mesh_name(source, name, f"{urdf}: {where}", source.access)
    if settings.project_inertias:
        project_inertias(xml)
    else:
        _check_inertias(xml, source)
    parser_errors: list[str] = []
    root = cast("Root", settings.root or source.root)  # text is for MJCF only
    try:
        with collect_parser_errors(parser_errors):
            _write_for_pinocchio(xml, source, mimic=mimic)
            text = parser_text(xml, "visual", "collision")
            if root == "fixed":
                model = pin.buildModelFromXML(text, mimic=mimic)
            else:
                joint = _ROOT_JOINTS[root]()
                model = pin.buildModelFromXML(text, joint, "root_joint", mimic=mimic)
            name_coordinates(model)
    except ModelError:
        raise
    except (ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[-1].removeprefix("hint: ")
        reason = parser_errors[0] if parser_errors else reason
        raise ModelError(f"{urdf}: Pinocchio cannot build a model: {reason}") from error
    if parser_errors:
        left_out = "; ".join(dict.fromkeys(parser_errors))
        raise ModelError(
            f"{urdf}: Pinocchio leaves out a part of the model: {left_out}"
        )
    return model


def _write_for_pinocchio(xml: Element, source: RobotSource, *, mimic: bool) -> None:
    """Rewrite elements that Pinocchio would skip or refuse, in place."""
    try:
        write_soft_limits(xml)
        write_planar_axes(xml)
        if mimic:
            write_for_pinocchio(xml)
    except ModelError as error:
        raise ModelError(f"{source.urdf}: {error}") from None


def _check_inertias(xml: Element, source: RobotSource) -> None:
    """Check that no principal moment is negative, but for rounding."""
    for found in impossible_inertias(xml):
        if found.negative:
            raise ModelError(
                f"{source.urdf}: link {found.link!r}: <inertia>: {found.reason}; "
                "project_inertias: true takes the nearest that a body can have"
            )


@contextmanager
def collect_parser_errors(errors: list[str]) -> Iterator[None]:
    """Collect the "Error:" lines that the URDF parser writes to the process's stderr.

    Its exceptions report only that a URDF is invalid; these lines give the reason.
    """
    sys.stderr.flush()
    own_stderr = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(own_stderr, 2)
            os.close(own_stderr)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            errors.extend(
                line.split("Error:", 1)[1].strip() for line in lines if "Error:" in line
            )


def _lock(model: pin.Model, locks: Mapping[str, float]) -> pin.Model:
    names = list(model.names)[1:]
    reference = pin.neutral(model)
    ids = set()
    for name, value in locks.items():
        if name not in names:
            raise JointNotFoundError(
                f"cannot lock {name!r}: no such joint{did_you_mean(name, names)} "
                f"(the model has {listing(names)})"
            )
        index = model.getJointId(name)
        joint = model.joints[index]
        ids.add(index)
        if joint.nq == 1:
            reference[joint.idx_q] = value
        elif joint.nq == 2:  # continuous: (cos, sin)
            reference[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        elif joint.nq > 2:
            raise ModelError(
                f"cannot lock {name!r}: it has {joint.nv} degrees of freedom, only "
                "joints with one can be locked; for a fixed base use root: fixed"
            )
    _check_mimic_locks(model, locks)
    ids |= {
        index
        for index, joint in enumerate(model.joints)
        if "Mimic" in joint.shortname()
        and any(model.joints[leader].idx_q == joint.idx_q for leader in ids)
    }
    if len(ids) == len(names):
        raise ModelError("every joint is locked; at least one must be left to control")
    return pin.buildReducedModel(model, sorted(ids), reference)


def _check_mimic_locks(model: pin.Model, locks: Mapping[str, float]) -> None:
    """Check that a locked mimic joint has the value that its leader gives it."""
    leaders = {
        joint.idx_q: name
        for name, joint in zip(model.names, model.joints, strict=True)
        if joint.nq > 0
    }
    for name in locks:
        joint = model.joints[model.getJointId(name)]
        if "Mimic" not in joint.shortname():
            continue
        leader, follower = leaders[joint.idx_q], joint.extract()
        if leader not in locks:
            raise ModelError(
                f"cannot lock {name!r}: it mimics {leader!r}; lock {leader!r} instead"
            )
        value = follower.scaling * locks[leader] + follower.offset
        if abs(value - locks[name]) > 1e-6:
            raise ModelError(
                f"cannot lock {name!r} at {locks[name]:g}: it mimics {leader!r}, "
                f"which puts it at {value:g}"
            )


def _add_frame(model: pin.Model, name: str, tool: ToolFrame) -> None:
    names = [frame.name for frame in model.frames]
    if name in names:
        raise ModelError(
            f"cannot add tool frame {name!r}: the model has a frame with this name"
        )
    if tool.parent not in names:
        raise FrameNotFoundError(
            f"tool frame {name!r}: no parent frame {tool.parent!r}"
            f"{did_you_mean(tool.parent, names)} (the model has {listing(names)})"
        )
    index = frames_by_name(model)[tool.parent]
    parent = model.frames[index]
    model.addFrame(
        pin.Frame(
            name,
            parent.parentJoint,
            index,
            parent.placement * placement(tool.translation, tool.rotation),
            pin.FrameType.OP_FRAME,
        )
    )


def _check_limits(model: pin.Model, source: RobotSource) -> None:
    for name, joint in moving_joints(model).items():
        if joint.nq == joint.nv == 1:
            lower = model.lowerPositionLimit[joint.idx_q]
            upper = model.upperPositionLimit[joint.idx_q]
            if lower > upper:
                raise ModelError(
                    f"{source.urdf}: joint {name!r}: its lower limit {lower:g} is "
                    f"above its upper limit {upper:g}"
                )


def _check_order(model: pin.Model, source: RobotSource) -> None:
    """Check that the joints below each joint follow it without a gap.

    Pinocchio's CRBA takes that for granted: M would be wrong (seen with 4.1).
    """
    around = [0]  # the joints from the root to the last one
    for index in range(1, model.njoints):
        parent = model.parents[index]
        if parent not in around:
            last = model.names[index - 1]
            raise ModelError(
                f"{source.urdf}: joint {model.names[index]!r} follows {last!r}, but is "
                f"below {model.names[parent]!r}, which {last!r} is not: its mass "
                "matrix would be wrong; add all joints below a joint before others"
            )
        around = [*around[: around.index(parent) + 1], index]


def _check_mass_matrix(model: pin.Model, source: RobotSource) -> None:
    """Check at a generic configuration that every joint moves some mass."""
    if model.nv == 0:
        raise ModelError(f"{source.urdf}: the robot has no moving joint")
    spread = np.random.default_rng(0).uniform(-1.0, 1.0, model.nv)
    configuration = pin.integrate(model, pin.neutral(model), spread)
    # Not by CRBA, which is wrong for some mimic joints (seen with Pinocchio 4.1).
    data, rest = model.createData(), np.zeros(model.nv)
    gravity = pin.rnea(model, data, configuration, rest, rest).copy()
    unit = np.eye(model.nv)
    columns = [pin.rnea(model, data, configuration, rest, a) - gravity for a in unit]
    mass_matrix = 0.5 * (np.array(columns) + np.transpose(columns))
    values, vectors = np.linalg.eigh(mass_matrix)
    if values[0] > 1e-12 * values[-1]:
        return
    idle = np.diag(mass_matrix) <= 1e-12 * values[-1]
    if not idle.any():  # a combination of joints: name the one that moves most
        idle[np.argmax(np.abs(vectors[:, 0]))] = True
    if not mass_matrix.any():
        raise ModelError(
            f"{source.urdf}: no link that moves has a mass: this URDF describes shapes "
            "and joints only; efforts need <inertial> elements"
        )
    massless = {
        name: joint.nv
        for name, joint in moving_joints(model).items()
        if idle[joint.idx_v : joint.idx_v + joint.nv].any()
    }
    single = set(massless.values()) == {1}
    locks = ", ".join(f"{name}: 0.0" for name in massless)
    raise ModelError(
        f"{source.urdf}: no mass moves with {listing(massless)}, so that the mass "
        f"matrix is singular (smallest eigenvalue {values[0]:.1e}, largest "
        f"{values[-1]:.1e}); give the links an inertia, or "
        + (f"lock the joints: locked: {{{locks}}}" if single else "root: fixed")
    )


# --- several robots ------------------------------------------------------------------


@dataclass(frozen=True)
class RobotPart:
    """One robot of a combined robot."""

    prefix: str  # the names of its joints and frames begin with this, e.g. ``left_``
    source: RobotSource  # where the robot comes from
    placement: pin.SE3  # placement of its root in the world


def combine(parts: Sequence[tuple[RobotPart, pin.Model]]) -> pin.Model:
    """Return one model that contains all robots, which have no mimic joints."""
    prefixes = [part.prefix for part, _ in parts]
    if len(parts) < 2 or len(set(prefixes)) < len(prefixes):
        raise ModelError(
            "robots to combine must be two or more, with different names; got prefixes "
            f"{prefixes}"
        )
    whole = pin.Model()
    for part, model in parts:
        if part.source.origin == "combined":
            raise ModelError(
                f"{part.prefix}{part.source.name} is already a combined robot; "
                "combine all robots in one call"
            )
        if model.nvExtended != model.nv:
            raise ModelError(
                f"{part.prefix}{part.source.name}: a robot with mimic joints cannot be "
                "combined; lock these joints, or load the robot with mimic=False"
            )
        own = model.copy()
        for index in range(1, own.njoints):
            own.names[index] = part.prefix + own.names[index]
        for index in range(1, own.nframes):
            # Pinocchio finds frames by their names, and a link may have a joint's.
            mark = _LINK if own.frames[index].type == pin.FrameType.BODY else ""
            own.frames[index].name = part.prefix + own.frames[index].name + mark
        whole = pin.appendModel(whole, own, 0, part.placement)
    for frame in whole.frames:
        frame.name = frame.name.removesuffix(_LINK)
    if any(model.gravity != parts[0][1].gravity for _, model in parts):
        raise ModelError("robots to combine differ in gravity; load all with one value")
    whole.gravity = parts[0][1].gravity
    for part, model in parts:  # appendModel drops it (seen with Pinocchio 4.1)
        for name, joint in moving_joints(model).items():
            own = whole.joints[whole.getJointId(part.prefix + name)].idx_v
            of_joint = slice(joint.idx_v, joint.idx_v + joint.nv)
            whole.armature[own : own + joint.nv] = model.armature[of_joint]
    return whole


_LINK = "\t"
"""Suffix of the name of a link's frame while robots are combined."""


def placement(position: ArrayLike, rotation: ArrayLike) -> pin.SE3:
    """Return a placement from a position [m], shape (3,), and a `Rotation`."""
    return pin.SE3(matrix_of(rotation), np.asarray(position, dtype=float))
