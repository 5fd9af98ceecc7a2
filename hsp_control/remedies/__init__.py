"""Remedies: what is done about a world that is not as the model has it."""

from .command import Command as Command
from .effort_rate import EffortRateClip as EffortRateClip
from .friction_feed_forward import FrictionFeedForward as FrictionFeedForward
from .integral_action import IntegralAction as IntegralAction
from .momentum_observer import MomentumObserver as MomentumObserver
from .predictor import Predictor as Predictor
from .remedies import Remedies as Remedies
from .start_up_ramp import StartUpRamp as StartUpRamp
from .velocity_filter import VelocityFilter as VelocityFilter
