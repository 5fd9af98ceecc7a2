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
with hsp.viewer.Viewer(robot) as viewer:
    print(f"Open {viewer.url}")
    with hsp.Recorder(controller, "out/watch_a_loop.npz") as recorder:
        begin = time.monotonic()
        for k in range(round(DURATION / PERIOD)):
            output = controller.compute(k * PERIOD, q, v)
            recorder.record(output)
            if k % 17 == 0:  # thirty times a second
                viewer.show(q)
            v = v + PERIOD * pin.aba(model, data, q, v, output.tau)
            q = pin.integrate(model, q, PERIOD * v)
            time.sleep(max(begin + k * PERIOD - time.monotonic(), 0.0))
    viewer.play(recorder.rollout, controller=controller)  # and once more, with plots
print(recorder.rollout)
