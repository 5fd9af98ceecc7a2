"""The parts of a controller that follows a plan: its own tasks, or given ones."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from hsp_control.common.errors import PlanError
from hsp_control.companions.walking.contact_switch import Switch
from hsp_control.companions.walking.planned_references import Fed, FedOrientation
from hsp_control.constraints.contacts import Contact
from hsp_control.control.interface import PlanParts
from hsp_control.declaration import within
from hsp_control.tasks import CenterOfMass, FrameOrientation, FramePose, Task
from hsp_control.tasks.frame_task import TrackingTask
from hsp_control.trajectories import ComposedPose

FRICTION = 0.35
"""The friction coefficient of a contact that declares none: the ground ahead is unknown
[-]."""


def composed(
    own: Sequence[TrackingTask],
    tasks: Sequence[Task],
    contacts: Sequence[Contact],
    feet: Collection[str],
) -> PlanParts:
    """Return the parts of a controller whose references and contacts a plan sets."""
    given = {task.name: task for task in tasks}
    made, fed = [], []
    for needed in own:
        with within("tasks", needed.name):
            task = given.pop(needed.name, needed)
            made.append(_followed(task, needed, needed.name in feet))
    for contact in contacts:
        if contact.name not in feet:
            fed.append(contact)
            continue
        with within("contacts", contact.name):
            if contact.schedule is not None:
                raise PlanError(
                    "it has a schedule, but the plan switches it; give only one"
                )
        declared = "friction" in contact.changed_fields()
        friction = contact.friction if declared else FRICTION
        fed.append(replace(contact, schedule=Switch(), friction=friction))
    return PlanParts((*given.values(), *made), tuple(fed))


def _followed(task: Task, needed: TrackingTask, swings: bool) -> Task:
    """Return a task whose reference, and for a swing its presence, the plan sets."""
    if type(task) is not type(needed):
        raise PlanError(
            f"it is a {task.yaml_type}; the plan needs a {needed.yaml_type} of this "
            "name"
        )
    if swings and getattr(task, "frame", None) != getattr(needed, "frame", None):
        raise PlanError(
            f"its frame is {getattr(task, 'frame', None)!r}; the foot's is "
            f"{getattr(needed, 'frame', None)!r}"
        )
    if isinstance(needed, CenterOfMass) and getattr(task, "axes", "") != needed.axes:
        raise PlanError(
            f"its axes are {getattr(task, 'axes', '')!r}; the plan needs "
            f"{needed.axes!r}"
        )
    if task.schedule is not None:
        raise PlanError("it has a schedule, but the plan determines when it is active")
    changes: dict[str, Any] = {"blend": None, "trajectory": Fed(3)}
    if isinstance(needed, CenterOfMass):
        changes["trajectory"] = Fed(len(needed.axes))
    elif isinstance(needed, FrameOrientation):
        changes["trajectory"] = FedOrientation()
    elif isinstance(needed, FramePose):
        changes["trajectory"] = ComposedPose(Fed(3), FedOrientation())
    if swings:
        changes["schedule"] = Switch(on=False)
    return replace(task, **changes)
