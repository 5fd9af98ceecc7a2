"""The set of compensators around the law."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, replace
from typing import Any, Literal

from hsp_control.common.errors import CompensationError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.compensation.automatic_observer import (
    automatic_observer,
    begin_automatic,
)
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

    All are inactive unless given, except the momentum observer, which is active where
    it makes sense; None turns it off. They have no memory: the stages are made by a
    `CompensatedController`, so one set serves many controllers, runs and threads.
    """

    _: KW_ONLY
    velocity_filter: VelocityFilter | None = None
    """Butterworth low-pass filter of the measured velocity."""
    predictor: Predictor | None = None
    """Evaluates the law for the predicted state in which its effort will act."""
    momentum_observer: Literal["auto"] | MomentumObserver | None = "auto"
    """Estimates the efforts that the model does not explain, and cancels them.
    ``auto``: active on a robot that may differ from its model, at a rate that suits the
    period, unless a hand is compliant or a contact has a commanded force."""
    friction_feed_forward: Literal["urdf"] | FrictionFeedForward | None = None
    """Adds efforts against friction at the desired velocity; ``urdf``: the friction in
    the robot's file."""
    integral_action: IntegralAction | None = None
    """Removes constant task errors by integral feedback."""
    force_feedback: ForceFeedback | None = None
    """Lets the commanded forces of contacts be those that are measured."""
    start_up_ramp: StartUpRamp | None = None
    """Changes the effort smoothly from holding still to the law."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the compensators that are certainly active."""
        fields = self.changed_fields()
        return tuple(name for name in fields if getattr(self, name) is not None)

    @property
    def observer(self) -> MomentumObserver | None:
        """The momentum observer that is declared; None where ``auto`` decides."""
        own = self.momentum_observer
        return own if isinstance(own, MomentumObserver) else None

    def decided(
        self, controller: Controller, period: float | None, exact: bool
    ) -> "Compensation":
        """Return the compensators of a loop, with an observer or None for ``auto``.

        Args:
            controller: The controller.
            period: The control period [s]; None: efforts are not held.
            exact: Whether the plant is the controller's model.
        """
        if self.momentum_observer != "auto":
            return self
        choice = automatic_observer(controller, period, exact)
        return replace(self, momentum_observer=choice.observer)

    def suited(
        self, controller: Controller, period: float | None, exact: bool
    ) -> "Compensation":
        """Return the compensators of a loop: None for ``auto`` where that is inactive.

        Elsewhere ``auto`` stays, since the tasks of a running loop may change.
        """
        decided = self.decided(controller, period, exact)
        return decided if decided.momentum_observer is None else self

    def on_observer(
        self, controller: Controller, period: float | None, exact: bool
    ) -> str:
        """Return a few words: whether there is an observer, its rate, and why."""
        own, automatic = self.momentum_observer, self.momentum_observer == "auto"
        if own == "auto":
            own, reason = automatic_observer(controller, period, exact)
            if own is None:
                return f"off: {reason}"
        if own is None:
            return "off"
        rate = f"{own.bandwidth:g} 1/s{' (auto)' if automatic else ''}"
        return f"on, {rate}" if own.cancel else f"only estimates, {rate}"

    def begin(self, controller: Controller) -> list[Stage]:
        """Return the stages of a run, in the order of the `CompensatedController`."""
        running = [
            begin(getattr(self, name), controller)
            for name, begin in STAGES.items()
            if getattr(self, name) is not None
        ]
        return [stage for stage in running if stage is not None]

    def check(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact] = ()
    ) -> None:
        """Check that the compensators fit a robot, its tasks and contacts."""
        for name in ("predictor", "momentum_observer", "start_up_ramp"):
            if robot.unactuated and getattr(self, name) not in (None, "auto"):
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
        observer = self.observer  # ``auto``: none where there are contacts
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
        """Check that no force is cancelled to which a task must yield."""
        observer = self.observer
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


def _begun_observer(
    own: Literal["auto"] | MomentumObserver, controller: Controller
) -> Stage | None:
    if own == "auto":
        return begin_automatic(controller)
    return own.begin(controller.robot)


STAGES: dict[str, Callable[[Any, Controller], Stage | None]] = {
    "velocity_filter": lambda own, _: RunningFilter(own),
    "start_up_ramp": lambda own, _: RunningRamp(own),
    "friction_feed_forward": lambda own, made: RunningFriction(own, made.robot),
    "momentum_observer": _begun_observer,
    "predictor": lambda own, made: RunningPredictor(own, made),
    "force_feedback": RunningForceFeedback,
    "integral_action": RunningIntegral,
}
"""The compensators' stages in a run, in the order of the chain."""
