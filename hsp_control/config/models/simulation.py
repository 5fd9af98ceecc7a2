"""How a run is simulated."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Positive


class Dop853Model(Model):
    """Dormand and Prince's adaptive eighth-order method."""

    type: Literal["dop853"]
    rtol: Positive = 1e-9
    """Relative tolerance of a step."""
    atol: Positive = 1e-9
    """Absolute tolerance of a step."""


class Rk4Model(Model):
    """The classical fourth-order Runge-Kutta step."""

    type: Literal["rk4"]
    step: Positive = 1e-3
    """The physics step [s], an integer fraction of the control period."""


class SemiImplicitEulerModel(Model):
    """The semi-implicit Euler step."""

    type: Literal["semi_implicit_euler"]
    step: Positive = 1e-3
    """The physics step [s], an integer fraction of the control period."""


AnyIntegrator = Annotated[
    Dop853Model | Rk4Model | SemiImplicitEulerModel, Field(discriminator="type")
]


class SimulationModel(Model):
    """How long, how finely, and how the law is evaluated."""

    duration: Positive = 10.0
    """Length of the run [s]."""
    log_period: Positive = 0.01
    """Time between two rows of the log [s]."""
    control_period: Positive | None = None
    """How long an effort is held [s]; none: evaluated in the integrator's stages."""
    check_rate: bool = True
    """Whether a loop that is unstable at its control period is refused."""
    integrator: AnyIntegrator = Dop853Model(type="dop853")
    """How the robot moves on."""
