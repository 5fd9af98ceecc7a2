"""A policy sends a chunk of waypoints twice a second; the reference stays smooth."""

import numpy as np
import pinocchio as pin

import hsp_control as hsp

PERIOD, DURATION, STEP = 0.002, 4.0, 0.05  # s, s, s between two waypoints
robot = hsp.Robot.load("panda")
streamed = hsp.Stream(policy="interpolate", delay=0.1, speed=1.0)
hand = hsp.FramePosition("panda_tcp", streamed, name="hand")
controller = hsp.Controller(robot, [hand], hsp.JointCentering(), null_space_gain=8.0)
target = controller.stream("hand")
start = robot.state(0.0, robot.home(), np.zeros(robot.nv)).position("panda_tcp").copy()


def policy(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return sixteen waypoints and their times from now: yours is a network."""
    ahead = STEP * np.arange(1, 17)
    angle = 2.0 * (t + ahead)
    circle = np.stack([np.cos(angle) - 1.0, np.sin(angle), 0.0 * angle], axis=1)
    return start + 0.08 * circle, ahead


model, data = robot.model, robot.model.createData()  # your robot, instead
q, v = robot.home(), np.zeros(robot.nv)
with hsp.Recorder(controller, "out/policy_chunks.npz") as recorder:
    for k in range(round(DURATION / PERIOD)):
        t = k * PERIOD
        output = controller.compute(t, q, v)
        recorder.record(output)
        if k % 250 == 0:  # half of a chunk is replaced by the next one
            target.send_chunk(*policy(t), t=t)
        v = v + PERIOD * pin.aba(model, data, q, v, output.tau)
        q = pin.integrate(model, q, PERIOD * v)
print(recorder.rollout)
