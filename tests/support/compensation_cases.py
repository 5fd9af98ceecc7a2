"""A circling Panda, and one compensator of each kind."""

from typing import Any

import numpy as np

import hsp_control as hsp
from hsp_control import Circle, Controller, FramePosition, Gains, Robot
from hsp_control.null_space.fields import TargetPosture

H = 1e-3
PANDA = Robot.load("panda")
Q0 = PANDA.home()


def circle(
    robot: Robot = PANDA, frequency: float = 20.0, away: float = 0.05
) -> FramePosition:
    """Return a circle of 5 cm that begins at a distance ``away`` [m] from the hand."""
    start = robot.state(0.0, robot.home(), np.zeros(robot.nv)).position("panda_tcp")
    center = start + np.array([away - 0.05, 0.0, 0.0])
    path = Circle(0.05, 2.0, center, axes=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    gains = Gains(natural_frequency=frequency)
    return FramePosition(
        "panda_tcp", path, gains=gains, largest_error="none", name="hand"
    )


def controller(robot: Robot = PANDA, away: float = 0.05, **options: Any) -> Controller:
    return Controller(
        robot,
        [circle(robot, away=away)],
        2.0 * TargetPosture(robot.home()),
        **({"limits": None} | options),
    )


EVERYTHING: dict[str, Any] = {
    "velocity_filter": hsp.compensation.VelocityFilter(100.0),
    "predictor": hsp.compensation.Predictor(1),
    "momentum_observer": hsp.compensation.MomentumObserver(50.0, clip=20.0),
    "friction_feed_forward": hsp.compensation.FrictionFeedForward(0.1, 0.1),
    "integral_action": hsp.compensation.IntegralAction(5.0),
    "start_up_ramp": hsp.compensation.StartUpRamp(0.1),
}
ALL = hsp.compensation.Compensation(**EVERYTHING)
