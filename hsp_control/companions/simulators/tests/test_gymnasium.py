"""A hand's targets as actions of Gymnasium's environments."""

import re
from math import nan
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml
from arm_environment import STRONGEST, ArmEnv
from gymnasium.utils.env_checker import check_env

from hsp_control.common.errors import (
    ControllerError,
    FrameNotFoundError,
    NonFiniteError,
    ShapeError,
    SimulationError,
)
from hsp_control.companions.simulators.gymnasium import HandTargets
from hsp_control.companions.simulators.hand_settings import read_settings

FREE = {"stream": None, "limits": "none", "compensation": {}}
"""The law alone."""


@pytest.fixture
def arm(tmp_path: Path) -> ArmEnv:
    return ArmEnv(tmp_path)


def pose_of(env: HandTargets) -> pin.SE3:
    """Return MuJoCo's pose of the site."""
    data = env.unwrapped.data
    mujoco.mj_forward(env.unwrapped.model, data)
    site = data.site("hand")
    return pin.SE3(site.xmat.reshape(3, 3).copy(), site.xpos.copy())


def action_of(pose: pin.SE3, finger: float = 0.0) -> Any:
    return np.concatenate([pose.translation, pin.log3(pose.rotation), [finger]])


def test_the_engine_accelerates_as_the_law_commands(arm: ArmEnv) -> None:
    """With the finger held, MuJoCo's acceleration is that of e'' + Kv e' + Kp e = 0."""
    env = HandTargets(arm, "hand", FREE, absolute=True)
    env.reset(seed=0)
    start = pose_of(env)
    # So near that the damping threshold stays below the smallest singular value.
    turned = start.rotation @ pin.exp3(np.array([0.003, 0.0, 0.006]))
    goal = pin.SE3(turned, start.translation + np.array([0.001, 0.002, -0.001]))
    for _ in range(5):
        env.step(action_of(goal))
    model, data = arm.model, arm.data
    tau = env.hand.effort(data.time, data.qpos[:7], data.qvel[:7], 0.001)
    assert np.abs(tau).max() < STRONGEST
    wanted = env.hand.compensated.output.acceleration
    # With the finger at its position in the arm's model; only the arm's joints
    # accelerate.
    data.ctrl[:7], data.qpos[7], data.qvel[7] = tau, 0.0, 0.0
    mujoco.mj_forward(model, data)
    M = np.zeros((8, 8))
    for column in range(8):
        mujoco.mj_mulM(model, data, M[column], np.eye(8)[column])
    given = np.linalg.solve(M[:7, :7], data.qfrc_actuator[:7] - data.qfrc_bias[:7])
    np.testing.assert_allclose(given, wanted, atol=1e-9 * np.abs(wanted).max())
    # And the rows of the position are a_x = -Kv x' + Kp (x_d - x), Kp = 12², Kv = 24.
    state = env.hand.robot.state(data.time, data.qpos[:7], data.qvel[:7])
    hand = state.frame("hand")
    error, rate = goal.translation - hand.position, hand.velocity[:3]
    rows = hand.jacobian[:3] @ wanted + hand.jacobian_dot[:3] @ state.v
    np.testing.assert_allclose(rows, 144.0 * error - 24.0 * rate, atol=1e-8)


def test_the_hand_arrives_and_the_finger_obeys(arm: ArmEnv) -> None:
    env = HandTargets(arm, "hand", absolute=True)
    assert env.action_space.shape == (7,)
    assert env.action_space.low[6] == 0.0
    assert env.action_space.high[6] == np.float32(0.05)
    env.reset(seed=0)
    start = pose_of(env)
    goal = pin.SE3(
        pin.exp3(np.array([0.0, 0.0, 0.3])) @ start.rotation,
        start.translation + np.array([0.0, 0.1, 0.05]),
    )
    for _ in range(100):
        _, reward, *_ = env.step(action_of(goal, 0.03))
    reached = pose_of(env)
    # The finger's weight is not at its position in the model: 0.05 kg of 10.5.
    assert np.linalg.norm(reached.translation - goal.translation) < 2e-3
    assert np.linalg.norm(pin.log3(goal.rotation.T @ reached.rotation)) < 4e-3
    assert arm.data.qpos[7] == pytest.approx(0.03, abs=5e-3)
    assert reward == pytest.approx(-(0.03**2))  # the arm's own action is zero


def test_a_loaded_state_begins_a_new_run(arm: ArmEnv) -> None:
    env = HandTargets(arm, "hand", absolute=False)
    env.reset(seed=0)
    for _ in range(5):
        env.step([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    arm.data.time = 5.0
    arm.set_state(np.array([0.5, 0.4, 0.1, 0.8, 0.2, 0.7, 0.0, 0.0]), np.zeros(8))
    begun = pose_of(env).translation
    env.step(np.zeros(7))
    moved = pose_of(env).translation - begun
    assert np.linalg.norm(moved) < 1e-4  # its target is the current pose


@pytest.mark.filterwarnings("ignore:.*WARN")  # warnings of Pusher itself
def test_it_is_an_environment_like_others() -> None:
    """Gymnasium's checker, and seven joints with 2 N·m each."""
    env = HandTargets(gymnasium.make("Pusher-v5"), "tips_arm", axes="xyz")
    check_env(env, skip_render_check=True)
    env.reset(seed=0)
    data = env.unwrapped.data
    before = data.body("tips_arm").xpos.copy()
    for _ in range(40):
        env.step([0.0, 1.0, 0.0])
        assert np.abs(data.ctrl).max() <= 2.0
    assert data.body("tips_arm").xpos[1] - before[1] > 0.2


def test_unsuitable_input_is_refused(tmp_path: Path, arm: ArmEnv) -> None:
    with pytest.raises(
        ControllerError, match=r"CartPoleEnv is none of .* has no model"
    ):
        HandTargets(gymnasium.make("CartPole-v1"), "hand")
    with pytest.raises(FrameNotFoundError, match="'hnad'; did you mean 'hand'"):
        HandTargets(arm, "hnad")
    with pytest.raises(SimulationError, match=r"no torque motors.*set disable_servos$"):
        HandTargets(ArmEnv(tmp_path, drive="position"), "hand")
    for scale in ((0.1,), 0.1, [[0.1, 0.2]], (0.1, nan), (0.1, -1.0), (0.1, "a")):
        with pytest.raises(ControllerError, match="scale: needs two numbers"):
            HandTargets(arm, "hand", scale=scale)  # type: ignore[arg-type]
    env = HandTargets(arm, "hand", absolute=True)
    env.reset()
    with pytest.raises(ShapeError, match=r"shape \(6,\); needs \(7,\)"):
        env.step(np.zeros(6))
    with pytest.raises(NonFiniteError, match="the target contains NaN"):
        env.step(np.full(7, np.nan))


def test_the_page_s_code_runs() -> None:
    text = (Path(__file__).parents[1] / "page.md").read_text(encoding="utf-8")
    _, snippet = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    space: dict[str, Any] = {}
    exec(compile(snippet, "simulators.md", "exec"), space)
    assert np.isfinite(space["observation"]).all()
    (settings,) = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    read_settings(yaml.safe_load(settings))


def test_a_change_turns_about_the_axes_of_the_world(arm: ArmEnv) -> None:
    env = HandTargets(arm, "hand", FREE, scale=(0.1, 1.0))
    env.reset(seed=0)
    here, turn = pose_of(env), np.array([0.3, -0.2, 0.5])
    goal = env._goal(np.concatenate([[0.5, 0.0, -1.0], turn]))
    np.testing.assert_allclose(goal.rotation, pin.exp3(turn) @ here.rotation, atol=1e-9)
    moved = goal.translation - here.translation
    np.testing.assert_allclose(moved, [0.05, 0.0, -0.1], atol=1e-9)


def test_forces_are_those_of_the_last_step(arm: ArmEnv) -> None:
    """As after MujocoEnv's own simulation: observations may contain them."""
    env = HandTargets(arm, "hand", FREE)
    env.reset(seed=0)
    env.step(env.action_space.low)
    found = arm.data.cfrc_int.copy()
    assert np.abs(found).max() > 0.0
    mujoco.mj_rnePostConstraint(arm.model, arm.data)
    np.testing.assert_array_equal(arm.data.cfrc_int, found)
