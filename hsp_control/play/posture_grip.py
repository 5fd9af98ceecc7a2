"""The posture that the field wants, held by its elbow.

The handle is a frame of the robot at the target posture. Where it is dragged to, the
posture follows by damped least squares, the hand of the posture staying where it is as
far as it can; a stream moves the field's target there. The robot follows as far as its
tasks leave it free: the field may move in time, and the theorem holds throughout.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import StreamError
from hsp_control.control.controller import Controller
from hsp_control.null_space.fields import TargetPosture
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import sample_weight
from hsp_control.play.grips import BACK, DELAY, Grip
from hsp_control.play.knobs import RAMP
from hsp_control.robot import Robot, RobotState
from hsp_control.trajectories import Stream
from hsp_control.trajectories.streams.stream import Streamed
from hsp_control.visualization.palette import FIELD

_MOVING: dict[str, Any] = {"speed": 1.0, "acceleration": 5.0, "jerk": 100.0}
"""Bounds of the target of each joint [1/s, 1/s², 1/s³, in rad or m]."""
_STEPS = 20
_DAMPING, _HOLDING = 1e-2, 0.3
"""Of the least squares: how much joints stay [m/rad], and how much the hand does."""
NAME = "posture"


class PostureGrip(Grip):
    """The target of a field's posture, by a joint in the middle of the arm."""

    def __init__(self, field: TargetPosture, controller: Controller) -> None:
        """Remember the field, and choose the joint."""
        super().__init__(NAME, controller)
        self._field = field
        self._robot: Robot = controller.robot
        self._own = np.asarray(field.target, dtype=float)
        self._target = self._own.copy()
        self._data = self._robot.model.createData()
        self._joint = self._elbow()

    def describe(self, state: RobotState) -> dict[str, Any]:
        """Return its name, its kind, its axes and its pose."""
        return {
            "name": self.name,
            "kind": "position",
            "axes": [True, True, True],
            "color": FIELD,
            "pose": self.where(state),
        }

    def where(self, state: RobotState) -> list[float]:
        """Return the joint's pose in the target posture, x, y, z and a quaternion."""
        terms = [
            t for t in terms_of(self._controller.field) if isinstance(t, TargetPosture)
        ]
        weights = np.array([sample_weight(term.weight, state)[0] for term in terms])
        if terms and not weights.any():  # the field is switched off: the newest counts
            weights[-1] = 1.0
        moved = np.zeros(self._robot.nv)
        for term, weight in zip(terms, weights / weights.sum(), strict=True):
            if term.displacement is not None:
                moved += weight * term.displacement.sample(state.t).position
        q = self._robot.integrate(self._own, moved)
        pin.forwardKinematics(self._robot.model, self._data, q)
        return [float(x) for x in pin.SE3ToXYZQUAT(self._data.oMi[self._joint])]

    def _make_stream(self) -> Streamed:
        return Stream(np.zeros(self._robot.nv), **_MOVING, delay=DELAY)

    def _wanted(self, value: Array) -> Array:
        if value.shape != (7,) or not (np.abs(value) < 1e3).all():
            raise StreamError(f"a pose is x, y, z and a quaternion; got {value}")
        self._target = self._posture_with(self._target, value[:3])
        return self._robot.difference(self._own, self._target)

    def _let_follow(self, stream: Streamed, t: float) -> None:
        assert isinstance(stream, Stream)
        moving = replace(self._field, displacement=stream)
        self._controller.at(t).ramp(RAMP).exchange(self._field.name, moving)

    def _return(self, t: float) -> None:
        self._target = self._own.copy()
        self._controller.at(t).ramp(BACK).exchange(self._field.name, self._field)

    def _posture_with(self, q: Array, point: Array) -> Array:
        """Return the posture near q whose joint is nearest to a point [m]."""
        robot, model, data = self._robot, self._robot.model, self._data
        hand = robot.frame_id(robot.end_effector)
        pin.framesForwardKinematics(model, data, q)
        held = data.oMf[hand].translation.copy()
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        single = np.zeros(robot.nv)
        single[robot.single_dof_joints[:, 0]] = 1.0
        for _ in range(_STEPS):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            J = pin.getJointJacobian(model, data, self._joint, world)[:3] * single
            H = pin.getFrameJacobian(model, data, hand, world)[:3] * single
            away = point - data.oMi[self._joint].translation
            lost = held - data.oMf[hand].translation
            A = np.vstack([J, _HOLDING * H, _DAMPING * np.eye(robot.nv)])
            b = np.concatenate([away, _HOLDING * lost, np.zeros(robot.nv)])
            q = robot.integrate(q, np.linalg.lstsq(A, b, rcond=None)[0])
        return q

    def _elbow(self) -> int:
        """Return the joint that is farthest from the line from the base to the hand."""
        model, data = self._robot.model, self._data
        pin.forwardKinematics(model, data, self._own)
        hand = model.frames[self._robot.frame_id(self._robot.end_effector)].parentJoint
        joints = [j for j in model.supports[hand] if j > 0]
        points = np.array([data.oMi[j].translation for j in joints])
        along = points[-1] - points[0]
        along /= max(float(np.linalg.norm(along)), 1e-9)
        away = np.linalg.norm(np.cross(points - points[0], along), axis=1)
        return int(joints[int(np.argmax(away))])


def posture_of(controller: Controller) -> dict[str, PostureGrip]:
    """Return the grip of the field's posture, by its name; none without one."""
    terms = terms_of(controller.field)
    postures = [term for term in terms if isinstance(term, TargetPosture)]
    if len(postures) != 1 or postures[0].displacement is not None:
        return {}
    if any(task.name == NAME for task in controller.tasks):
        return {}
    return {NAME: PostureGrip(postures[0], controller)}
