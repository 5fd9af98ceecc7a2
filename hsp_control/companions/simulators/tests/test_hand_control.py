"""A hand with one target per step, without a simulator."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import hsp_control as hsp
from hsp_control.common.errors import (
    ConfigError,
    FieldError,
    FrameNotFoundError,
    HspControlError,
    ModelError,
    NonFiniteError,
    SceneError,
)
from hsp_control.companions.simulators.hand_control import HandControl
from hsp_control.companions.simulators.hand_settings import read_settings
from hsp_control.companions.simulators.mujoco_arm import arm_of

GAINS = hsp.Gains(kp=150.0, kv=24.0)
PERIOD = 0.002
LAW = {"stream": None, "limits": "none", "compensation": {}}


@pytest.fixture(scope="module")
def robot() -> hsp.Robot:
    return hsp.Robot.load("panda")


def moving(robot: hsp.Robot) -> tuple[Any, Any]:
    """Return a state in motion."""
    rng = np.random.default_rng(1)
    return robot.home() + rng.normal(scale=0.1, size=7), rng.normal(size=7)


@pytest.mark.parametrize("axes", [None, "xyz", "yz"])
def test_between_jumps_the_error_equation_holds(
    robot: hsp.Robot, axes: str | None
) -> None:
    hand = HandControl(robot, "panda_tcp", LAW, gains=GAINS, axes=axes)
    q, v = moving(robot)
    v *= 0.01  # and near: then the threshold is smallest, and the law exact
    hand.begin(0.0, q, v)
    goal = hand.pose(q)
    goal.translation = goal.translation + np.array([2e-3, -1e-3, 4e-4])
    hand.aim(goal, 0.0)
    hand.effort(0.0, q, v, PERIOD)
    state = robot.state(0.0, q, v)
    frame = state.frame("panda_tcp")
    a = hand.compensated.output.acceleration
    linear = frame.jacobian[:3] @ a + frame.jacobian_dot[:3] @ v
    wanted = 150.0 * (goal.translation - frame.position) - 24.0 * frame.velocity[:3]
    tracked = ["xyz".index(axis) for axis in axes or "xyz"]
    np.testing.assert_allclose(linear[tracked], wanted[tracked], atol=1e-9)


def test_by_default_the_posture_obeys_the_simulator_s_equation(
    robot: hsp.Robot,
) -> None:
    """To first order P a = P(-2√10 v - 10 (q - q0)), as in robosuite's null space."""
    hand = HandControl(robot, "panda_tcp", LAW, gains=GAINS)
    start, small = robot.home(), 1e-5
    hand.begin(0.0, start, np.zeros(7))
    jacobian = robot.state(0.0, start, np.zeros(7)).frame("panda_tcp").jacobian
    free = np.linalg.svd(jacobian)[2][-1]  # the arm's self-motion
    q, v = start + small * free, 0.5 * small * free
    hand.effort(0.0, q, v, PERIOD)
    wanted = -2.0 * np.sqrt(10.0) * 0.5 * small - 10.0 * small
    assert free @ hand.compensated.output.acceleration == pytest.approx(
        wanted, rel=1e-3
    )


@pytest.mark.parametrize("axes", ["", "xw", "xx"])
def test_axes_that_are_none(robot: hsp.Robot, axes: str) -> None:
    with pytest.raises(HspControlError, match="axes"):
        HandControl(robot, "panda_tcp", gains=GAINS, axes=axes)


def test_efforts_are_clipped_and_the_observer_uses_the_clipped_ones(
    robot: hsp.Robot,
) -> None:
    observer = {"momentum_observer": {"bandwidth": 50, "cancel": True}}
    settings = {"stream": None, "limits": "none", "compensation": observer}
    hard = hsp.Gains(natural_frequency=150.0)
    hand = HandControl(robot, "panda_tcp", settings, gains=hard)
    q, rest = robot.home(), np.zeros(7)
    hand.begin(0.0, q, rest)
    goal = hand.pose(q)
    goal.translation = goal.translation + np.array([0.0, 2.0, 0.0])
    hand.aim(goal, 0.0)
    effort = hand.effort(0.0, q, rest, PERIOD)
    strongest = robot.model.upperEffortLimit
    assert (np.abs(effort) <= strongest).all()
    assert (np.abs(effort) == strongest).any()
    # The effect of a clipped effort is no disturbance.
    state = robot.state(0.0, q, rest)
    acceleration = np.linalg.solve(state.mass_matrix, effort - state.nonlinear_effects)
    hand.effort(PERIOD, q, PERIOD * acceleration, PERIOD)
    channels = hand.compensated.log_channels()
    assert np.abs(channels["observer.disturbance"].value).max() < 0.5


def test_errors_are_named_with_their_place(robot: hsp.Robot, tmp_path: Path) -> None:
    file = tmp_path / "hand.yaml"
    file.write_text("limits: none\nnull_space:\n  gian: 3\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"hand\.yaml:3: null_space\.gian"):
        read_settings(file)
    file.write_text(
        "null_space:\n  fields:\n    - {type: target_posture, weights: [1, 2]}\n",
        encoding="utf-8",
    )
    with pytest.raises(FieldError, match=r"hand\.yaml:3: null_space\.fields\.0"):
        HandControl(robot, "panda_tcp", file, gains=GAINS)
    file.write_text(
        "scene:\n  obstacles:\n    wall:\n"
        "      center: {type: hold, point: [0, 0, 0]}\n"
        "      shape: {type: mesh, file: wall.stl}\n",
        encoding="utf-8",
    )
    with pytest.raises(SceneError, match=rf"hand\.yaml:5: .*{tmp_path}/wall\.stl"):
        read_settings(file)
    with pytest.raises(ConfigError, match="remove source"):
        read_settings({"stream": {"source": "udp://127.0.0.1:5005"}})
    hand = HandControl(robot, "panda_tcp", gains=GAINS)
    with pytest.raises(NonFiniteError, match="the target contains NaN"):
        hand.aim(pin.SE3(np.eye(3), np.full(3, np.nan)), 0.0)


SCENE = """
<mujoco><worldbody>
  <body name="cart"><joint name="rail" type="slide" axis="1 0 0"/>
    <geom size="0.1" mass="3"/>
    <body name="arm" pos="0 0 0.2"><joint name="shoulder" axis="0 1 0"/>
      <geom size="0.05" mass="1"/>
      <body name="hand" pos="0.4 0 0"><joint name="elbow" axis="0 1 0"/>
        <geom size="0.04" mass="0.5"/><site name="tip" pos="0.3 0 0"/>
        <body name="finger"><joint name="finger" type="slide"/>
          <geom size="0.01" mass="0.1"/></body>
      </body>
    </body>
  </body>
  <body name="table"><geom size="0.1"/></body>
</worldbody></mujoco>"""


def test_the_arm_is_the_chain_that_carries_the_hand() -> None:
    model = mujoco.MjModel.from_xml_string(SCENE)
    for frame in ("tip", "hand"):
        arm = arm_of(model, np.zeros(4), frame)
        assert arm.joint_names == ("rail", "shoulder", "elbow")  # no finger
    with pytest.raises(ModelError, match=r"also moved by rail.*must stand still"):
        arm_of(model, np.zeros(4), "tip", ["shoulder", "elbow"])
    with pytest.raises(ModelError, match="no joint moves 'table'"):
        arm_of(model, np.zeros(4), "table")
    with pytest.raises(FrameNotFoundError, match="did you mean 'tip'"):
        arm_of(model, np.zeros(4), "tipp")
