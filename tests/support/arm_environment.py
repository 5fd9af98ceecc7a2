"""A Gymnasium environment with an arm of seven joints, a finger and nothing else."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.mujoco import MujocoEnv

AXES = "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1"
LENGTHS = 0.3, 0.05, 0.3, 0.05, 0.25, 0.05, 0.1
START = [0.0, 0.3, 0.0, 0.9, 0.0, 0.9, 0.0]
STRONGEST = 200.0


def arm_text(drive: str = "motor") -> str:
    """Return the MJCF, with actuators of one kind on the arm's joints."""
    inside = """
<body name="finger" pos="0 0 0.05">
  <joint name="finger" type="slide" axis="1 0 0" range="0 0.05" damping="10"/>
  <geom type="box" size="0.01 0.01 0.02" mass="0.05"/>
</body>
<site name="hand" pos="0 0 0.1"/>"""
    for k in reversed(range(7)):
        offset = 0.0 if k == 0 else LENGTHS[k - 1]
        inside = f"""
<body name="link{k + 1}" pos="0 0 {offset}">
  <joint name="joint{k + 1}" axis="{AXES[k]}" range="-170 170" armature="0.1"/>
  <geom type="capsule" fromto="0 0 0 0 0 {LENGTHS[k]}" size="0.04" mass="1.5"/>
  {inside}
</body>"""
    drives = "".join(
        f'<{drive} joint="joint{k + 1}" ctrllimited="true" '
        f'ctrlrange="-{STRONGEST} {STRONGEST}"/>'
        for k in range(7)
    )
    return f"""
<mujoco>
  <option timestep="0.001"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody><light pos="0 0 3"/>{inside}</worldbody>
  <actuator>
    {drives}
    <position joint="finger" kp="2000" ctrllimited="true" ctrlrange="0 0.05"/>
  </actuator>
</mujoco>"""


class ArmEnv(MujocoEnv):
    """The arm; observed are its qpos and qvel."""

    metadata = {"render_modes": ["human", "rgb_array", "depth_array"]}  # noqa: RUF012

    def __init__(self, folder: Path, drive: str = "motor") -> None:
        path = folder / "arm.xml"
        path.write_text(arm_text(drive), encoding="utf-8")
        space = gymnasium.spaces.Box(-np.inf, np.inf, (16,), dtype=np.float64)
        super().__init__(str(path), 20, space)

    def step(self, action: Any) -> Any:
        self.do_simulation(action, self.frame_skip)
        return self.state_vector(), -float(np.sum(np.square(action))), False, False, {}

    def reset_model(self) -> Any:
        self.set_state(np.array([*START, 0.0]), np.zeros(8))
        return self.state_vector()
