"""The parts of a controller as they were declared, and how they are placed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ControllerError, FieldError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.evolution import PRESENT, Evolution
from hsp_control.control.planned import PlannedContact, PlannedLimits
from hsp_control.control.setup import (
    Base,
    PlannedTerm,
    Setup,
    check_kind,
    check_support,
    check_tasks,
    checked_gain,
    planned_task,
)
from hsp_control.declaration import within
from hsp_control.declaration.nested import parts_within, with_parts_replaced
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields import NullSpaceField, Rest
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.robot import Robot
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.gains import as_gain
from hsp_control.trajectories.streams.stream import Streamed


@dataclass(frozen=True)
class Declared:
    """What a controller is made of before anything relative in it is placed."""

    robot: Robot
    tasks: tuple[Task, ...]
    field: NullSpaceField
    gain: Array  # K_N: a scalar, shape (nv,) or (nv, nv) [1/s]
    metric: Metric
    threshold: float  # singular value below which an inverse is bounded
    limits: Limits | None
    contacts: tuple[Contact, ...]
    base: Base | None  # what else than contacts acts on a floating base
    scene: Scene
    # configuration that relative parts refer to, shape (nq,); None: that of the first
    # step
    start: Array | None

    @classmethod
    def checked(
        cls,
        robot: Robot,
        tasks: Sequence[Task],
        field: NullSpaceField | None,
        null_space_gain: ArrayLike,
        metric: Metric | None,
        singularity_threshold: float,
        limits: Limits | None,
        contacts: Sequence[Contact],
        base: Base | None,
        scene: Scene | Iterable[Obstacle],
        start: ArrayLike | None,
    ) -> Self:
        """Check each part by itself; see `Controller` for what they mean."""
        if not 0.0 < singularity_threshold < np.inf:
            raise ControllerError(
                f"singularity_threshold is {singularity_threshold}; must be positive"
            )
        field = Rest() if field is None else field
        for task in tasks:
            check_kind("tasks contains", task, Task)
        if metric is None:
            yields = any(impedance_of(task) is not None for task in tasks)
            own = MassMatrixMetric(inertia="robot")
            metric = own if yields else IdentityMetric()
        for contact in contacts:
            check_kind("contacts contains", contact, Contact)
        check_kind("field is", field, NullSpaceField)
        check_kind("metric is", metric, Metric)
        if limits is not None:
            check_kind("limits is", limits, Limits)
        scene = scene if isinstance(scene, Scene) else Scene(scene)
        known = None if start is None else robot.check_configuration(start).copy()
        check_support(robot, contacts, base)
        with within("null_space", "gain"):
            gain = as_gain(null_space_gain, "null_space_gain")
        return cls(
            robot,
            tuple(tasks),
            field,
            gain,
            metric,
            float(singularity_threshold),
            limits,
            tuple(contacts),
            base,
            scene,
            known,
        )

    def placed(self, start: Start) -> Setup:
        """Return the setup with all parts placed where the robot starts."""
        robot = self.robot
        tasks = []
        for task in self.tasks:
            with within("tasks", task.name):
                tasks.append(task.placed(start))
        with within("tasks"):
            check_tasks(tasks, robot)
        with within("null_space", "metric"):
            metric = self.metric.placed(start)
        with within("null_space", "gain"):
            gain = checked_gain(self.gain, robot, metric)
        fields = []
        for k, term in enumerate(terms_of(self.field)):
            with within("null_space", "fields", k):
                _refuse_streams(term)
                fields.append(PlannedTerm(term.placed(start), PRESENT))
        contacts = []
        for contact in self.contacts:
            with within("contacts", contact.name):
                contacts.append(PlannedContact(contact.placed(start), PRESENT))
        limits: RobotLimits | None = None
        if self.limits is not None:
            with within("limits"):
                limits = self.limits.placed(start)
        return Setup(
            start,
            metric,
            tuple(planned_task(k, task, PRESENT) for k, task in enumerate(tasks)),
            tuple(fields),
            Evolution(gain),
            tuple(contacts),
            PlannedLimits.of(limits),
            len(tasks),
        )

    def preview(self) -> "Declared":
        """Return the same parts with streams that begin anew."""
        return replace(
            self,
            tasks=tuple(
                with_parts_replaced(task, Streamed, Streamed.preview)
                for task in self.tasks
            ),
        )


def _refuse_streams(field: NullSpaceField) -> None:
    """Raise for a field that a stream leads: only that of a change is logged."""
    if any(True for _ in parts_within(field, Streamed)):
        raise FieldError(
            "a stream cannot lead a field from the start; while the controller runs, "
            "controller.at(t).field(...) with a stream does"
        )
