"""How `hsp live` communicates with a robot, and when it stops the robot."""

from typing import Annotated

from pydantic import Field

from hsp_control.config.models.base import Model, NonNegative, Positive


class StopModel(Model):
    """The safe stop: damping, then holding the position."""

    damping: Positive = 20.0
    """Rate at which the joint speeds decay while the robot brakes [1/s]."""
    natural_frequency: Positive = 10.0
    """Natural frequency of the position control that then holds the robot [rad/s]."""
    rest_speed: Positive = 0.01
    """Joint speed below which holding begins [rad/s or m/s]."""
    longest_damping: Positive = 2.0
    """Maximum duration of braking [s]."""
    hold: NonNegative = 0.2
    """Duration of holding before the loop ends [s]."""


class LiveModel(Model):
    """A live run; its period is `simulation.control_period`, or 1 ms."""

    compensates_gravity: bool = False
    """Whether the robot adds g(q) itself, as a Panda does; tau - g(q) is then sent."""
    effort_rate: Positive | list[Positive] | None = None
    """Maximum rate of the effort that is sent [N·m/s or N/s], one number or nv; a
    Panda's is 1000. Unlimited by default."""
    missing: Annotated[int, Field(ge=0)] = 20
    """Consecutive periods without a new state before the safe stop [periods]."""
    age: Positive = 0.02
    """Maximum age of a state [s]."""
    position_margin: NonNegative = 0.02
    """How far a measured joint position may exceed its limits [rad or m]."""
    velocity_margin: NonNegative = 0.1
    """How far a measured joint speed may exceed its limit, as a fraction of it [-]."""
    watchdog: Annotated[int, Field(ge=1)] = 20
    """Periods without a valid effort before the simulated robot stops itself
    [periods]."""
    stop: StopModel = StopModel()
    """The safe stop of the robot."""
