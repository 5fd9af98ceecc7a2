"""Parse a robot's URDF into the Pinocchio model that is asked for, without meshes."""

import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    NonFiniteError,
    ShapeError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.robot.description.mesh_files import check_named
from hsp_control.robot.description.sources import RobotSource, Root
from hsp_control.robot.description.urdf_checks import named_files, read_urdf

_ROOT_JOINTS = {
    "planar": pin.JointModelPlanar,
    "free_flyer": pin.JointModelFreeFlyer,
}


@dataclass(frozen=True)
class ToolFrame:
    """A frame added to the model, fixed to one of its frames.

    Attributes:
        parent: The frame that it is fixed to.
        translation: Its origin in the parent frame [m], shape (3,).
        rpy: Its roll, pitch and yaw in the parent frame [rad], as in a URDF.
    """

    parent: str
    translation: Sequence[float] = (0.0, 0.0, 0.0)
    rpy: Sequence[float] = (0.0, 0.0, 0.0)


def load_model(
    source: RobotSource,
    *,
    root: Root | None = None,
    locked: Mapping[str, float] | None = None,
    tool_frames: Mapping[str, ToolFrame] | None = None,
    gravity: Sequence[float] | None = None,
    mimic: bool = True,
) -> pin.Model:
    """Parse the URDF and return the Pinocchio model of the robot that is asked for.

    Args:
        source: Where the robot comes from.
        root: ``fixed``, ``planar`` (x, y, yaw) or ``free_flyer``; None: the source's.
        locked: Joints to lock, name to value [rad or m]; None: the source's. Joints
            that mimic a locked joint are locked with it.
        tool_frames: Frames to add, by name.
        gravity: Acceleration of gravity in the world [m/s²], shape (3,); None: -9.81
            along z.
        mimic: Honour ``<mimic>`` (the joint follows its leader and has no freedom of
            its own) or load such joints as free ones.

    Raises:
        ModelError: If the URDF does not parse, has a joint whose limits are reversed,
            or gives a singular mass matrix.
        AccessError: If it names a file that the source's access does not allow.
        JointNotFoundError: If a joint to lock does not exist.
        FrameNotFoundError: If a tool frame's parent does not exist.
    """
    model = _parse(source, root or source.root, mimic=mimic)
    locks = source.locked if locked is None else locked
    if locks:
        model = _lock(model, locks)
    for name, tool in (tool_frames or {}).items():
        _add_frame(model, name, tool)
    if gravity is not None:
        model.gravity.linear = _vector3(gravity, "gravity")
    _refuse_reversed_limits(model, source)
    _refuse_singular_mass_matrix(model, source)
    return model


def moving_joints(model: pin.Model) -> dict[str, Any]:
    """Return the joints that have freedoms, by name, in the order of velocities."""
    named = list(zip(model.names, model.joints, strict=True))[1:]  # not the universe
    return {name: joint for name, joint in named if joint.nv > 0}


def standing(model: pin.Model, source: RobotSource) -> tuple[float, ...] | None:
    """Return the posture that a source's SRDF has its robot stand in, shape (nv,).

    None where there is none, or where the model has other joints than the SRDF means.
    """
    if source.srdf is None or source.posture is None:
        return None
    model = model.copy()  # the postures are stored in the model
    pin.loadReferenceConfigurations(model, str(source.srdf), False)
    postures = {pair.key(): pair.data() for pair in model.referenceConfigurations}
    q = postures.get(source.posture)
    if q is None or q.shape != (model.nq,) or not np.isfinite(q).all():
        return None
    return tuple(pin.difference(model, pin.neutral(model), pin.normalize(model, q)))


def end_effector_frame(model: pin.Model) -> str:
    """Return the frame that is most likely the hand, judged by the tree of joints.

    It is the last link that moves with the end of the longest chain of joints, the last
    chain of equals. Where that chain forks in its second half, what follows is taken
    for fingers, and its end is the link that they spring from.
    """
    chains: list[list[int]] = [[]]
    for joint in range(1, model.njoints):
        chains.append([*chains[model.parents[joint]], joint])
    longest = max(reversed(chains), key=len)
    forks = [
        joint
        for depth, joint in enumerate(longest, start=1)
        if 2 * depth >= len(longest) and len(model.children[joint]) > 1
    ]
    end = forks[0] if forks else longest[-1]
    links = [
        frame.name
        for frame in model.frames
        if frame.parentJoint == end and frame.type == pin.FrameType.BODY
    ]
    hands = [link for link in links if not re.search("finger|thumb", link.lower())]
    return str((hands or links)[-1])


def _parse(source: RobotSource, root: Root, *, mimic: bool) -> pin.Model:
    urdf = source.urdf
    xml = read_urdf(urdf)
    if source.access.strict:
        for name, where in named_files(xml):
            check_named(source, name, f"{urdf}: {where}", source.access)
    if root not in get_args(Root):
        roots = get_args(Root)
        raise ModelError(
            f"root {root!r} is not one of {listing(roots)}{did_you_mean(root, roots)}"
        )
    said: list[str] = []
    try:
        with _errors_said(said):
            if root == "fixed":
                return pin.buildModelFromUrdf(str(urdf), mimic=mimic)
            joint = _ROOT_JOINTS[root]()
            return pin.buildModelFromUrdf(str(urdf), joint, "root_joint", mimic=mimic)
    except (ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[-1].removeprefix("hint: ")
        reason = said[0] if said else reason
        if mimic and "mimic" in reason:
            reason = _explain_mimic(urdf) or reason
            reason += "; load its mimic joints as free ones: mimic=False"
        raise ModelError(f"{urdf}: not a robot that can be built: {reason}") from error


@contextmanager
def _errors_said(said: list[str]) -> Iterator[None]:
    """Collect the parser's "Error:" lines, which it writes to the process's stderr.

    Its exceptions say only that a URDF is not valid; these lines say why.
    """
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            said.extend(
                line.split("Error:", 1)[1].strip() for line in lines if "Error:" in line
            )


def _explain_mimic(urdf: Path) -> str:
    """Name the joint that Pinocchio cannot let follow another, and say why."""
    order = list(pin.buildModelFromUrdf(str(urdf), mimic=False).names)
    for joint in read_urdf(urdf).iter("joint"):
        mimic, follower = joint.find("mimic"), joint.get("name")
        if mimic is None or follower not in order:
            continue
        leader = mimic.get("joint")
        if leader not in order:
            return f"joint {follower!r} mimics {leader!r}, which is no moving joint"
        if order.index(leader) > order.index(follower):
            return (
                f"joint {follower!r} mimics {leader!r}, which comes after it in the "
                "tree, and Pinocchio wants the leader first"
            )
    return ""


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
        if not np.isfinite(value):
            raise NonFiniteError(f"cannot lock joint {name!r} at {value}")
        index = model.getJointId(name)
        joint = model.joints[index]
        ids.add(index)
        if joint.nq == 1:
            reference[joint.idx_q] = value
        elif joint.nq == 2:  # continuous: (cos, sin)
            reference[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        elif joint.nq > 2:
            raise ModelError(
                f"cannot lock {name!r}: it has {joint.nv} freedoms; choose root: fixed"
            )
    _refuse_contradictory_locks(model, locks)
    ids |= {
        index
        for index, joint in enumerate(model.joints)
        if "Mimic" in joint.shortname()
        and any(model.joints[leader].idx_q == joint.idx_q for leader in ids)
    }
    if len(ids) == len(names):
        raise ModelError("every joint is locked: no freedom is left to control")
    return pin.buildReducedModel(model, sorted(ids), reference)


def _refuse_contradictory_locks(model: pin.Model, locks: Mapping[str, float]) -> None:
    """A mimic joint is where its leader puts it: it cannot be locked elsewhere."""
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
            raise ModelError(f"cannot lock {name!r}: it mimics {leader!r}; lock that")
        value = follower.scaling * locks[leader] + follower.offset
        if abs(value - locks[name]) > 1e-6:
            raise ModelError(
                f"cannot lock {name!r} at {locks[name]:g}: it mimics {leader!r}, "
                f"which puts it at {value:g}"
            )


def _add_frame(model: pin.Model, name: str, tool: ToolFrame) -> None:
    names = [frame.name for frame in model.frames]
    if name in names:
        raise ModelError(f"cannot add tool frame {name!r}: a frame has that name")
    if tool.parent not in names:
        raise FrameNotFoundError(
            f"tool frame {name!r}: no parent frame {tool.parent!r}"
            f"{did_you_mean(tool.parent, names)} (the model has {listing(names)})"
        )
    parent = model.frames[model.getFrameId(tool.parent)]
    rotation = pin.rpy.rpyToMatrix(_vector3(tool.rpy, f"rpy of {name!r}"))
    translation = _vector3(tool.translation, f"translation of {name!r}")
    model.addFrame(
        pin.Frame(
            name,
            parent.parentJoint,
            model.getFrameId(tool.parent),
            parent.placement * pin.SE3(rotation, translation),
            pin.FrameType.OP_FRAME,
        )
    )


def _refuse_reversed_limits(model: pin.Model, source: RobotSource) -> None:
    for name, joint in moving_joints(model).items():
        if joint.nq == joint.nv == 1:
            lower = model.lowerPositionLimit[joint.idx_q]
            upper = model.upperPositionLimit[joint.idx_q]
            if lower > upper:
                raise ModelError(
                    f"{source.urdf}: joint {name!r}: its lower limit {lower:g} is "
                    f"above its upper limit {upper:g}"
                )


def _refuse_singular_mass_matrix(model: pin.Model, source: RobotSource) -> None:
    """Refuse a model with joints that move no mass, and name them.

    Tried at a generic configuration, where only joints (or a combination of joints)
    that never move any mass make M singular.
    """
    if model.nv == 0:
        raise ModelError(f"{source.urdf}: the robot has no moving joint")
    spread = np.random.default_rng(0).uniform(-1.0, 1.0, model.nv)
    configuration = pin.integrate(model, pin.neutral(model), spread)
    mass_matrix = pin.crba(model, model.createData(), configuration)
    values, vectors = np.linalg.eigh(mass_matrix)
    if values[0] > 1e-12 * values[-1]:
        return
    idle = np.diag(mass_matrix) <= 1e-12 * values[-1]
    if not idle.any():  # only together: name the one that moves most
        idle[np.argmax(np.abs(vectors[:, 0]))] = True
    culprits = {
        name: joint.nv
        for name, joint in moving_joints(model).items()
        if idle[joint.idx_v : joint.idx_v + joint.nv].any()
    }
    single = set(culprits.values()) == {1}
    locks = ", ".join(f"{name}: 0.0" for name in culprits)
    raise ModelError(
        f"{source.urdf}: no mass moves with {listing(culprits)}, so that no "
        f"acceleration is defined there (the mass matrix is singular: {values[0]:.1e} "
        f"of {values[-1]:.1e}); give the links an inertia, or "
        + (f"lock the joints: locked: {{{locks}}}" if single else "root: fixed")
    )


def _vector3(values: Sequence[float], what: str) -> np.ndarray:
    try:
        vector = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ShapeError(f"{what} is {values!r}; needs 3 numbers") from None
    if vector.shape != (3,):
        raise ShapeError(f"{what} has shape {vector.shape}; needs 3 numbers")
    if not np.isfinite(vector).all():
        raise NonFiniteError(f"{what} is {vector.tolist()}; needs finite numbers")
    return vector
