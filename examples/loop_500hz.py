"""A loop of your own at 500 Hz; another thread sends the hand's targets."""

import threading
import time

import numpy as np
import pinocchio as pin

import hsp_control as hsp

PERIOD, DURATION = 0.002, 3.0
robot = hsp.Robot.load("panda")
hand = hsp.FramePose("panda_tcp", name="hand")
controller = hsp.Controller(robot, [hand], hsp.JointCentering(), null_space_gain=8.0)
over = threading.Event()


def operator(start: pin.SE3) -> None:
    """Send a new target five times a second, from whatever thread you like."""
    rng = np.random.default_rng(0)
    while not over.wait(0.2):
        away = rng.uniform(-0.08, 0.08, 3)
        controller.set_target("hand", pin.SE3(start.rotation, start.translation + away))


model, data = robot.model, robot.model.createData()  # your robot, instead
q, v = robot.home(), np.zeros(robot.nv)
here = robot.state(0.0, q, v).frame("panda_tcp")
first = pin.SE3(here.rotation.copy(), here.position.copy())
thread = threading.Thread(target=operator, args=(first,))
with hsp.Recorder(controller, "out/loop_500hz.npz") as recorder:
    output = controller.compute(0.0, q, v)  # binds all calls, before there is a clock
    thread.start()
    begin = time.monotonic()
    for k in range(1, round(DURATION / PERIOD)):
        v = v + PERIOD * pin.aba(model, data, q, v, output.tau)
        q = pin.integrate(model, q, PERIOD * v)
        time.sleep(max(begin + k * PERIOD - time.monotonic(), 0.0))
        output = controller.compute(k * PERIOD, q, v)
        recorder.record(output)
over.set()
thread.join()
print(recorder.rollout)
