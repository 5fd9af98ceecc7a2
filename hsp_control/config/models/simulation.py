"""The simulation of a run."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Positive


class Dop853Model(Model):
    """Dormand and Prince's adaptive eighth-order method."""

    type: Literal["dop853"]
    rtol: Positive = 1e-9
    """Relative tolerance of a step [-]."""
    atol: Positive = 1e-9
    """Absolute tolerance of a step [rad, m, rad/s or m/s]."""


class Rk4Model(Model):
    """The classical fourth-order Runge-Kutta step."""

    type: Literal["rk4"]
    step: Positive = 1e-3
    """Integration step [s]; an integer fraction of the control period."""


class SemiImplicitEulerModel(Model):
    """The semi-implicit Euler step."""

    type: Literal["semi_implicit_euler"]
    step: Positive = 1e-3
    """Integration step [s]; an integer fraction of the control period."""


AnyIntegrator = Annotated[
    Dop853Model | Rk4Model | SemiImplicitEulerModel, Field(discriminator="type")
]


class SimulationModel(Model):
    """Duration, periods and integrator of the simulation."""

    duration: Positive = 10.0
    """Length of the run [s]."""
    log_period: Positive = 0.01
    """Time between two rows of the log [s]."""
    control_period: Positive | None = None
    """Time for which an effort is held [s]; without it, the law is evaluated in every
    stage of the integrator."""
    check_rate: bool = True
    """Whether the loop is checked for stability at its control period: an unstable loop
    is an error, a doubtful one a warning. Without a control period nothing is done."""
    integrator: AnyIntegrator = Dop853Model(type="dop853")
    """The integrator of the robot's motion."""
