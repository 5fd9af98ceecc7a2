"""Compensators for differences between the real robot and its model."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Gain, Model, NonNegative, Positive, Weights
from hsp_control.config.models.plant import Count


class VelocityFilterModel(Model):
    """Butterworth low-pass filter of the measured velocity."""

    cutoff: Positive
    """Cut-off frequency: half of the power passes [Hz]."""
    order: Literal[1, 2] = 1
    """Order of the filter [-]."""


class PredictorModel(Model):
    """The law is evaluated for the predicted state in which its effort will act."""

    effort_delay: Count = 1
    """Delay from an effort to its action [control periods]."""
    sensor_delay: Count = 0
    """Age of a measurement [control periods]."""


class MomentumObserverModel(Model):
    """The efforts that the model does not explain are estimated and cancelled."""

    bandwidth: Positive = 50.0
    """Rate at which the estimate converges [1/s]; 20 to 50 is usual."""
    clip: Positive | list[Positive] | None = None
    """Largest effort that is cancelled [N·m or N], one number or nv; unlimited by
    default."""


class FrictionFeedForwardModel(Model):
    """Efforts against friction at the desired velocity."""

    coulomb: Weights = 0.0
    """Coulomb friction [N·m or N], one number or nv."""
    viscous: Weights = 0.0
    """Viscous friction [N·m·s/rad or N·s/m], one number or nv."""
    smoothing: Positive = 0.02
    """Speed scale v_s of the smoothed sign, tanh(v/v_s) [rad/s or m/s]."""


class IntegralActionModel(Model):
    """Integral feedback of task errors removes constant errors."""

    rate: Positive | None = None
    """Rate at which a constant error decays [1/s]: Ki = rate · Kp."""
    ki: dict[str, Gain] = {}
    """Ki by task name [1/s³]: a number, one for each row, or a matrix."""
    tasks: list[str] | None = None
    """Names of the tasks with integral action; all by default."""
    limit: Positive | None = None
    """Largest acceleration from the integral in a row [m/s² or rad/s²]; unlimited by
    default."""


class StartUpRampModel(Model):
    """The effort changes smoothly from holding still to the law."""

    duration: Positive = 1.0
    """Time until the law is fully active [s]."""
    natural_frequency: NonNegative = 0.0
    """Natural frequency of the spring that holds the robot meanwhile [rad/s]; 0 is pure
    gravity compensation."""


class CompensationModel(Model):
    """Compensators; each is off unless it is given, and ``null`` turns it off."""

    velocity_filter: VelocityFilterModel | None = None
    """Butterworth low-pass filter of the measured velocity."""
    predictor: PredictorModel | None = None
    """Evaluates the law for the predicted state in which its effort will act."""
    momentum_observer: MomentumObserverModel | None = None
    """Estimates the efforts that the model does not explain, and cancels them."""
    friction_feed_forward: Literal["urdf"] | FrictionFeedForwardModel | None = None
    """Adds efforts against friction at the desired velocity; ``urdf`` takes the
    friction from the robot's file."""
    integral_action: IntegralActionModel | None = None
    """Removes constant task errors by integral feedback."""
    effort_rate: Positive | Annotated[list[Positive], Field(min_length=1)] | None = None
    """Maximum rate of the effort that is sent [N·m/s or N/s], one number or nv; for
    controllers without `limits.effort_rate`."""
    start_up_ramp: StartUpRampModel | None = None
    """Changes the effort smoothly from holding still to the law."""
