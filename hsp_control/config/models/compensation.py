"""What is done about a world that is not as the model has it."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Gain, Model, NonNegative, Positive, Weights
from hsp_control.config.models.plant import Count


class VelocityFilterModel(Model):
    """A low-pass on the measured velocity."""

    cutoff: Positive
    """Where half of the power passes [Hz]."""
    order: Literal[1, 2] = 1
    """Of Butterworth's filter."""


class PredictorModel(Model):
    """The law is shown the state in which its effort will act."""

    effort_delay: Count = 1
    """Control periods that an effort takes to act."""
    sensor_delay: Count = 0
    """Control periods that a measurement is old."""


class MomentumObserverModel(Model):
    """What pushes beside the model is estimated and cancelled."""

    bandwidth: Positive = 50.0
    """Rate at which the estimate follows [1/s]; 20 to 50 is usual."""
    clip: Positive | list[Positive] | None = None
    """Most that is cancelled [N·m or N], of all freedoms or of each; none: any."""


class FrictionFeedForwardModel(Model):
    """Friction is paid for before it is felt."""

    coulomb: Weights = 0.0
    """Dry friction [N·m or N]: of all joints, or of each freedom."""
    viscous: Weights = 0.0
    """Friction for each unit of speed [N·m·s/rad or N·s/m]: of all, or of each."""
    smoothing: Positive = 0.02
    """Speed about which dry friction changes sign [rad/s or m/s]."""


class IntegralActionModel(Model):
    """A task's lasting error is worn away."""

    rate: Positive | None = None
    """Rate at which it dies [1/s]: Ki = rate · Kp."""
    ki: dict[str, Gain] = {}
    """Ki by task [1/s³]: a number, one for each row or a matrix."""
    tasks: list[str] | None = None
    """Names of the tasks that have it; all by default."""
    limit: Positive | None = None
    """Most that it asks for in a row [m/s² or rad/s²]; none: any."""


class StartUpRampModel(Model):
    """From rest to the law without a jump."""

    duration: Positive = 1.0
    """Until the law has all [s]."""
    natural_frequency: NonNegative = 0.0
    """Of the spring that holds until then [rad/s]; 0 is gravity compensation."""


class CompensationModel(Model):
    """Each is off unless it is given; ``null`` turns it off."""

    velocity_filter: VelocityFilterModel | None = None
    """A low-pass on the measured velocity."""
    predictor: PredictorModel | None = None
    """The law is shown the state in which its effort will act."""
    momentum_observer: MomentumObserverModel | None = None
    """What pushes beside the model is estimated and cancelled."""
    friction_feed_forward: Literal["urdf"] | FrictionFeedForwardModel | None = None
    """Friction is paid for before it is felt; ``urdf``: that of the robot's file."""
    integral_action: IntegralActionModel | None = None
    """A task's lasting error is worn away."""
    effort_rate: Positive | Annotated[list[Positive], Field(min_length=1)] | None = None
    """Greatest rate of what goes out [N·m/s or N/s], where no limits keep one."""
    start_up_ramp: StartUpRampModel | None = None
    """From rest to the law without a jump."""
