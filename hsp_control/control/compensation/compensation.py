"""The set of compensators around the law."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from hsp_control.common.exceptions import CompensationError
from hsp_control.constraints.limits import RobotLimits
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
    """Compensators for the differences between the robot and its model.

    Each may be None. They have memory: use one set in one `Command` at a time.

    Attributes:
        velocity_filter: Filters the measured velocity.
        predictor: Predicts the state at which the effort will act.
        momentum_observer: Estimates and cancels efforts that the model does not
            explain.
        friction_feed_forward: Adds the friction effort at the desired velocity.
        integral_action: Removes steady-state errors of tasks.
        effort_rate: Limits the rate of the effort that is sent.
        start_up_ramp: Blends from holding still into the law.
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
        """The names of the compensators that are not None."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) is not None)

    def check(
        self, robot: Robot, tasks: Sequence[Task], limits: RobotLimits | None = None
    ) -> None:
        """Check that the compensators fit a robot, its tasks and its limits.

        Raises:
            CompensationError: Names the compensator, the setting, and what it must be.
            GainError: If errors would not decay with the integral action.
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
                "effort_rate: limits.effort_rate keeps the rate already, and deviates "
                "in the null space first; remove one of the two"
            )
