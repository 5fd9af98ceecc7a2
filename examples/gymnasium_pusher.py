"""Actions of a Gymnasium environment that are targets of the hand, not torques."""

import gymnasium
import numpy as np

from hsp_control.companions.simulators.gymnasium import HandTargets

law = {"null_space": {"gain": 5, "fields": [{"type": "target_posture"}]}}
env = HandTargets(gymnasium.make("Pusher-v5"), "tips_arm", law, axes="xyz")
observation, _ = env.reset(seed=0)
total = 0.0
for step in range(40):
    angle = 2.0 * np.pi * step / 40
    action = 0.4 * np.array([np.cos(angle), np.sin(angle), 0.0])  # of at most 5 cm
    observation, reward, *_ = env.step(action)
    total += reward
print(f"the hand is at {np.round(observation[14:17], 3)} m; reward {total:.2f}")
env.close()
