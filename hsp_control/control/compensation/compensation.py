"""Which compensation are on."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from hsp_control.common.exceptions import CompensationError
from hsp_control.constraints.limits import Limits
from hsp_control.control.compensation.effort_rate import EffortRateClip
from hsp_control.control.compensation.friction_feed_forward import FrictionFeedForward
from hsp_control.control.compensation.integral_action import IntegralAction
from hsp_control.control.compensation.momentum_observer import MomentumObserver
from hsp_control.control.compensation.predictor import Predictor
from hsp_control.control.compensation.start_up_ramp import StartUpRamp
from hsp_control.control.compensation.velocity_filter import VelocityFilter
from hsp_control.robot import Robot
from hsp_control.tasks import Task


@dataclass(frozen=True)
class Compensation:
    """What is done about a world that is not as the model has it; each may be None.

    They remember: one set serves one `Command` at a time.

    Attributes:
        velocity_filter: A low-pass on the measured velocity.
        predictor: The law is shown the state in which its effort will act.
        momentum_observer: What pushes beside the model is estimated and cancelled.
        friction_feed_forward: Friction is paid for before it is felt.
        integral_action: A task's lasting error is worn away.
        effort_rate: The effort that goes out changes no faster than a drive accepts.
        start_up_ramp: From rest to the law without a jump.
    """

    velocity_filter: VelocityFilter | None = None
    predictor: Predictor | None = None
    momentum_observer: MomentumObserver | None = None
    friction_feed_forward: FrictionFeedForward | None = None
    integral_action: IntegralAction | None = None
    effort_rate: EffortRateClip | None = None
    start_up_ramp: StartUpRamp | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names of those that are on."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) is not None)

    def check(
        self, robot: Robot, tasks: Sequence[Task], limits: Limits | None = None
    ) -> None:
        """Refuse what does not fit a robot, its tasks and its limits.

        Raises:
            CompensationError: Names the compensator, the setting, and what is right.
            GainError: If integral action would not decay.
        """
        for part in (
            self.predictor,
            self.momentum_observer,
            self.friction_feed_forward,
            self.effort_rate,
            self.start_up_ramp,
        ):
            if part is not None:
                part.check(robot)
        if self.integral_action is not None:
            self.integral_action.check(tasks)
        if (
            self.effort_rate is not None
            and limits is not None
            and np.isfinite(limits.effort_rate).any()
        ):
            raise CompensationError(
                "effort_rate: limits.effort_rate keeps the rate already, and better; "
                "leave one of the two away"
            )
