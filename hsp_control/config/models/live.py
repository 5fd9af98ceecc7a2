"""How `hsp live` speaks with a robot, and when it stops it."""

from typing import Annotated

from pydantic import Field

from hsp_control.config.models.base import Model, NonNegative, Positive


class StopModel(Model):
    """The safe stop: damping, then hold."""

    damping: Positive = 20.0
    """Rate at which speeds fall while it brakes [1/s]."""
    natural_frequency: Positive = 10.0
    """Of the position that is then held [rad/s]."""
    rest_speed: Positive = 0.01
    """Speed below which it holds [rad/s or m/s]."""
    longest_damping: Positive = 2.0
    """How long it brakes at most [s]."""
    hold: NonNegative = 0.2
    """How long it holds before the loop ends [s]."""


class LiveModel(Model):
    """A live run; the period is the simulation's control period, or 1 ms."""

    compensates_gravity: bool = False
    """Whether the robot adds g(q) itself and is sent tau - g(q), as a Panda is."""
    effort_rate: Positive | list[Positive] | None = None
    """Greatest rate of what is sent [N·m/s or N/s]; a Panda's is 1000."""
    missing: Annotated[int, Field(ge=0)] = 20
    """Periods in a row without a new state before the safe stop."""
    age: Positive = 0.02
    """Greatest age of a state [s]."""
    position_margin: NonNegative = 0.02
    """How far beyond its limits a joint may be measured [rad or m]."""
    velocity_margin: NonNegative = 0.1
    """By what part a joint may be measured faster than its limit."""
    watchdog: Annotated[int, Field(ge=1)] = 20
    """Periods without a valid effort before the simulated robot stops itself."""
    stop: StopModel = StopModel()
    """The safe stop."""
