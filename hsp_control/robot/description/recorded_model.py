"""A Pinocchio model and shapes as JSON data, for robots that no URDF describes."""

import base64
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.robot.description.joint_data import TURNING, joint_data, pose_numbers
from hsp_control.robot.description.sources import BodyShape

_LARGEST = 200_000_000
"""Most bytes of a packed text or array."""
_JOINTS: dict[str, Any] = {
    name: getattr(pin, name)
    for name in (
        *(f"JointModel{of}{axis}" for of in ("R", "P", "RUB", "H") for axis in "XYZ"),
        "JointModelRevoluteUnaligned", "JointModelRevoluteUnboundedUnaligned",
        "JointModelPrismaticUnaligned", "JointModelHelicalUnaligned",
        "JointModelFreeFlyer", "JointModelPlanar", "JointModelSpherical",
        "JointModelTranslation",
    )
}  # fmt: skip
_PER_POSITION = ("lowerPositionLimit", "upperPositionLimit")
_PER_VELOCITY = (
    "velocityLimit", "effortLimit", "friction", "damping", "armature", "rotorInertia",
    "rotorGearRatio",
)  # fmt: skip


def packed(data: bytes, level: int = 9) -> str:
    """Return bytes as a short text; with a lower level quicker, and less short."""
    return base64.b85encode(zlib.compress(data, level)).decode()


def unpacked(text: str) -> bytes:
    """Return the bytes of a text.

    Raises:
        ModelError: If it is damaged, or of too many bytes.
    """
    try:
        reader = zlib.decompressobj()
        data = reader.decompress(base64.b85decode(text), _LARGEST)
    except (ValueError, TypeError, AttributeError, zlib.error) as error:
        raise ModelError(f"a part of the recorded robot is damaged: {error}") from None
    if reader.unconsumed_tail or not reader.eof:
        raise ModelError(
            f"a part of the recorded robot is not whole, or has {_LARGEST:g} bytes"
        )
    return data


def model_data(model: pin.Model) -> dict[str, Any]:
    """Return a model as JSON data.

    Raises:
        ModelError: If a joint is of a type that is not known here.
    """
    joints = []
    for k in range(1, model.njoints):
        name = model.names[k]
        joints.append(
            {
                "name": name,
                **joint_data(model, k),
                "parent": int(model.parents[k]),
                "pose": pose_numbers(model.jointPlacements[k]),
                "inertia": _inertia(model.inertias[k]),
            }
        )
    frames = [
        {
            "name": frame.name,
            "joint": int(frame.parentJoint),
            "frame": int(frame.parentFrame),
            "pose": pose_numbers(frame.placement),
            "type": int(frame.type),
        }
        for frame in model.frames[1:]
    ]
    numbers = {
        name: np.asarray(getattr(model, name)).tolist()
        for name in (*_PER_POSITION, *_PER_VELOCITY)
    }
    return {
        "name": model.name,
        "gravity": model.gravity.vector.tolist(),
        "joints": joints,
        "frames": frames,
        "base_inertia": _inertia(model.inertias[0]),
        **numbers,
    }


def model_of(data: Mapping[str, Any]) -> pin.Model:
    """Return the model of JSON data.

    Raises:
        ModelError: If it is none.
    """
    try:
        return _model_of(data)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise ModelError(f"the recorded model is invalid: {error!r}") from None


def _model_of(data: Mapping[str, Any]) -> pin.Model:
    model = pin.Model()
    for each in data["joints"]:
        parent = int(each["parent"])
        if not 0 <= parent < model.njoints:
            raise ValueError(f"joint {each['name']!r} has no parent {parent}")
        pose = _placement(each["pose"])
        model.addJoint(parent, _joint_of(each), pose, each["name"])
    for k, each in enumerate(data["joints"], start=1):
        if "follows" in each:
            leader, scaling, offset = each["follows"]
            if not 0 < leader < model.njoints:
                raise ValueError(f"joint {each['name']!r} has no leader {leader}")
            model = pin.transformJointIntoMimic(
                model, int(leader), k, float(scaling), float(offset)
            )
    model.name = str(data["name"])
    model.gravity = pin.Motion(np.array(data["gravity"], dtype=float))
    for k, each in enumerate(data["joints"], start=1):
        model.inertias[k] = _inertia_of(each["inertia"])
    model.inertias[0] = _inertia_of(data["base_inertia"])
    last = len(data["frames"])
    for k, each in enumerate(data["frames"], start=1):
        if not (0 <= each["joint"] < model.njoints and 0 <= each["frame"] <= last):
            raise ValueError(f"frame {each['name']!r} has no parent")
        kind = pin.FrameType.values[each["type"]]
        pose = _placement(each["pose"])
        # A locked joint's frame is its own parent in Pinocchio's reduced models.
        known = min(each["frame"], k - 1)
        model.addFrame(pin.Frame(each["name"], each["joint"], known, pose, kind), False)
    for k, each in enumerate(data["frames"], start=1):
        model.frames[k].parentFrame = each["frame"]
    for names, size in ((_PER_POSITION, model.nq), (_PER_VELOCITY, model.nv)):
        for name in names:
            numbers = np.array(data[name], dtype=float)
            if numbers.shape != (size,):
                raise ValueError(f"{name} has shape {numbers.shape}; needs ({size},)")
            setattr(model, name, numbers)
    return model


def _joint_of(data: Mapping[str, Any]) -> Any:
    if data["type"] == "JointModelComposite":
        whole = pin.JointModelComposite()
        for each in data["joints"]:
            whole.addJoint(_joint_of(each), _placement(each["pose"]))
        return whole
    if data["type"] == TURNING:
        return _turning(data["axis"])
    arguments: list[Any] = [np.array(data["axis"])] if data["axis"] else []
    if "JointModelH" in data["type"]:
        arguments.append(float(data["pitch"]))
    return _JOINTS[data["type"]](*arguments)


def _turning(axis: Sequence[float]) -> Any:
    """Return a continuous joint about an axis, which only a URDF can declare."""
    xyz = " ".join(repr(float(each)) for each in axis)
    text = (
        '<robot name="one"><link name="a"/><link name="b"/>'
        '<joint name="j" type="continuous"><parent link="a"/><child link="b"/>'
        f'<axis xyz="{xyz}"/></joint></robot>'
    )
    model = pin.buildModelFromXML(text)
    return model.joints[1].extract()  # a copy: the model goes


def shapes_data(shapes: Sequence[BodyShape]) -> list[dict[str, Any]]:
    """Return shapes as JSON data."""
    return [
        {
            "body": shape.body,
            "kind": shape.kind,
            "size": list(shape.size),
            "pose": shape.pose.tolist(),
            "color": list(shape.color),
            "seen": shape.seen,
            "collides": shape.collides,
            "mesh": None
            if shape.mesh is None
            else [
                packed(np.asarray(shape.mesh[0], dtype="<f4").tobytes()),
                packed(np.asarray(shape.mesh[1], dtype="<i4").tobytes()),
            ],
        }
        for shape in shapes
    ]


def shapes_of(data: Sequence[Mapping[str, Any]]) -> tuple[BodyShape, ...]:
    """Return the shapes of JSON data.

    Raises:
        ModelError: If they are none.
    """
    try:
        return tuple(map(_shape_of, data))
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ModelError(f"the recorded shapes are invalid: {error!r}") from None


def _shape_of(data: Mapping[str, Any]) -> BodyShape:
    mesh = None
    if data["mesh"] is not None:
        points, triangles = map(unpacked, data["mesh"])
        vertices = np.frombuffer(points, "<f4").astype(float).reshape(-1, 3)
        corners = np.frombuffer(triangles, "<i4").astype(np.int64).reshape(-1, 3)
        if not np.isfinite(vertices).all():
            raise ValueError("a mesh contains NaN or inf")
        if corners.size and not 0 <= corners.min() <= corners.max() < len(vertices):
            raise ValueError("a mesh refers to a vertex that does not exist")
        mesh = vertices, corners
    red, green, blue, opacity = map(float, data["color"])
    return BodyShape(
        body=str(data["body"]),
        kind=data["kind"],
        size=tuple(map(float, data["size"])),
        pose=np.array(data["pose"], dtype=float).reshape(4, 4),
        color=(red, green, blue, opacity),
        seen=bool(data["seen"]),
        collides=bool(data["collides"]),
        mesh=mesh,
    )


def _placement(numbers: Sequence[float]) -> pin.SE3:
    values: Array = np.array(numbers, dtype=float)
    return pin.SE3(values[3:].reshape(3, 3), values[:3])


def _inertia(inertia: pin.Inertia) -> list[float]:
    return [inertia.mass, *inertia.lever.tolist(), *inertia.inertia.ravel().tolist()]


def _inertia_of(numbers: Sequence[float]) -> pin.Inertia:
    values: Array = np.array(numbers, dtype=float)
    return pin.Inertia(values[0], values[1:4], values[4:].reshape(3, 3))
