"""HSP_POSE in robosuite's own environments: `make sims` runs this.

robosuite needs another MuJoCo than the other tests, and its own environment.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

robosuite = pytest.importorskip("robosuite")

from hsp_control.common.errors import (  # noqa: E402
    ConfigError,
    ControllerError,
    GainError,
)
from hsp_control.companions.simulators.robosuite import HspPose  # noqa: E402

LAW = {"stream": None, "limits": "none", "compensation": {}}
ARMS = ["Panda", "Sawyer", "IIWA", "Jaco", "Kinova3", "UR5e", "XArm7"]


@contextmanager
def made(
    robot: str = "Panda", kind: str = "HSP_POSE", frequency: int = 20, **arm: Any
) -> Iterator[Any]:
    """Make Lift with one arm, with the given settings changed."""
    config = robosuite.load_composite_controller_config(robot=robot)
    config["type"] = "HSP"
    config["body_parts"]["right"] |= {"type": kind, **arm}
    env = robosuite.make(
        "Lift",
        robots=robot,
        controller_configs=config,
        control_freq=frequency,
        initialization_noise=None,
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        ignore_done=True,
        seed=0,
    )
    env.reset()
    yield env
    env.close()


def arm_of(env: Any) -> Any:
    return env.robots[0].part_controllers["right"]


def goal_of(env: Any, way: Any, turn: Any) -> pin.SE3:
    """Return a pose relative to the hand's."""
    arm = arm_of(env)
    rotation = pin.Quaternion(arm.ref_ori_mat).normalized().toRotationMatrix()
    return pin.SE3(pin.exp3(np.array(turn)) @ rotation, arm.ref_pos + np.array(way))


def action_of(env: Any, pose: pin.SE3) -> Any:
    """Return an absolute action, with zeros for the gripper."""
    target = [*pose.translation, *pin.log3(pose.rotation)]
    return np.array(target + [0.0] * (env.action_dim - 6))


def error_of(env: Any, pose: pin.SE3) -> tuple[float, float]:
    """Return the errors of position [m] and orientation [rad]."""
    arm = arm_of(env)
    arm.update(force=True)
    return (
        float(np.linalg.norm(arm.ref_pos - pose.translation)),
        float(np.linalg.norm(pin.log3(pose.rotation @ arm.ref_ori_mat.T))),
    )


@pytest.mark.parametrize("name", ARMS)
def test_every_arm_reaches_its_goal(name: str) -> None:
    absolute = {"input_type": "absolute", "input_ref_frame": "world"}
    settings = {"stream": {"delay": 0.3}}
    with made(name, hsp=settings, **absolute) as env:
        pose = goal_of(env, [0.02, 0.03, 0.02], [0.0, 0.0, 0.1])
        for _ in range(40):
            env.step(action_of(env, pose))
        position, orientation = error_of(env, pose)
        assert position < 5e-3  # of 41 mm; air and gripper resist
        assert orientation < 2e-2


def test_the_model_is_the_simulation_s() -> None:
    """Without the effects that it omits, MuJoCo's acceleration is the law's: 7 of 9
    joints."""
    with made(hsp=LAW) as env:
        arm, model, data = arm_of(env), env.sim.model._model, env.sim.data._data
        for _ in range(5):
            env.step(np.array([0.3, -0.5, 0.2, 0.1, 0.2, -0.1, 0.0]))
        data.qvel[7:] = 0.0
        data.qpos[7:9] = [
            arm.hand.robot.source.locked[f"gripper0_right_finger_joint{k}"]
            for k in (1, 2)
        ]
        mujoco.mj_forward(model, data)
        tau = arm.hand.compensated.effort(data.time, *arm._state, 0.002)
        wanted = arm.hand.compensated.output.acceleration
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, M, data.qM)
        given = np.linalg.solve(M[:7, :7], tau - data.qfrc_bias[:7])
        np.testing.assert_allclose(given, wanted, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("frame", ["base", "world"])
def test_an_action_has_the_meaning_of_osc_pose(frame: str) -> None:
    """Both have the same goals and, with steps of the goal, similar motions.

    As long as the wrist's motors are within their limits: OSC_POSE neglects the
    coupling of rotation and translation, and so demands less.
    """
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (10, 7))
    actions[:, 3:6] *= 0.1
    goals, ends = [], []
    for kind in ("OSC_POSE", "HSP_POSE"):
        hsp = {} if kind == "OSC_POSE" else {"hsp": {"stream": None}}
        with made(kind=kind, input_ref_frame=frame, **hsp) as env:
            begun = arm_of(env).ref_pos.copy()
            low, high = env.action_spec
            np.testing.assert_array_equal([low, high], [-np.ones(7), np.ones(7)])
            env.step(actions[0])
            goals.append([arm_of(env).goal_pos, arm_of(env).goal_ori])
            for action in actions[1:]:
                env.step(action)
            ends.append(arm_of(env).ref_pos - begun)
    for ours, theirs in zip(*goals, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    np.testing.assert_allclose(*ends, atol=0.25 * np.linalg.norm(ends[0]))


@pytest.mark.parametrize(("settings", "error", "message"), [
    ({"impedance_mode": "variable"}, ControllerError, "impedance_mode: HSP_POSE"),
    ({"interpolation": "linear"}, ControllerError, "interpolation: HSP_POSE"),
    ({"position_limits": [[0.0] * 3, [1.0] * 3]}, ControllerError, "position_lim"),
    ({"position_limits": np.ones((2, 3))}, ControllerError, "position_limits: HSP"),
    ({"kp": [150, 0, 150, 150, 150, 150]}, GainError, "kp: must be positive"),
    ({"hsp": {"limit": "none"}}, ConfigError, "limit"),
    ({"hsp": "nowhere.yaml"}, ConfigError, "nowhere.yaml"),
])  # fmt: skip
def test_unsupported_settings_are_refused(
    settings: Any, error: Any, message: str
) -> None:
    with pytest.raises(error, match=message), made(**settings):
        pass


def test_the_page_s_code_runs() -> None:
    page = Path(__file__).parents[1] / "page.md"
    text = page.read_text(encoding="utf-8")
    snippet, _ = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    space: dict[str, Any] = {}
    exec(compile(snippet, "simulators.md", "exec"), space)
    assert isinstance(arm_of(space["env"]), HspPose)
