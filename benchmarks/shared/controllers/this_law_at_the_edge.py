"""This law with its defaults, or without the bounds that it has for the edge."""

from typing import Any

import numpy as np
import pinocchio as pin

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.trajectories import (
    ComposedPose,
    HoldOrientation,
    Trajectory,
    TrajectorySample,
)
from shared.edge_loop import BEGIN, MESSAGES, PERIOD, STREAMED, Case, Compute


class CasePath(Trajectory):
    """The path of a case's hand."""

    case: Any = None

    @property
    def dimension(self) -> int:
        """The number of coordinates."""
        return 3

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return where the hand should be."""
        out = self._output(out)
        out.position[:], out.velocity[:], out.acceleration[:] = self.case.desired(t)
        return out


def make(case: Case, model: Any, *, bounded: bool = True) -> Compute:
    """Return the controller.

    Args:
        case: The case.
        model: The robot's model for other controllers.
        bounded: False: no largest error, and efforts may jump.
    """
    robot = hsp.Robot.load(case.robot)
    assert np.array_equal(robot.model.effortLimit, model.effortLimit)
    declared: dict[str, Any] = {} if bounded else {"largest_error": "none"}
    limits = hsp.Limits() if bounded else hsp.Limits(effort_rate="none")
    task: hsp.Task
    if case.rows == 3:
        task = hsp.FramePosition(case.frame, CasePath(case), **declared)
    else:
        pose = stream(case) if case.kind == "stream" else held(case)
        task = hsp.FramePose(case.frame, pose, **declared)
    controller = hsp.Controller(robot, [task], hsp.JointCentering(), limits=limits)

    def compute(t: float, q: Array, v: Array) -> Array:
        tau = controller.compute(t, q, v).tau
        controller.applied(tau, PERIOD)
        return tau

    return compute


def held(case: Case) -> ComposedPose:
    """Return the path with the rotation of the start."""
    return ComposedPose(CasePath(case), HoldOrientation(case.rotation))


def stream(case: Case) -> hsp.StreamPose:
    """Return a stream of the messages that the other controllers hold."""
    messages = []
    for k in range(1, round(STREAMED * MESSAGES) + 1):
        t = BEGIN + k / MESSAGES
        pose = pin.SE3(case.rotation, case.desired(t).position)
        messages.append({"at": t, "value": pin.SE3ToXYZQUAT(pose).tolist()})
    return hsp.StreamPose(messages=messages, policy="latest")
