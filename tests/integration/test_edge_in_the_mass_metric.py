"""Out of reach in the metric M(q): no oscillation at a limit.

There a field demands several times the wrists' limits. When a violation by a tenth
reduced the demand to a quarter, the arms oscillated at 4 to 8 Hz.
"""

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array

BEGIN, END = 0.5, 5.0  # [s]
STILL = (
    1e-3  # change of an effort in 1 ms, as a part of its limit; it was 1.5e-3 and 0.011
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "period", "q0", "goal"),
    [
        (
            "panda",
            0.005,
            [-0.085, -0.959, -0.084, -2.587, 0.186, 1.746, 0.924],
            [-0.4007, 1.0571, -0.1834],
        ),
        (
            "xarm7",
            0.01,
            [-0.255, -0.361, -0.011, 1.233, 0.202, 1.314, -0.07],
            [-0.6081, -0.5279, 0.1203],
        ),
    ],
)
def test_a_hand_above_an_orientation_rests(
    name: str, period: float, q0: Array, goal: Array
) -> None:
    """0.3 m and 5 mm out of reach, with the default field."""
    robot = hsp.Robot.load(name)
    frame = robot.end_effector
    hand = hsp.FramePosition(frame, name="hand")
    tasks: list[hsp.Task] = [hand, hsp.FrameOrientation(frame, priority=2)]
    metric = hsp.metrics.MassMatrixMetric()
    made = hsp.Controller(
        robot, tasks, hsp.JointCentering(), metric=metric, start=np.array(q0)
    )
    made.at(BEGIN).ramp(0.0).reference("hand", hsp.Hold(goal))
    run = hsp.simulate(
        made, np.array(q0), duration=END, control_period=period, log_period=period
    )
    changes = np.abs(np.diff(run.tau, axis=0)) / robot.model.effortLimit
    late = changes[-round(0.5 / period) :] * (1e-3 / period)
    assert late.max() <= STILL


@pytest.mark.slow
def test_a_task_that_demands_a_joint_beyond_its_limit_rests() -> None:
    """A centre of mass out of reach keeps joint 4 of an iiwa at its limit.

    It demands 11 rad/s² there, which the null space provided with the wrist. That
    direction rotated within 4 mrad, and the arm oscillated at 16 Hz.
    """
    robot, period = hsp.Robot.load("iiwa14"), 0.002
    q0 = np.array([0.182, 0.407, 0.266, -1.8, 0.084, 0.928, 0.108])
    made = hsp.Controller(
        robot,
        [hsp.CenterOfMass(name="hand")],
        hsp.JointCentering(),
        metric=hsp.metrics.MassMatrixMetric(),
        start=q0,
    )
    goal = hsp.Hold([0.1322, 0.1198, 0.3274])
    made.at(BEGIN).ramp(0.0).reference("hand", goal)
    run = hsp.simulate(
        made,
        q0,
        duration=3.0,
        control_period=period,
        log_period=period,
        check_rate=False,
    )
    changes = np.abs(np.diff(run.tau, axis=0)) / robot.model.effortLimit
    late = changes[-round(0.5 / period) :] * (1e-3 / period)
    lower, upper = robot.position_limits()
    assert min((upper - run.q[-1]).min(), (run.q[-1] - lower).min()) < 0.01
    assert late.max() <= STILL  # it was 0.0025
