"""A robot from an MJCF or a compiled MuJoCo model, and a report of omitted features.

A robot is rigid bodies, joints, armatures, symmetric limits and joint friction.
Everything else that acts on its bodies is reported here, so that nothing is silently
ignored.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import AccessError, ModelError, RobotNotFoundError
from hsp_control.common.regular_file import why_no_file
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.mujoco.conversion import (
    body_shapes,
    build_model,
    excluded_pairs,
    shapeless_geoms,
)
from hsp_control.companions.mujoco.scene import (
    Selection,
    constants,
    effort_range,
    import_mujoco,
    is_scalar,
    joint_actuators,
    joint_total,
    motor,
    select,
)
from hsp_control.declaration import within
from hsp_control.robot.description.access import ANYWHERE, Access, XmlError, read_xml
from hsp_control.robot.description.loading import completed
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf import MAX_DOFS, MAX_LINKS

_FOLDERS = "meshdir", "texturedir", "assetdir"
_REFUSED = "plugin", "replicate", "composite", "flexcomp"
"""Elements that run code, or that expand to any number of bodies."""
_MAX_FILES = 200
"""Maximum number of files that an MJCF may include; a loop of them ends there."""


def compile_mjcf(path: Path, access: Access) -> Any:
    """Return the ``mujoco.MjModel`` of an MJCF file."""
    access.check(path, "mjcf")
    if not path.is_file():
        near = sorted(f.name for f in path.parent.glob("*.xml") if f.is_file())
        why = why_no_file(path)
        raise RobotNotFoundError(f"{path}: {why}{did_you_mean(path.name, near)}")
    top = _read(path)
    if top.tag != "mujoco":
        hint = "; give a URDF as name" if top.tag == "robot" else ""
        raise ModelError(
            f"{path}: the top element is <{top.tag}>; in an MJCF it is <mujoco>{hint}"
        )
    if access.strict:
        _check_access(path, top, access)
    mujoco = import_mujoco()
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"{path}: MuJoCo rejects it: {reason}") from error
    for count, limit, what in (
        (model.nbody, MAX_LINKS, "bodies"),
        (model.nv, MAX_DOFS, "degrees of freedom"),
    ):
        if count > limit:
            raise ModelError(f"{path}: {count} {what}; at most {limit}")
    return model


def _read(path: Path) -> Element:
    try:
        return read_xml(path)
    except XmlError as error:
        raise ModelError(error.within(path)) from None
    except OSError as error:
        raise RobotNotFoundError(f"{path}: {error.strerror}") from error


def _check_access(path: Path, top: Element, access: Access) -> None:
    """Check every file that an MJCF names, also in the files that it includes."""
    pending, checked = [(path, top)], 0
    while pending:
        file, root = pending.pop()
        checked += 1
        if checked > _MAX_FILES:
            raise AccessError(f"{path}: includes more than {_MAX_FILES} files")
        for tag in _REFUSED:
            if next(root.iter(tag), None) is not None:
                raise AccessError(f"{file}: strict reading allows no <{tag}>")
        for name, element in _named(root):
            for place in _places(path.parent, file.parent, root, name):
                access.check(place, f"{file}: <{element.tag}>")
                if element.tag in ("include", "model") and place.is_file():
                    pending.append((place, _read(place)))


def _named(root: Element) -> Iterator[tuple[str, Element]]:
    """Yield the value of every attribute ``file...`` with its element."""
    for element in root.iter():
        for attribute, value in element.attrib.items():
            if attribute.startswith("file"):
                yield value, element


def _places(main: Path, own: Path, root: Element, name: str) -> set[Path]:
    """Return all places in which MuJoCo might look for a file."""
    folders = [Path()]
    for compiler in root.iter("compiler"):
        folders += [Path(compiler.get(key, "")) for key in _FOLDERS]
    return {base / folder / name for base in (main, own) for folder in folders}


_log = logging.getLogger(__name__)


def load_compiled(
    model: Any,
    root: str | None,
    joints: Sequence[str] | None,
    qpos: ArrayLike | None,
    keyframe: str | None,
    locked: Mapping[str, float] | None,
    tool_frames: Mapping[str, ToolFrame] | None,
) -> tuple[pin.Model, RobotSource]:
    """Return the Pinocchio model of a robot in a compiled model; see `from_mujoco`."""
    selection = select(model, root, joints, qpos, keyframe, locked)
    return load_selection(selection, tool_frames or {})


def load_mjcf(
    description: RobotDescription, access: Access
) -> tuple[pin.Model, RobotSource]:
    """Return the Pinocchio model of a description with an MJCF, and its source."""
    robot = description
    file = Path(robot.mjcf or "")
    with within("mjcf"):
        scene = compile_mjcf(file, access)
    given = robot.root, robot.joints, None, robot.keyframe, robot.locked
    selection = select(scene, *given)
    return load_selection(selection, robot.tool_frames, robot.gravity, file, access)


def load_selection(
    selection: Selection,
    tool_frames: Mapping[str, ToolFrame],
    gravity: ArrayLike | None = None,
    file: Path | None = None,
    access: Access = ANYWHERE,
) -> tuple[pin.Model, RobotSource]:
    """Return the Pinocchio model of a robot in a MuJoCo scene, and its source."""
    model = build_model(selection)
    name = model.name if selection.root else _name_of_scene(selection, file)
    floating = any(joint.shortname() == "JointModelFreeFlyer" for joint in model.joints)
    omitted = omissions(selection)
    for sentence in omitted:
        _warn(name, sentence)
    source = RobotSource(
        name=name,
        urdf=file or Path(name),
        root="free_flyer" if floating else "fixed",
        origin="mujoco",
        home=tuple(map(float, _home(selection, model))),
        locked=_locked(selection),
        access=access,
        shapes=body_shapes(selection),
        excluded=excluded_pairs(selection),
        omitted=omitted,
    )
    return completed(model, source, tool_frames, gravity), source


@cache
def _warn(robot: str, sentence: str) -> None:
    """Log an omitted feature, once: simulators build the same robot at every reset."""
    _log.warning("%s, as MuJoCo has it, but without: %s", robot, sentence)


def _locked(selection: Selection) -> dict[str, float]:
    """Return the positions of the robot's locked hinges and slides [rad or m]."""
    scene, names = selection.model, selection.names.joints
    return {
        names[joint]: float(selection.qpos[scene.jnt_qposadr[joint]])
        for joint in selection.locked
        if is_scalar(scene, joint)
    }


def _name_of_scene(selection: Selection, file: Path | None) -> str:
    own: bytes = selection.model.names  # begins with the name of the whole model
    name = own.split(b"\0")[0].decode(errors="replace")
    if name in ("", "MuJoCo Model"):  # MuJoCo's default
        return "scene" if file is None else file.stem
    return name


def _home(selection: Selection, model: pin.Model) -> Array:
    """Return the scene's configuration from neutral (nv,); within limits."""
    scene, kinds = selection.model, constants("mjtJoint")
    q = pin.neutral(model)
    for index, joint in enumerate(selection.moving, start=1):
        at, mine = int(scene.jnt_qposadr[joint]), int(model.idx_qs[index])
        part = selection.qpos[at : at + int(model.nqs[index])].copy()
        if scene.jnt_type[joint] in (kinds.mjJNT_FREE, kinds.mjJNT_BALL):
            part[-4:] = np.roll(part[-4:], -1)  # w x y z to x y z w
        elif not selection.chosen:
            low, high = model.lowerPositionLimit[mine], model.upperPositionLimit[mine]
            if not low < part[0] < high and np.isfinite(low + high):
                part[0] = 0.5 * (low + high)
        q[mine : mine + len(part)] = part
    return np.asarray(
        pin.difference(model, pin.neutral(model), pin.normalize(model, q))
    )


_OF_TENDONS = "stiffness", "damping", "frictionloss", "limited", "armature"

Lack = tuple[str, list[str], str]
"""An omitted element, the names of its owners, and the consequence."""


def omissions(selection: Selection) -> tuple[str, ...]:
    """Return one sentence per kind of omitted element."""
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
        "their effort has different limits in both directions; the smaller is used, "
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
        "no actuator acts on them; the controller regards them as actuated",
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
    """Return the bodies of an equality constraint; none if it is a flex's."""
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
