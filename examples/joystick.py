"""A joystick moves the hand along its own axes; without messages the hand stops."""

import select
import struct
from pathlib import Path

import numpy as np
import pinocchio as pin

import hsp_control as hsp

DEVICE = Path("/dev/input/js0")
PERIOD, DURATION, FASTEST = 0.002, 4.0, 0.15  # s, s, m/s
robot = hsp.Robot.load("panda")
controller = hsp.Controller(
    robot, [hsp.FramePose("panda_tcp", name="hand")], hsp.JointCentering()
)


def events(stick):
    """Yield (axis, value from -1 to 1) of the stick's messages since the last call."""
    while select.select([stick], [], [], 0)[0]:
        _, value, kind, number = struct.unpack("IhBB", stick.read(8))
        if kind & 0x02 and number < 3:
            yield number, value / 32767


def pretended(t: float) -> np.ndarray:
    """Return the stick's deflection: back and forth, and then none."""
    return np.array([np.sin(3 * t), np.cos(3 * t), 0.0]) if t < 2.5 else np.zeros(3)


stick = DEVICE.open("rb", buffering=0) if DEVICE.exists() else None
axes, model, data = np.zeros(3), robot.model, robot.model.createData()
q, v = robot.home(), np.zeros(robot.nv)  # your robot, instead
with hsp.Recorder(controller, "out/joystick.npz") as recorder:
    for k in range(round(DURATION / PERIOD)):
        if stick is None:
            axes = pretended(k * PERIOD)
        else:
            for number, value in events(stick):
                axes[number] = value
        output = controller.compute(k * PERIOD, q, v)
        recorder.record(output)
        if axes.any():
            controller.set_velocity("hand", [*(FASTEST * axes), 0, 0, 0], axes="tool")
        v = v + PERIOD * pin.aba(model, data, q, v, output.tau)
        q = pin.integrate(model, q, PERIOD * v)
print(recorder.rollout)
