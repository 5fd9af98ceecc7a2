"""Build contacts, limits and schedules; errors have a location."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError, LimitError
from hsp_control.config.document import Document
from hsp_control.config.models import contacts as c
from hsp_control.config.models import limits as l
from hsp_control.config.models.tasks import AnyTask, ScheduleModel
from hsp_control.constraints.contacts import (
    BallContact,
    Contact,
    PointContact,
    SurfaceContact,
)
from hsp_control.constraints.limits import Limits, MinimumDistance
from hsp_control.geometry.scene import Scene
from hsp_control.null_space.fields import Clearance, ObstacleClearance, SelfClearance
from hsp_control.robot import Robot
from hsp_control.tasks import Task
from hsp_control.trajectories.schedule import Schedule


def build_contacts(
    document: Document, models: dict[str, c.AnyContact], robot: Robot
) -> list[Contact]:
    """Return the contacts, with their names in the configuration."""
    return [_contact(document, name, model, robot) for name, model in models.items()]


def put_on_ground(
    document: Document, height: float, contacts: list[Contact], robot: Robot, q: Array
) -> Array:
    """Return q with the root moved vertically: the lowest contact is then at a height.

    Args:
        document: The configuration.
        height: The height [m].
        contacts: The contacts.
        robot: The robot.
        q: Configuration, shape (nq,).

    Raises:
        ContactError: If the robot has no free-flyer root, or no contact.
    """
    with document.at("start", "ground"):
        if not (robot.unactuated and contacts):
            raise ContactError(
                f"{robot.name} has no contact to put on the ground"
                if robot.unactuated
                else f"{robot.name} has no free-flyer root to put on the ground"
            )
        state = robot.state(0.0, q, np.zeros(robot.nv))
        frames = [state.frame(contact.frame) for contact in contacts]
        lowest = min(
            float((frame.position + contact.arms(frame))[:, 2].min())
            for contact, frame in zip(contacts, frames, strict=True)
        )
        # The displacement of a root is expressed in its own axes.
        root = next(iter(robot.joints.values()))
        lift = np.zeros(robot.nv)
        up = state.data.oMi[1].rotation.T @ np.array([0.0, 0.0, height - lowest])
        lift[root.idx_v : root.idx_v + 3] = up
        return robot.integrate(q, lift)


def _contact(
    document: Document, name: str, model: c.AnyContact, robot: Robot
) -> Contact:
    with document.at("contacts", name, "frame"):
        robot.frame_id(model.frame)
    with document.at("contacts", name, "schedule"):
        schedule = build_schedule(model.schedule)
    shared: dict[str, Any] = {
        "friction": model.friction,
        "normal": model.normal,
        "damping": model.damping,
        "schedule": schedule,
        "name": name,
    }
    with document.at("contacts", name):
        match model:
            case c.PointContactModel():
                return PointContact(robot, model.frame, point=model.point, **shared)
            case c.BallContactModel():
                return BallContact(robot, model.frame, radius=model.radius, **shared)
            case c.SurfaceContactModel():
                return _surface(model, robot, shared)


def _surface(
    model: c.SurfaceContactModel, robot: Robot, shared: dict[str, Any]
) -> Contact:
    sized = model.length is not None and model.width is not None
    if sized == (model.corners is not None):
        raise ContactError("give either length and width of the sole, or its corners")
    if model.corners is not None:
        return SurfaceContact(robot, model.frame, corners=model.corners, **shared)
    return SurfaceContact.rectangle(
        robot,
        model.frame,
        length=model.length or 0.0,
        width=model.width or 0.0,
        center=model.center,
        **shared,
    )


def build_limits(
    document: Document, model: l.LimitsModel | None, robot: Robot, scene: Scene
) -> Limits | None:
    """Return the limits; None if there are none."""
    if model is None:
        return None
    distances = []
    for k, each in enumerate(model.distances):
        with document.at("limits", "distances", k):
            distances.append(_distance(each, robot, scene))
    position: Any = {"robot": "robot", "none": None}.get(str(model.position))
    if isinstance(model.position, l.PositionRangeModel):
        position = (model.position.lower, model.position.upper)
    with document.at("limits"):
        own = Limits(robot, position=None)
        return Limits(
            robot,
            effort=_maximum(document, "effort", model.effort, own.effort, robot),
            effort_rate=model.effort_rate,
            velocity=_maximum(
                document, "velocity", model.velocity, own.velocity, robot
            ),
            acceleration=model.acceleration,
            position=position,
            position_margin=model.position_margin,
            velocity_margin=model.velocity_margin,
            distances=distances,
            bandwidth=model.bandwidth,
            static_effort=model.static_effort,
            null_space_speed=model.null_space_speed,
            null_space_weight=model.null_space_weight,
        )


def _distance(model: l.AnyDistance, robot: Robot, scene: Scene) -> MinimumDistance:
    field: Clearance
    if isinstance(model, l.SelfDistanceModel):
        field = SelfClearance(robot)
    else:
        names = list(scene) if model.obstacles is None else model.obstacles
        obstacles = [scene[name] for name in names]
        field = ObstacleClearance(robot, obstacles, links=model.links)
    return MinimumDistance(field.proximity, model.least)


def _maximum(
    document: Document, key: str, model: l.Maximum, own: Array, robot: Robot
) -> Any:
    """Return a maximum effort or speed in numbers; None if it is unlimited."""
    if isinstance(model, l.ScaledModel):
        if not isinstance(model.scale, dict):
            return model.scale * own
        scaled = own.copy()
        for joint, scale in model.scale.items():
            with document.at("limits", key, "scale", joint):
                where = robot.velocity_index(joint)
                if not np.isfinite(own[where]).all():
                    raise LimitError(f"{joint} has no {key} limit that could be scaled")
                scaled[where] *= scale
        return scaled
    if isinstance(model, str):
        return own if model == "robot" else None
    return np.asarray(model)


def build_schedule(model: ScheduleModel | None) -> Schedule | None:
    """Return a schedule; None if there is none."""
    if model is None:
        return None
    intervals = [
        (-np.inf if start is None else start, np.inf if end is None else end)
        for start, end in model.intervals
    ]
    return Schedule(intervals, ramp=model.ramp)


def build_schedules(
    document: Document, models: dict[str, AnyTask]
) -> dict[str, Schedule]:
    """Return the schedules of tasks that are not always active, by name."""
    schedules = {}
    for name, model in models.items():
        with document.at("tasks", name, "schedule"):
            schedule = build_schedule(model.schedule)
        if schedule is not None:
            schedules[name] = schedule
    return schedules


def by_priority(tasks: list[Task], models: dict[str, AnyTask]) -> list[list[Task]]:
    """Return tasks level by level, the highest priority first."""
    priorities = sorted({model.priority for model in models.values()})
    return [
        [task for task in tasks if models[task.name].priority == priority]
        for priority in priorities
    ]
