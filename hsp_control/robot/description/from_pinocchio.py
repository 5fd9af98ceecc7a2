"""A robot out of a Pinocchio model, with the shapes of its geometry models."""

import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import ModelError
from hsp_control.robot.description.joint_data import joint_data
from hsp_control.robot.description.loading import completed
from hsp_control.robot.description.robot_description import ToolFrame
from hsp_control.robot.description.sources import (
    PINOCCHIO,
    BodyShape,
    RobotSource,
    Root,
    ShapeKind,
)

_ROOTS: dict[str, Root] = {
    "JointModelFreeFlyer": "free_flyer",
    "JointModelPlanar": "planar",
}
Converted = tuple[ShapeKind, tuple[float, ...], tuple[Array, Indices] | None]
_log = logging.getLogger(__name__)


def take_model(
    model: Any,
    collision: Any,
    visual: Any,
    home: ArrayLike | None,
    end_effector: str | None,
    tool_frames: Mapping[str, ToolFrame],
) -> tuple[pin.Model, RobotSource]:
    """Return a copy of the model, and a source that contains its shapes."""
    _check_type(model, "model", pin.Model)
    for geometry, role in ((collision, "collision"), (visual, "visual")):
        if geometry is not None:
            _check_type(geometry, role, pin.GeometryModel)
    model = model.copy()
    _check_joints(model)
    displacement = None
    if home is not None:
        q = np.asarray(home, dtype=float)
        if q.shape != (model.nq,):
            raise ModelError(f"home has shape {q.shape}; needs ({model.nq},)")
        displacement = tuple(pin.difference(model, pin.neutral(model), q))
    root = model.joints[1].shortname() if model.njoints > 1 else ""
    collides = _shapes(model, collision, "collision")
    source = RobotSource(
        name=model.name or "robot",
        urdf=Path(model.name or "robot"),
        root=_ROOTS.get(root, "fixed"),
        origin=PINOCCHIO,
        end_effector=end_effector,
        home=displacement,
        shapes=(*collides, *_shapes(model, visual, "visual")),
        excluded=_excluded(model, collision),
    )
    return completed(model, source, tool_frames, None), source


def _check_type(given: Any, name: str, kind: type) -> None:
    if not isinstance(given, kind):
        parts = "robot.model, robot.collision_model and robot.visual_model"
        hint = f"; give {parts}" if isinstance(given, pin.RobotWrapper) else ""
        needs = f"needs a pinocchio.{kind.__name__}{hint}"
        raise ModelError(f"{name} is of type {type(given).__name__}; {needs}")


def _check_joints(model: pin.Model) -> None:
    """Check that each is known, and that no motion subspace depends on a configuration.

    Pinocchio's rates of Jacobians and of the mass matrix leave out S' (seen with 4.1).
    """
    rng, first = np.random.default_rng(0), model.createData()
    neutral = pin.neutral(model)
    pin.computeJointJacobians(model, first, neutral)
    for _ in range(3):
        data = model.createData()
        q = pin.integrate(model, neutral, rng.uniform(-1.0, 1.0, model.nv))
        pin.computeJointJacobians(model, data, q)
        for index in range(1, model.njoints):
            before, after = (np.asarray(each.joints[index].S) for each in (first, data))
            if np.abs(before - after).max(initial=0.0) > 1e-9:
                kind = model.joints[index].shortname()
                raise ModelError(
                    f"joint {model.names[index]!r} is a {kind}, whose motion subspace "
                    "depends on its configuration: its rates would be wrong; needs "
                    "joints of one axis each, one after the other, or a ball "
                    "(JointModelSpherical)"
                )
    for index in range(1, model.njoints):
        joint_data(model, index)


def _shapes(model: pin.Model, geometry: Any, role: str) -> Iterator[BodyShape]:
    """Yield the shapes of a geometry model; those without counterpart are logged."""
    for item in () if geometry is None else geometry.geometryObjects:
        frame = _frame(model, item, role)
        known = _converted(item.geometry)
        if known is None:
            _log.warning(
                "%s: the %s shape %r is a %s, which has no counterpart here: left out",
                model.name, role, item.name, type(item.geometry).__name__,
            )  # fmt: skip
            continue
        kind, size, mesh = known
        if mesh is not None and not np.isfinite(mesh[0]).all():
            raise ModelError(f"{role}: the mesh of {item.name!r} contains NaN or inf")
        red, green, blue, opacity = map(float, item.meshColor)
        yield BodyShape(
            body=frame.name,
            kind=kind,
            size=size,
            pose=frame.placement.actInv(item.placement).homogeneous,
            color=(red, green, blue, opacity),
            seen=role == "visual",
            collides=role == "collision",
            mesh=mesh,
        )


def _frame(model: pin.Model, item: Any, role: str) -> pin.Frame:
    """Return the frame that gives a shape's body its name."""
    joint, index = int(item.parentJoint), int(item.parentFrame)
    if index < model.nframes and model.frames[index].parentJoint == joint:
        return model.frames[index]
    own = [frame for frame in model.frames if frame.parentJoint == joint]
    if own and index >= model.nframes:  # it was made without a frame
        links = [frame for frame in own if frame.type == pin.FrameType.BODY]
        return (links or own)[0]
    raise ModelError(
        f"{role}: {item.name!r} is fixed to joint {joint} and frame {index} of another "
        "model; if joints were locked, give all that pin.buildReducedModel returns: "
        "model, [collision, visual] = pin.buildReducedModel(model, [collision, visual],"
        " ...)"
    )


def _converted(shape: Any) -> Converted | None:
    """Return kind, size and mesh of one of Coal's shapes; None for no counterpart."""
    match shape:
        case coal.Box():
            return "box", tuple(2.0 * shape.halfSide), None
        case coal.Sphere():
            return "sphere", (shape.radius,), None
        case coal.Capsule():
            return "capsule", (shape.radius, 2.0 * shape.halfLength), None
        case coal.Cylinder():
            return "cylinder", (shape.radius, 2.0 * shape.halfLength), None
        case coal.Ellipsoid():
            return "ellipsoid", tuple(shape.radii), None
        case coal.BVHModelBase():
            corners = map(shape.tri_indices, range(shape.num_tris))
            return "mesh", (), (np.array(shape.vertices()), _triangles(corners))
        case coal.Convex():
            sides = map(shape.polygons, range(shape.num_polygons))
            return "mesh", (), (np.array(shape.points()), _triangles(sides))
    return None


def _triangles(given: Iterable[Any]) -> Indices:
    return np.array([(each[0], each[1], each[2]) for each in given], dtype=np.int64)


def _excluded(model: pin.Model, collision: Any) -> frozenset[frozenset[str]]:
    """Return the links that never collide: all but the given pairs, if any."""
    if collision is None or not len(collision.collisionPairs):
        return frozenset()
    items = collision.geometryObjects
    links = [_frame(model, each, "collision").name for each in items]
    pairs = collision.collisionPairs
    active = {frozenset((links[pair.first], links[pair.second])) for pair in pairs}
    every = {frozenset((a, b)) for a in links for b in links if a != b}
    return frozenset(every - active)
