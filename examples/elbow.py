"""Turn the elbow about the line from shoulder to wrist; the hand holds its pose."""

import numpy as np

import hsp_control as hsp

robot = hsp.Robot.load("panda")


def elbow_angle(state):
    """Return the angle of the elbow about shoulder-wrist, 0 where it is uppermost."""
    shoulder, elbow, wrist = map(
        state.position, ("panda_link2", "panda_link4", "panda_link7")
    )
    axis = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    up = np.array([0.0, 0.0, 1.0]) - axis[2] * axis
    aside = np.array([axis[1], -axis[0], 0.0])  # axis × z
    away = elbow - shoulder
    return np.arctan2(away @ aside, away @ up)


hand = hsp.FramePose("panda_tcp")
turning = hsp.trajectories.Stops(
    [[0.0], [0.8], [-0.8], [0.0]], times=[0.5, 2.0, 4.0, 5.5], origin="start"
)
elbow = hsp.FunctionTask(elbow_angle, turning, unit="rad", priority=2, name="elbow")
controller = hsp.Controller(robot, [hand, elbow])
run = hsp.simulate(controller, robot.home(), duration=6.0, control_period=0.005)
print(run, run.save("out/elbow.npz"))
moved = 1e3 * np.abs(run["task.panda_tcp.error"]).max()
print(f"the elbow turns by ±{np.rad2deg(0.8):.0f}°; the hand moves by {moved:.1f} mm")
