"""What can be set of a live loop: the robot's interface, tolerances, the safe stop."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LiveError
from hsp_control.robot import Robot


@dataclass(frozen=True)
class EffortInterface:
    """How a robot wants its efforts.

    Attributes:
        compensates_gravity: Whether it adds g(q) itself, and is sent tau - g(q): a
            Panda (libfranka) and an iiwa (FRI) do.
        effort_rate: The greatest rate at which what is *sent* may change, one number or
            one per freedom [N·m/s or N/s]; None: any. A Panda refuses more than 1000.
        effort: The greatest effort of the motors, gravity's share included [N·m or N];
            None: the URDF's.
    """

    compensates_gravity: bool = False
    effort_rate: Any | None = None
    effort: Any | None = None

    def rate_limits(self, robot: Robot) -> Array:
        """Return the greatest rates, shape (nv,), inf where unlimited.

        Raises:
            LiveError: If they are not positive numbers, one or nv.
        """
        return _greatest(robot, self.effort_rate, "effort_rate")

    def effort_limits(self, robot: Robot) -> Array:
        """Return the greatest efforts, shape (nv,), inf where unlimited.

        Raises:
            LiveError: If they are not positive numbers, one or nv.
        """
        if self.effort is not None:
            return _greatest(robot, self.effort, "effort")
        own = np.array(robot.model.effortLimit, dtype=float)
        # URDFs write 0, or the largest number there is, where they know no limit.
        own[(own <= 0.0) | (own >= np.finfo(np.float32).max)] = np.inf
        return own


@dataclass(frozen=True)
class Tolerance:
    """What a loop puts up with before it stops the robot safely.

    Attributes:
        missing: Periods in a row without a new state, in which the last effort is held.
        age: Greatest age of a state [s].
        blind: How long a safe stop trusts the model where there is no state [s]; then
            the loop falls silent, and the robot's own watchdog has it.
        position_margin: How far beyond its limits a joint may be measured [rad or m].
        velocity_margin: By what part a joint may be measured faster than its limit.
        start: How long the first state may take [s].
    """

    missing: int = 20
    age: float = 0.02
    blind: float = 0.2
    position_margin: float = 0.02
    velocity_margin: float = 0.1
    start: float = 10.0

    def __post_init__(self) -> None:
        """Refuse what is none.

        Raises:
            LiveError: Names the value.
        """
        if not isinstance(self.missing, int) or self.missing < 0:
            raise LiveError(f"missing is {self.missing!r}; needs a number of periods")
        for name in ("age", "start"):
            if not getattr(self, name) > 0.0:
                raise LiveError(f"{name} is {getattr(self, name)} s; must be positive")
        for name in ("blind", "position_margin", "velocity_margin"):
            if not getattr(self, name) >= 0.0:
                raise LiveError(f"{name} is {getattr(self, name)}; must be at least 0")


@dataclass(frozen=True)
class StopSettings:
    """How a safe stop brakes, and how it then holds.

    Attributes:
        damping: k of the braking effort -k M(q) v [1/s]: speeds fall like exp(-k t).
        natural_frequency: Of the position that is held [rad/s], critically damped.
        rest_speed: Speed of every joint below which it is held [rad/s or m/s].
        longest_damping: How long it brakes at most, if noise hides the rest [s].
        hold: How long it is held before the loop ends [s].
    """

    damping: float = 20.0
    natural_frequency: float = 10.0
    rest_speed: float = 0.01
    longest_damping: float = 2.0
    hold: float = 0.2

    def __post_init__(self) -> None:
        """Refuse what is none.

        Raises:
            LiveError: Names the value.
        """
        for name in ("damping", "natural_frequency", "rest_speed", "longest_damping"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise LiveError(f"{name} is {value}; must be positive and finite")
        if not 0.0 <= self.hold < np.inf:
            raise LiveError(f"hold is {self.hold} s; must be at least 0 and finite")

    def check_period(self, period: float) -> None:
        """Refuse gains that a loop of this period [s] could not hold stable.

        With one period of delay a rate k is stable for k h < 1 and a natural frequency
        ω for ω h < 0.43 (law.md §7); half of it is left for models that are wrong.

        Raises:
            LiveError: Names the gain and its largest value.
        """
        for name, most in (("damping", 0.5), ("natural_frequency", 0.2)):
            value = getattr(self, name)
            if value * period > most:
                raise LiveError(
                    f"the safe stop's {name} is {value:g}; at a period of {period:g} s "
                    f"it may be {most / period:g} at most"
                )


def check_fixed(robot: Robot) -> None:
    """Refuse a floating base.

    Raises:
        LiveError: If the robot has one.
    """
    if robot.unactuated:
        raise LiveError(
            f"{robot.name} has a floating base; a live loop is for fixed ones: damping "
            "and holding its joints does not keep a robot from falling"
        )


def _greatest(robot: Robot, value: Any, what: str) -> Array:
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
        raise LiveError(f"{what} is {array.tolist()}; must be greater than 0")
    return array
