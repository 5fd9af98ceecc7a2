"""The parts of a controller before relative values in them are placed."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, FieldError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.evolution import PRESENT, Evolution
from hsp_control.control.first_state import check_angles
from hsp_control.control.fitting import (
    Base,
    check_limits,
    check_parts,
    check_support,
    check_tasks,
    checked_gain,
)
from hsp_control.control.planned import (
    PlannedContact,
    PlannedLimits,
    PlannedTerm,
    planned_task,
)
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.declaration.language import check_kind
from hsp_control.declaration.nested import parts_within
from hsp_control.geometry.scene import Obstacle, Scene, Start
from hsp_control.null_space.fields import NullSpaceField, Rest
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.robot import Robot
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.gains import as_gain
from hsp_control.trajectories.streams.streamed import Streamed


class DeclaredController:
    """The parts of a controller before relative values in them are placed."""

    def __init__(
        self,
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
    ) -> None:
        """Check the parts separately; `Controller` documents the arguments."""
        if isinstance(robot, str | Path):
            raise ControllerError(f"robot is {robot!r}; needs Robot.load({robot!r})")
        if isinstance(robot, pin.Model):
            raise ControllerError(
                "robot is a pinocchio.Model; needs Robot.from_pinocchio(model)"
            )
        check_kind("robot is", robot, Robot, ControllerError)
        threshold = singularity_threshold
        if not (isinstance(threshold, int | float) and 0.0 < threshold < np.inf):
            raise ControllerError(
                f"singularity_threshold is {threshold!r}; must be positive"
            )
        self.robot, self.limits, self.base = robot, limits, base
        self.threshold = float(threshold)
        self.field = Rest() if field is None else field
        check_parts("tasks", tasks, Task)
        self.tasks = tuple(tasks)
        if metric is None:
            yields = any(impedance_of(task) is not None for task in tasks)
            own = MassMatrixMetric(inertia="robot")
            metric = own if yields else IdentityMetric()
        check_parts("contacts", contacts, Contact)
        self.contacts = tuple(contacts)
        check_kind("field is", self.field, NullSpaceField, ControllerError)
        self.metric: Metric = check_kind("metric is", metric, Metric, ControllerError)
        check_limits(limits)
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        # that of the first step where it is None
        self.start: Array | None = None
        if start is not None:
            with within("start"):
                self.start = robot.check_configuration(start).copy()
                check_angles(robot, self.start)
        check_support(robot, contacts, base)
        with within("null_space", "gain"):
            self.gain = as_gain(null_space_gain, "null_space_gain")

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
            Evolution(np.array(robot.model.gravity.linear)),
        )


def _refuse_streams(field: NullSpaceField) -> None:
    """Raise for a streamed field: only that of a change is logged."""
    if any(True for _ in parts_within(field, Streamed)):
        raise FieldError(
            "a stream cannot lead a field from the start; while the controller runs, "
            "controller.at(t).field(...) with a stream does"
        )
