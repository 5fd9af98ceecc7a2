"""Beyond the reach, levels keep their order, and the arm rests."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from task_cases import FRAMES, load

from hsp_control import (
    CenterOfMass,
    Controller,
    FrameOrientation,
    FramePosition,
    Hold,
    JointCentering,
    JointPosture,
    simulate,
)
from hsp_control.tasks import Task
from hsp_control.trajectories import HoldOrientation

PERIOD = 0.005
SHORT = 0.02  # 1 to 8 mm; without the rule of `threshold_below` 160 to 510 mm


@pytest.mark.parametrize("postures", [False, True], ids=["two", "three"])
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_the_hand_is_as_near_as_it_can_be_whatever_is_asked_below(
    name: str, postures: bool
) -> None:
    """A position half a metre too far, above an orientation, above a posture."""
    robot, frame = load(name), FRAMES[name]
    q0 = robot.home()
    start = robot.state(0.0, q0, np.zeros(robot.nv))
    here, R = start.position(frame), start.frame(frame).rotation.copy()
    away = np.array([0.6, 0.5, 0.6]) / np.linalg.norm([0.6, 0.5, 0.6])
    turned = R @ pin.exp3(np.array([0.0, 0.8, 0.0]))

    def rests_at(*below: Task) -> tuple[float, float]:
        tasks = [FramePosition(frame, Hold(here + 1.5 * away)), *below]
        controller = Controller(robot, tasks, JointCentering())
        run = simulate(
            controller, q0, duration=5.0, control_period=PERIOD, log_period=PERIOD
        )
        changes = np.abs(np.diff(run.columns["tau"][-200:], axis=0)).max(axis=0)
        state = robot.state(0.0, run.columns["q"][-1], np.zeros(robot.nv))
        left = np.linalg.norm(here + 1.5 * away - state.position(frame))
        share = changes / robot.model.effortLimit * (1e-3 / PERIOD)
        return float(left), float(share.max())

    below: list[Task] = [
        FrameOrientation(frame, HoldOrientation(turned), priority=2, name="turn")
    ]
    if postures:
        below.append(JointPosture(q0, priority=3))
    alone, _ = rests_at()
    left, change = rests_at(*below)
    assert left - alone <= SHORT
    assert change <= 1e-3


def test_a_centre_of_mass_out_of_reach_rests() -> None:
    """On a fixed base it keeps no balance: its threshold follows as any other's."""
    robot, rng = load("panda"), np.random.default_rng(0)
    q0 = robot.home() + rng.uniform(-0.3, 0.3, robot.nv)
    here = robot.state(0.0, q0, np.zeros(robot.nv)).centroidal.position
    task = CenterOfMass(Hold(here + 0.5 * rng.normal(size=3)))
    how: Any = {"duration": 6.0, "control_period": 1e-3, "log_period": 1e-3}
    run = simulate(Controller(robot, [task], JointCentering()), q0, **how)
    changes = np.abs(np.diff(run.tau[-1000:], axis=0)).max(axis=0)
    assert (changes <= 1e-3 * robot.model.effortLimit).all()
