"""The set of compensators around the law."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from typing import Any, Literal

from hsp_control.common.exceptions import CompensationError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.compensation.force_feedback import (
    ForceFeedback,
    RunningForceFeedback,
)
from hsp_control.control.compensation.friction_feed_forward import (
    FrictionFeedForward,
    RunningFriction,
)
from hsp_control.control.compensation.integral_action import (
    IntegralAction,
    RunningIntegral,
)
from hsp_control.control.compensation.momentum_observer import MomentumObserver
from hsp_control.control.compensation.predictor import Predictor, RunningPredictor
from hsp_control.control.compensation.stage import Stage
from hsp_control.control.compensation.start_up_ramp import RunningRamp, StartUpRamp
from hsp_control.control.compensation.velocity_filter import (
    RunningFilter,
    VelocityFilter,
)
from hsp_control.control.controller import Controller
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
    """Lets the commanded forces of contacts be those that are measured."""
    start_up_ramp: StartUpRamp | None = None
    """Changes the effort smoothly from holding still to the law."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the compensators that are not None."""
        return tuple(self.changed_fields())

    def begin(self, controller: Controller) -> list[Stage]:
        """Return what runs, in the order of the chain; see `Command`."""
        return [
            begin(getattr(self, name), controller)
            for name, begin in STAGES.items()
            if getattr(self, name) is not None
        ]

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
        for name in ("momentum_observer", "friction_feed_forward"):
            part = getattr(self, name)
            if isinstance(part, Part):
                with within(name):
                    part.check(robot)  # type: ignore[attr-defined]
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


STAGES: dict[str, Callable[[Any, Controller], Stage]] = {
    "velocity_filter": lambda own, _: RunningFilter(own),
    "start_up_ramp": lambda own, _: RunningRamp(own),
    "friction_feed_forward": lambda own, made: RunningFriction(own, made.robot),
    "momentum_observer": lambda own, made: own.begin(made.robot),
    "predictor": lambda own, made: RunningPredictor(own, made.robot),
    "force_feedback": RunningForceFeedback,
    "integral_action": RunningIntegral,
}
"""What each compensator becomes in a run of a controller, in the order of the chain."""
