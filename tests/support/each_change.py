"""One change of each kind, its inverse, and a controller that accepts them."""

from collections.abc import Callable

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.changes import Changes

PERIOD = 1e-3  # [s]
ROBOT = hsp.Robot.load("panda")
REST = np.zeros(7)
BALL = hsp.Obstacle("ball", hsp.shapes.Sphere(0.05), hsp.Hold([0.6, 0.3, 0.4]))

CHANGES: dict[str, Callable[[Changes], object]] = {
    "gains": lambda at: at.gains("hand", hsp.Gains(natural_frequency=20.0)),
    "K_N": lambda at: at.null_space_gain(5.0),
    "weight": lambda at: at.weight("posture", 0.5),
    "field": lambda at: at.field(hsp.TargetPosture(REST, name="other")),
    "exchange": lambda at: at.exchange("posture", hsp.TargetPosture(REST)),
    "add": lambda at: at.add(hsp.FrameOrientation(priority=2, name="turned")),
    "remove": lambda at: at.remove("hand"),
    "replace": lambda at: at.remove("hand").add(hsp.FramePosition(name="new")),
    "reference": lambda at: at.reference("hand", hsp.Circle(0.05, 1.0)),
    "limits": lambda at: at.limits(hsp.Limits(effort={"scale": 0.5})),
    "no limits": lambda at: at.limits(None),
    "obstacle": lambda at: at.obstacle("ball", hsp.Hold([0.5, 0.3, 0.4])),
    "payload": lambda at: at.payload("panda_hand", 1.0),
    "tool": lambda at: at.tool("panda_tcp", [0.0, 0.0, 0.1], [0.0, 0.5, 0.0]),
    "gravity": lambda at: at.gravity([0.0, 1.0, -9.7]),
}
BACK: dict[str, Callable[[Changes], object]] = {
    "gains": lambda at: at.gains("hand", hsp.Gains(natural_frequency=10.0)),
    "K_N": lambda at: at.null_space_gain(6.0),
    "weight": lambda at: at.weight("posture", 1.0),
    "exchange": lambda at: at.exchange(
        "target_posture", hsp.TargetPosture(REST, name="posture")
    ),
    "add": lambda at: at.remove("turned"),
    "remove": lambda at: at.add(hsp.FramePosition(name="hand")),
    "replace": lambda at: at.remove("new").add(hsp.FramePosition(name="hand")),
    "payload": lambda at: at.payload("panda_hand", 0.0),
    "tool": lambda at: at.tool("panda_tcp"),
}
"""Conditions under which a change can be repeated, or has an effect at all."""


def controller(*tasks: hsp.Task) -> hsp.Controller:
    """Return a controller of a hand and a posture, with a ball to avoid."""
    hand = hsp.FramePosition(name="hand")
    fields = hsp.TargetPosture("home", name="posture") + hsp.ObstacleClearance(["ball"])
    return hsp.Controller(ROBOT, tasks or [hand], fields, scene=[BALL])


def step(made: hsp.Controller, k: int) -> Array:
    """Make the k-th step."""
    tau = made.compute(k * PERIOD, ROBOT.home(), REST).tau
    made.applied(tau, PERIOD)
    return tau
