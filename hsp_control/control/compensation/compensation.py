"""The set of compensators around the law."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Literal

from hsp_control.common.exceptions import CompensationError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.compensation.force_feedback import ForceFeedback
from hsp_control.control.compensation.friction_feed_forward import FrictionFeedForward
from hsp_control.control.compensation.integral_action import IntegralAction
from hsp_control.control.compensation.momentum_observer import MomentumObserver
from hsp_control.control.compensation.predictor import Predictor
from hsp_control.control.compensation.start_up_ramp import StartUpRamp
from hsp_control.control.compensation.velocity_filter import VelocityFilter
from hsp_control.declaration import Part, within
from hsp_control.robot import Robot
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of


class Compensation(Part, error=CompensationError):
    """Compensators for the differences between the robot and its model.

    Each is off unless it is given; None turns it off. They have no memory: a `Command`
    makes what runs, so one set serves many controllers, runs and threads.
    """

    _: KW_ONLY
    velocity_filter: VelocityFilter | None = None
    """Butterworth low-pass filter of the measured velocity."""
    predictor: Predictor | None = None
    """Evaluates the law for the predicted state in which its effort will act."""
    momentum_observer: MomentumObserver | None = None
    """Estimates the efforts that the model does not explain, and cancels them if it is
    to."""
    friction_feed_forward: Literal["urdf"] | FrictionFeedForward | None = None
    """Adds efforts against friction at the desired velocity; ``urdf`` takes the
    friction from the robot's file."""
    integral_action: IntegralAction | None = None
    """Removes constant task errors by integral feedback."""
    force_feedback: ForceFeedback | None = None
    """Lets the commanded forces of contacts be those that are felt."""
    start_up_ramp: StartUpRamp | None = None
    """Changes the effort smoothly from holding still to the law."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the compensators that are not None."""
        return tuple(self.changed_fields())

    def friction(self, robot: Robot) -> FrictionFeedForward | None:
        """Return the friction feed-forward for a robot, its own in place of "urdf"."""
        given = self.friction_feed_forward
        if isinstance(given, str):
            return FrictionFeedForward.of_model(robot)
        return given

    def check(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact] = ()
    ) -> None:
        """Check that the compensators fit a robot, its tasks and contacts."""
        for name in ("predictor", "momentum_observer", "start_up_ramp"):
            if robot.unactuated and getattr(self, name) is not None:
                with within(name):
                    raise CompensationError(
                        f"{robot.name} has a free-flyer root, and its contact forces "
                        "are not measured; needs a robot with a fixed base"
                    )
        for name, part in (
            ("momentum_observer", self.momentum_observer),
            ("friction_feed_forward", self.friction(robot)),
        ):
            if part is not None:
                with within(name):
                    part.check(robot)
        self._check_compliance(tasks)
        self._check_forces(contacts)
        if self.integral_action is not None:
            with within("integral_action"):
                self.integral_action.gains(tasks)

    def _check_forces(self, contacts: Sequence[Contact]) -> None:
        """Check that there are forces to feed back, and that none is cancelled."""
        observer = self.momentum_observer
        if observer is not None and observer.cancel and contacts:
            with within("momentum_observer"):
                raise CompensationError(
                    f"the observer would cancel the force at contact "
                    f"{contacts[0].name!r}; set cancel to false"
                )
        if self.force_feedback is not None:
            with within("force_feedback"):
                self.force_feedback.check(contacts, observer is not None)

    def _check_compliance(self, tasks: Sequence[Task]) -> None:
        """Check that no force is cancelled to which a task is to yield."""
        observer = self.momentum_observer
        if observer is None or not observer.cancel or observer.clip is not None:
            return
        for task in tasks:
            if impedance_of(task) is not None:
                with within("momentum_observer"):
                    raise CompensationError(
                        f"the observer would cancel every force to which task "
                        f"{task.name!r} is to yield by its impedance; set cancel to "
                        "false, or a clip [N·m] that is as large as the friction"
                    )
