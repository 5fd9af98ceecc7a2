"""Build fields and metric; errors have a location."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ConfigError, MetricError, SceneError
from hsp_control.config.build_robot import end_effector, posture
from hsp_control.config.document import Document
from hsp_control.config.models import fields as f
from hsp_control.config.models import null_space as s
from hsp_control.geometry.scene import Scene
from hsp_control.null_space.fields import (
    Clearance,
    EqualJointAngles,
    InverseCondition,
    JointCentering,
    LimitBarrier,
    Manipulability,
    NullSpaceField,
    ObstacleClearance,
    PointDistance,
    Ramp,
    Rest,
    SelfClearance,
    TargetPosture,
    Transmission,
    Uncontrolled,
    Weight,
    WeightedSum,
)
from hsp_control.null_space.metrics import (
    ConstantMetric,
    IdentityMetric,
    MassMatrixMetric,
    Metric,
)
from hsp_control.robot import Robot, RobotState


def build_metric(document: Document, model: s.AnyMetric, robot: Robot) -> Metric:
    """Return the joint-space metric."""
    with document.at("null_space", "metric"):
        match model:
            case s.IdentityModel():
                return IdentityMetric()
            case s.MassMatrixModel():
                return MassMatrixMetric()
            case s.ConstantModel():
                return ConstantMetric(_matrix(model.matrix))
            case s.CoordinatesModel():
                A = robot.joint_coordinates
                if model.matrix is not None:
                    A = _matrix(model.matrix)
                if A is None:
                    raise MetricError(
                        f"{robot.name} defines no joint coordinates; give matrix"
                    )
                return ConstantMetric.from_coordinates(A)


def build_fields(
    document: Document, models: list[f.AnyField], start: RobotState, scene: Scene
) -> NullSpaceField:
    """Return the sum of the fields, or `Rest` if there are none."""
    terms: list[tuple[Weight | float, NullSpaceField]] = []
    for index, model in enumerate(models):
        with document.at("null_space", "fields", index):
            field = _field(document, index, model, start, scene)
            if not field.controls and len(models) > 1:
                raise ConfigError(
                    "the field 'uncontrolled' cannot be combined with other fields"
                )
            _check_no_contact(field, start)
        weight = getattr(model, "weight", 1.0)
        if isinstance(weight, f.RampModel):
            weight = Ramp(
                weight.initial,
                weight.final,
                start=weight.start,
                duration=weight.duration,
            )
        if len(models) == 1 and weight == 1.0:
            return field
        terms.append((weight, field))
    return WeightedSum(terms) if terms else Rest(start.robot)


def _field(
    document: Document, index: int, model: f.AnyField, start: RobotState, scene: Scene
) -> NullSpaceField:
    robot, here = start.robot, ("null_space", "fields", index)
    match model:
        case f.RestModel():
            return Rest(robot)
        case f.UncontrolledModel():
            return Uncontrolled(robot)
        case f.JointCenteringModel():
            return JointCentering(robot, weights=model.weights)
        case f.LimitBarrierModel():
            return LimitBarrier(robot, zone=model.zone, weights=model.weights)
        case f.TargetPostureModel():
            with document.at(*here, "target"):
                target = posture(model.target, start)
            return TargetPosture(robot, target, weights=model.weights)
        case f.EqualJointAnglesModel():
            with document.at(*here, "joints"):
                return EqualJointAngles(robot, model.joints)
        case f.PointDistanceModel():
            with document.at(*here, "obstacle"):
                obstacle = scene[model.obstacle]
            with document.at(*here, "frames"):
                return PointDistance(robot, model.frames, obstacle)
        case f.ManipulabilityModel():
            return Manipulability(
                robot,
                end_effector(document, here, model.frame, robot),
                form=model.form,
                rows=model.rows,
                axes=model.axes,
                length=model.length,
            )
        case f.InverseConditionModel():
            return InverseCondition(
                robot,
                end_effector(document, here, model.frame, robot),
                rows=model.rows,
                axes=model.axes,
                length=model.length,
            )
        case f.TransmissionModel():
            return Transmission(
                robot,
                end_effector(document, here, model.frame, robot),
                model.direction,
                kind=model.kind,
                axes=model.axes,
            )
        case f.ObstacleClearanceModel():
            with document.at(*here, "obstacles"):
                names = list(scene) if model.obstacles is None else model.obstacles
                obstacles = [scene[name] for name in names]
            return ObstacleClearance(
                robot,
                obstacles,
                influence=model.influence,
                links=model.links,
                proxy=model.proxy,
            )
        case f.SelfClearanceModel():
            return SelfClearance(robot, influence=model.influence, proxy=model.proxy)


def _check_no_contact(field: NullSpaceField, start: RobotState) -> None:
    """Check that the start is free of contact: a barrier cannot resolve a contact."""
    if isinstance(field, Clearance):
        distance, pair = field.proximity.nearest(start)
        if distance <= 0.0:
            raise SceneError(
                f"the robot starts in contact: {pair}, {-distance:.3g} m deep; "
                "change the start or move the obstacle"
            )


def _matrix(rows: Any) -> Array:
    try:
        return np.array(rows, dtype=float)
    except ValueError:
        raise MetricError("the rows of the matrix have different lengths") from None
