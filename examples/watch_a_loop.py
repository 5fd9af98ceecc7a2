"""Watch a loop of your own in the browser while it runs."""

import time

import numpy as np
import pinocchio as pin

import hsp_control as hsp

PERIOD, DURATION = 0.002, 4.0
robot = hsp.Robot.load("panda")
hand = hsp.FramePosition("panda_tcp", hsp.Circle(radius=0.1, angular_rate=2.0), blend=1)
controller = hsp.Controller(robot, [hand], hsp.JointCentering(), null_space_gain=8.0)

model, data = robot.model, robot.model.createData()  # your robot, instead
q, v = robot.home(), np.zeros(robot.nv)
recorder = hsp.Recorder(controller, "out/watch_a_loop.npz")
with recorder, hsp.viewer.watch(recorder) as page:  # or watch(controller)
    print(f"Open {page.url}")
    begin = time.monotonic()
    for k in range(round(DURATION / PERIOD)):
        output = controller.compute(k * PERIOD, q, v)
        recorder.record(output)
        v = v + PERIOD * pin.aba(model, data, q, v, output.tau)
        q = pin.integrate(model, q, PERIOD * v)
        time.sleep(max(begin + k * PERIOD - time.monotonic(), 0.0))
print(recorder.rollout)
