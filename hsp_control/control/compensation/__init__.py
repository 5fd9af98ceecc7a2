"""Compensation: compensators for the differences between the robot and its model."""

from hsp_control.common.entry_points import own_names

from .compensated_controller import CompensatedController as CompensatedController
from .compensation import Compensation as Compensation
from .force_feedback import ForceFeedback as ForceFeedback
from .friction_feed_forward import FrictionFeedForward as FrictionFeedForward
from .integral_action import IntegralAction as IntegralAction
from .momentum_observer import MomentumObserver as MomentumObserver
from .predictor import Predictor as Predictor
from .rate_check import RateFinding as RateFinding
from .rate_check import check_rate as check_rate
from .start_up_ramp import StartUpRamp as StartUpRamp
from .velocity_filter import VelocityFilter as VelocityFilter

__dir__ = own_names(__name__)
