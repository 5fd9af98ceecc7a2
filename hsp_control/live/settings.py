"""Settings of a live loop: the robot's interface, tolerances, the safe stop."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LiveError
from hsp_control.robot import Robot


@dataclass(frozen=True)
class EffortInterface:
    """Which efforts a robot accepts.

    Attributes:
        compensates_gravity: Whether the robot adds g(q) itself, so that tau - g(q) is
            sent: a Panda (libfranka) and an iiwa (FRI) do.
        effort_rate: Upper limit of the rate of the *sent* value, one number or one per
            degree of freedom [N·m/s or N/s]; None: unlimited. A Panda rejects more
            than 1000.
        effort: Upper limit of the motors' efforts, gravity included, one number or one
            per degree of freedom [N·m or N]; None: the URDF's.
    """

    compensates_gravity: bool = False
    effort_rate: Any | None = None
    effort: Any | None = None

    def rate_limits(self, robot: Robot) -> Array:
        """Return the limits of the effort rates, shape (nv,), inf where unlimited.

        Raises:
            LiveError: If they are not one or nv positive numbers.
        """
        return _per_dof(robot, self.effort_rate, "effort_rate")

    def effort_limits(self, robot: Robot) -> Array:
        """Return the limits of the efforts, shape (nv,), inf where unlimited.

        Raises:
            LiveError: If they are not one or nv positive numbers.
        """
        if self.effort is not None:
            return _per_dof(robot, self.effort, "effort")
        own = np.array(robot.model.effortLimit, dtype=float)
        # URDFs contain 0, or the largest float, where there is no limit.
        own[(own <= 0.0) | (own >= np.finfo(np.float32).max)] = np.inf
        return own


@dataclass(frozen=True)
class Tolerance:
    """Faults that a loop tolerates before it starts the safe stop.

    Attributes:
        missing: Periods in a row without a new state; the last effort is held.
        age: Largest state age [s].
        prediction_time: How long the safe stop uses the model's prediction without a
            measurement [s]. Then the loop falls silent (stops sending efforts), and
            the robot's own watchdog must stop it.
        position_margin: How far a measured position may exceed its limits [rad or m].
        velocity_margin: How far a measured speed may exceed its limit, as a fraction
            of the limit.
        start_timeout: Longest time to wait for the first state [s].
    """

    missing: int = 20
    age: float = 0.02
    prediction_time: float = 0.2
    position_margin: float = 0.02
    velocity_margin: float = 0.1
    start_timeout: float = 10.0

    def __post_init__(self) -> None:
        """Check the ranges of all values.

        Raises:
            LiveError: If a value is out of range.
        """
        if not isinstance(self.missing, int) or self.missing < 0:
            raise LiveError(f"missing is {self.missing!r}; needs a number of periods")
        for name in ("age", "start_timeout"):
            if not getattr(self, name) > 0.0:
                raise LiveError(f"{name} is {getattr(self, name)} s; must be positive")
        for name in ("prediction_time", "position_margin", "velocity_margin"):
            if not getattr(self, name) >= 0.0:
                raise LiveError(f"{name} is {getattr(self, name)}; must be at least 0")


@dataclass(frozen=True)
class StopSettings:
    """How the safe stop brakes, and how it then holds.

    Attributes:
        damping: k of the braking effort -k M(q) v [1/s]: speeds fall like exp(-k t).
        natural_frequency: Of the position hold [rad/s], critically damped.
        rest_speed: The hold starts when all joints are slower [rad/s or m/s].
        longest_damping: Longest time of damping [s], if noise keeps the measured speed
            above ``rest_speed``.
        hold: Time of the hold before the loop ends [s].
    """

    damping: float = 20.0
    natural_frequency: float = 10.0
    rest_speed: float = 0.01
    longest_damping: float = 2.0
    hold: float = 0.2

    def __post_init__(self) -> None:
        """Check the ranges of all values.

        Raises:
            LiveError: If a value is out of range.
        """
        for name in ("damping", "natural_frequency", "rest_speed", "longest_damping"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise LiveError(f"{name} is {value}; must be positive and finite")
        if not 0.0 <= self.hold < np.inf:
            raise LiveError(f"hold is {self.hold} s; must be at least 0 and finite")

    def check_period(self, period: float) -> None:
        """Check that the sampled safe stop is stable at this period [s].

        With one period of delay a rate k is stable for k h < 1 and a natural frequency
        ω for ω h < 0.43 (docs/robustness.md); half of it is the margin for model
        errors.

        Raises:
            LiveError: If a gain is too large.
        """
        for name, upper in (("damping", 0.5), ("natural_frequency", 0.2)):
            value = getattr(self, name)
            if value * period > upper:
                raise LiveError(
                    f"the safe stop's {name} is {value:g}; at a period of {period:g} s "
                    f"it may be {upper / period:g} at most"
                )


def check_fixed(robot: Robot) -> None:
    """Check that the robot has a fixed base.

    Raises:
        LiveError: If it has a floating base.
    """
    if robot.unactuated:
        raise LiveError(
            f"{robot.name} has a floating base; a live loop needs a fixed base: "
            "damping and holding joints does not keep a robot from falling"
        )


def _per_dof(robot: Robot, value: Any, what: str) -> Array:
    """Return limits as an array, shape (nv,), from None, one number or nv numbers."""
    if value is None:
        return np.full(robot.nv, np.inf)
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise LiveError(f"{what} is {value!r}; needs numbers") from None
    if array.ndim == 0:
        array = np.full(robot.nv, float(array))
    if array.shape != (robot.nv,):
        raise LiveError(
            f"{what} has shape {array.shape}; needs one number or {robot.nv}"
        )
    if not (array > 0.0).all():
        raise LiveError(f"{what} is {array.tolist()}; must be positive")
    return array
