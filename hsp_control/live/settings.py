"""Settings of a live run: the robot's interface, the tolerances, the safe stop."""

from collections.abc import Sequence
from dataclasses import KW_ONLY

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LiveError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import RobotLimits
from hsp_control.constraints.limits.joint_numbers import Positives, by_dof, own_maximum
from hsp_control.control.stop import LARGEST, StopGains
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    Count,
    Flag,
    NonNegative,
    Positive,
    PositiveCount,
)
from hsp_control.robot import Robot


class StopSettings(Part, error=LiveError):
    """The safe stop: damping, then holding the position."""

    _: KW_ONLY
    damping: Positive = 20.0
    """k of the braking effort -k M(q) v [1/s]: joint speeds decay like exp(-k t)."""
    natural_frequency: Positive = 10.0
    """Natural frequency of the position control that then holds the robot [rad/s]; it
    is critically damped."""
    rest_speed: Positive = 0.01
    """Joint speed below which holding begins [rad/s or m/s]."""
    longest_damping: Positive = 0.5
    """Maximum duration of braking [s], for measured speeds that noise keeps above
    ``rest_speed``."""
    hold: NonNegative = 0.2
    """Duration of holding before the loop ends [s]."""
    coming_to_rest: NonNegative = 4.0
    """Maximum duration of a plan's last steps, after which it stands [s]; they precede
    the safe stop of a run that ends without a fault."""
    standstill: Positive = 0.1
    """Maximum joint speed at the end of a completed run [rad/s or m/s]; above
    ``rest_speed``, because of noise."""

    @property
    def gains(self) -> StopGains:
        """The gains of braking and of holding."""
        return StopGains(*(getattr(self, name) for name in StopGains._fields))

    def check_period(self, period: float) -> None:
        """Check that the sampled safe stop is stable at this period [s]."""
        for name, upper in LARGEST.items():
            value = getattr(self, name)
            if value * period > upper:
                raise LiveError(
                    f"the safe stop's {name} is {value:g}; at a period of {period:g} s "
                    f"it may be {upper / period:g} at most"
                )


class LiveSettings(Part, error=LiveError):
    """How a loop communicates with a robot, and when it stops the robot.

    The loop and a `SimulatedRobot` have the same settings: ``watchdog`` is the robot's,
    the tolerances are the loop's, and both have the interface and the safe stop.
    """

    _: KW_ONLY
    compensates_gravity: Flag = False
    """Whether the robot adds g(q) itself, as a Panda (libfranka) and an iiwa (FRI) do;
    tau - g(q) is then sent [-]."""
    effort_rate: Positives | None = None
    """Maximum rate of the *sent* effort [N·m/s or N/s], one number or nv; a
    Panda rejects more than 1000. Unlimited by default."""
    effort: Positives | None = None
    """Maximum effort of the motors, gravity included [N·m or N], one number or nv; by
    default that of the controller's limits, or the URDF's without limits."""
    missing: Count = 20
    """Consecutive periods without a new state before the safe stop [periods]. The last
    effort is held for the first 10 ms, or two of them; then the robot brakes, and the
    law goes on with the next state."""
    age: Positive = 0.02
    """Maximum age of a state [s]."""
    prediction_time: NonNegative = 0.2
    """Time for which the safe stop uses the model's prediction without a measurement
    [s]. Then the loop falls silent (stops sending efforts), and the robot's own
    watchdog must stop it."""
    position_margin: NonNegative = 0.02
    """Tolerance of a measured joint position beyond its limits [rad or m]."""
    velocity_margin: NonNegative = 0.1
    """Tolerance of a measured joint speed beyond its limit, as a fraction of it [-]."""
    velocity_error: Positive = 0.3
    """Tolerance of a measured joint velocity relative to the slopes of its positions in
    the last 50 ms [rad/s or m/s]: six times its noise."""
    friction: NonNegative = 0.1
    """Largest friction that may hold a joint at rest, relative to its effort limit. A
    joint whose readings do not change by a bit under more than that has a dead sensor
    [-]."""
    contact: NonNegative = 0.3
    """Largest effort that contacts, loads and persons may exert on a joint, relative to
    its effort limit. A joint that is pushed by more has hit something hard, or its
    sensors are wrong [-]."""
    start_timeout: Positive = 10.0
    """Maximum time to wait for the first state [s]."""
    watchdog: PositiveCount = 20
    """Periods without a valid effort before the simulated robot stops itself, the same
    as a Panda's [periods]."""
    stop: StopSettings = StopSettings()
    """The safe stop of the loop and of the simulated robot."""

    def rate_limits(self, robot: Robot) -> Array:
        """Return the limits of the effort rates, shape (nv,), inf where unlimited."""
        with within("effort_rate"):
            return by_dof(self.effort_rate, robot.nv, error=LiveError)

    def effort_limits(self, robot: Robot, limits: RobotLimits | None = None) -> Array:
        """Return the limits of the efforts, shape (nv,), inf where unlimited.

        They are 0 for dofs without a motor: those of a floating base.
        """
        if self.effort is None and limits is not None:
            own = np.array(limits.effort)
        elif self.effort is not None:
            with within("effort"):
                own = by_dof(self.effort, robot.nv, error=LiveError)
        else:
            own = own_maximum(robot.model.effortLimit, robot)
        own[list(robot.unactuated)] = 0.0  # dofs without a motor
        return own


def check_held(
    robot: Robot, contacts: Sequence[Contact], settings: LiveSettings
) -> None:
    """Check that the robot can be held where it is: by its base, or on its contacts."""
    if not robot.unactuated:
        return
    if not contacts:
        raise LiveError(
            f"{robot.name} has a floating base and no contacts: a live loop could not "
            "hold it; declare contacts"
        )
    if settings.compensates_gravity:
        with within("compensates_gravity"):
            raise LiveError(
                f"{robot.name} has a floating base: how its joints carry its weight "
                "depends on its contacts, which it does not know; must be false"
            )
