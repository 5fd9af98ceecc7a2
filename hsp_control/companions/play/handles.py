"""Handles of a controller on a page: targets, the posture, obstacles and settings.

When a handle is dragged, a stream replaces its trajectory, with a crossfade as in any
change at run time. So the law follows a C² reference within bounds for any motion of
the pointer, and the log can repeat it.

The handle of the posture is its elbow, a frame of the robot at the target posture. The
posture follows a dragged elbow by damped least squares that keep the hand in place as
far as possible; a stream moves the field's target there. The robot follows in the null
space of its tasks: the field may depend on time, and the theorem holds throughout.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError, StreamError
from hsp_control.companions.play.knobs import Knob, knobs_of
from hsp_control.companions.plots.palette import FIELD
from hsp_control.control.interface import DELAY, RAMP, Changes, Controller, new_stream
from hsp_control.declaration.nested import Remembering, parts_within
from hsp_control.geometry.scene import Obstacle
from hsp_control.null_space.fields import TargetPosture
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import sample_weight
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import FrameOrientation, FramePose, FramePosition, Task
from hsp_control.trajectories import Stream
from hsp_control.trajectories.crossfade import AnyReference
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.streamed import Streamed

BACK = 1.5
"""Time in which a grip returns to its path [s]: half a metre at 0.6 m/s at most."""
_FARTHEST = 1e3  # nothing is dragged farther [m]


class Grip(ABC):
    """Something that can be dragged."""

    def __init__(self, name: str, controller: Controller) -> None:
        """Begin on its own path."""
        self.name = name
        self._controller = controller
        self._stream: Streamed | None = None
        self._wanted_at: tuple[float, list[float]] | None = None

    def move(self, value: Any, t: float) -> None:
        """Command a place from time t on [s]."""
        wanted = self._wanted(np.asarray(value, dtype=float))  # it may raise
        if self._stream is None:
            stream = self._new_stream()
            stream.check(value=wanted)
            self._follow(stream, self._controller.at(t).ramp(RAMP))
            self._stream = stream
        self._controller.stream(self._stream).send(wanted)
        self._wanted_at = t, [float(x) for x in value]

    def resume(self, t: float) -> None:
        """Return it to its own path from time t on [s]."""
        if self._stream is not None:
            self._follow(None, self._controller.at(t).ramp(BACK))
        self._stream = self._wanted_at = None

    @abstractmethod
    def describe(self, state: RobotState) -> dict[str, Any]:
        """Return its description for the page."""

    def where(self, state: RobotState) -> list[float]:
        """Return its present place, or the commanded one while the time stands still.

        That is x, y, z and a quaternion, or less.
        """
        if self._wanted_at is not None and self._wanted_at[0] == state.t:
            return self._wanted_at[1]
        return self._where(state)

    @abstractmethod
    def _where(self, state: RobotState) -> list[float]: ...

    @abstractmethod
    def _new_stream(self) -> Streamed: ...

    @abstractmethod
    def _wanted(self, value: Array) -> Array:
        """Return a page's command as the stream accepts it."""

    @abstractmethod
    def _follow(self, stream: Any, at: Changes) -> None:
        """Follow a stream, or its own path for None."""


def _pose(value: Array) -> Array:
    """Return a pose that a page sent."""
    if value.shape != (7,) or not (np.abs(value) < _FARTHEST).all():
        raise StreamError(f"a pose needs x, y, z and a quaternion; got {value}")
    return value


class TargetGrip(Grip):
    """The target of a frame's position, orientation or pose."""

    def __init__(self, task: Task, controller: Controller) -> None:
        """Store the task's own path."""
        super().__init__(task.name, controller)
        self._frame = task.frame  # type: ignore[attr-defined]
        self._own = task.followed
        axes = task.axes if isinstance(task, FramePosition) else "xyz"
        self._axes = [axis in axes for axis in "xyz"]
        # Which of x, y, z and a quaternion the task follows.
        self._kind, self._tracked = "pose", list(range(7))
        if isinstance(task, FramePosition):
            self._kind, self._tracked = "position", ["xyz".index(axis) for axis in axes]
        elif isinstance(task, FrameOrientation):
            self._kind, self._tracked = "orientation", [3, 4, 5, 6]

    def describe(self, state: RobotState) -> dict[str, Any]:
        """Return its name, its kind, its axes and its pose."""
        pose = self.where(state)
        return {"name": self.name, "kind": self._kind, "axes": self._axes, "pose": pose}

    def _where(self, state: RobotState) -> list[float]:
        """Return x, y, z and a quaternion; the frame's own where the task is free."""
        frame = state.frame(self._frame)
        pose = pin.SE3ToXYZQUAT(pin.SE3(frame.rotation, frame.position))
        for task in self._controller.tasks:
            if task.name == self.name:
                pose[self._tracked], _ = task.measure(state)
        return [float(x) for x in pose]

    def _new_stream(self) -> Streamed:
        return new_stream(self._own)

    def _wanted(self, value: Array) -> Array:
        return _pose(value)[self._tracked]

    def _follow(self, stream: AnyReference | None, at: Changes) -> None:
        reference = stream or self._own
        assert reference is not None
        at.reference(self.name, reference)


class ObstacleGrip(Grip):
    """An obstacle of the scene; it keeps its orientation."""

    def __init__(self, obstacle: Obstacle, controller: Controller) -> None:
        """Store the obstacle's own path."""
        super().__init__(obstacle.name, controller)
        self._obstacle = obstacle

    def describe(self, state: RobotState) -> dict[str, Any]:
        """Return its name, its position and its size."""
        radius = self._obstacle.shape.bounding_radius
        return {"name": self.name, "position": self.where(state), "radius": radius}

    def _where(self, state: RobotState) -> list[float]:
        """Return the position of its frame."""
        place = self._controller.scene[self.name].placement(state.t)
        return [float(x) for x in place.translation]

    def _new_stream(self) -> Streamed:
        return new_stream(self._obstacle.center)

    def _wanted(self, value: Array) -> Array:
        if value.shape != (3,) or not (np.abs(value) < _FARTHEST).all():
            raise StreamError(f"a position needs x, y and z; got {value}")
        return value

    def _follow(self, stream: Stream | None, at: Changes) -> None:
        at.obstacle(self.name, stream or self._obstacle.center)


def targets_of(controller: Controller) -> dict[str, TargetGrip]:
    """Return the draggable targets by name; references of a plan are left out."""
    kinds = FramePose, FramePosition, FrameOrientation
    return {
        task.name: TargetGrip(task, controller)
        for task in controller.tasks
        if isinstance(task, kinds)
        and task.followed is not None
        and all(
            isinstance(each, FollowedStream)
            for each in parts_within(task.followed, Remembering)
        )
    }


def obstacles_of(controller: Controller) -> dict[str, ObstacleGrip]:
    """Return the grips of the bounded obstacles with a position, by name."""
    found = {}
    for obstacle in controller.scene.values():
        if not np.isfinite(obstacle.shape.bounding_radius):
            continue  # such as the floor
        grip = ObstacleGrip(obstacle, controller)
        with suppress(HspControlError):  # it has no position
            grip.where(controller.state)
            found[obstacle.name] = grip
    return found


_JOINTS_MOVING: dict[str, Any] = {"speed": 1.0, "acceleration": 5.0, "jerk": 100.0}
"""Bounds of the joints' targets [1/s, 1/s², 1/s³, in rad or m]."""
_STEPS = 20
_DAMPING, _HOLDING = 1e-2, 0.3
"""Weights of the least squares: for the joints to stay [m/rad], and for the hand."""
POSTURE = "posture"


class PostureGrip(Grip):
    """The target of a field's posture, by a joint in the middle of the arm."""

    def __init__(self, field: TargetPosture, controller: Controller) -> None:
        """Store the field, and choose the joint."""
        super().__init__(POSTURE, controller)
        self._field = field
        self._robot: Robot = controller.robot
        self._own = np.asarray(field.target, dtype=float)
        self._target = self._own.copy()
        self._data = self._robot.model.createData()
        self._joint = self._elbow()

    def describe(self, state: RobotState) -> dict[str, Any]:
        """Return its name, its kind, its axes and its pose."""
        about = {"kind": "position", "axes": [True] * 3, "color": FIELD}
        return {"name": self.name, **about, "pose": self.where(state)}

    def _where(self, state: RobotState) -> list[float]:
        """Return the joint's pose in the target posture, x, y, z and a quaternion."""
        terms = [
            t for t in terms_of(self._controller.field) if isinstance(t, TargetPosture)
        ]
        weights = np.array([sample_weight(term.weight, state)[0] for term in terms])
        if terms and not weights.any():  # the field is switched off: use the newest
            weights[-1] = 1.0
        moved = np.zeros(self._robot.nv)
        for term, weight in zip(terms, weights / weights.sum(), strict=True):
            if term.displacement is not None:
                moved += weight * term.displacement.sample(state.t).position
        q = self._robot.integrate(self._own, moved)
        pin.forwardKinematics(self._robot.model, self._data, q)
        return [float(x) for x in pin.SE3ToXYZQUAT(self._data.oMi[self._joint])]

    def _new_stream(self) -> Streamed:
        here = np.zeros(self._robot.nv)
        return Stream(here, policy="latest", delay=DELAY, **_JOINTS_MOVING)

    def _wanted(self, value: Array) -> Array:
        self._target = self._posture_with(self._target, _pose(value)[:3])
        return self._robot.difference(self._own, self._target)

    def _follow(self, stream: Stream | None, at: Changes) -> None:
        if stream is None:
            self._target = self._own.copy()
            at.exchange(self._field.name, self._field)
        else:
            moving = replace(self._field, displacement=stream)
            at.exchange(self._field.name, moving)

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
    """Return the grip of the field's posture, by name; none without such a field."""
    terms = terms_of(controller.field)
    postures = [term for term in terms if isinstance(term, TargetPosture)]
    if len(postures) != 1 or postures[0].displacement is not None:
        return {}
    if any(task.name == POSTURE for task in controller.tasks):
        return {}
    return {POSTURE: PostureGrip(postures[0], controller)}


KNOB_PERIOD = 0.1  # time between two changes by one knob [s]: a slider sends many more


class Handles:
    """Turns a page's commands into streams and changes of a controller."""

    def __init__(self, controller: Controller, period: float) -> None:
        """Find the handles and knobs; none is moved yet."""
        self._controller = controller
        self.targets: dict[str, Grip] = {
            **targets_of(controller),
            **posture_of(controller),
        }
        self.obstacles = obstacles_of(controller)
        self.knobs = knobs_of(controller, period)
        self.values: dict[str, float | bool] = {
            name: knob.value for name, knob in self.knobs.items()
        }
        self.message, self.warning = "", False
        self._turned: dict[str, float] = {}
        self._wanted: dict[str, float | bool] = {}

    def add(self, knob: Knob) -> None:
        """Add a knob."""
        self.knobs[knob.id], self.values[knob.id] = knob, knob.value

    def receive(self, message: Mapping[str, Any]) -> None:
        """Execute a page's command; errors are reported in `message`.

        ``move`` a target or an ``obstacle``, let it ``resume`` its own path, ``set`` a
        knob. A handle that is ``release``d stays where it is.
        """
        try:
            self._do(message)
        except (HspControlError, ValueError, TypeError, OverflowError) as error:
            self.say(str(error), warning=True)

    def _do(self, message: Mapping[str, Any]) -> None:
        t = self._controller.state.t
        match message:
            case {"do": "move", "target": str(name), "pose": list(pose)}:
                _grip(self.targets, name).move(pose, t)
            case {"do": "resume", "target": str(name)}:
                _grip(self.targets, name).resume(t)
            case {"do": "obstacle", "name": str(name), "position": list(where)}:
                _grip(self.obstacles, name).move(where, t)
            case {"do": "resume", "name": str(name)}:
                _grip(self.obstacles, name).resume(t)
            case {"do": "set", "id": str(name), "value": value}:
                if name not in self.knobs:
                    raise ValueError(f"there is no knob {name!r}")
                self._wanted[name] = self.knobs[name].checked(value)
            case {"do": "release" | "left"}:
                pass
            case _:
                raise ValueError(f"cannot do {str(dict(message))[:200]}")

    def say(self, message: str, *, warning: bool = False) -> None:
        """Store a message for the pages."""
        self.message, self.warning = message, warning

    def turn_knobs(self) -> None:
        """Make the changes of the knobs at a limited rate."""
        t = self._controller.state.t
        for name in list(self._wanted):
            if t - self._turned.get(name, -np.inf) < KNOB_PERIOD:
                continue
            value, self._turned[name] = self._wanted.pop(name), t
            try:
                self.knobs[name].turn(self._controller.at(t).ramp(RAMP), value)
                self.values[name] = value
                self.say("")
            except HspControlError as error:
                self.say(str(error), warning=True)

    @property
    def settings(self) -> dict[str, float | bool]:
        """The values of the knobs, including those that apply when time continues."""
        return {**self.values, **self._wanted}

    def rehearse(self) -> None:
        """Execute every command once, so that its calls are bound."""
        targets, obstacles = self.places()
        for name, pose in targets.items():
            self.receive({"do": "move", "target": name, "pose": pose})
        for name, where in obstacles.items():
            self.receive({"do": "obstacle", "name": name, "position": where})
        for name, value in self.values.items():
            off = not value if isinstance(value, bool) else value
            self.receive({"do": "set", "id": name, "value": off})

    def places(self) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
        """Return the places of the targets and the obstacles, by name."""
        state = self._controller.state
        return (
            {name: grip.where(state) for name, grip in self.targets.items()},
            {name: grip.where(state) for name, grip in self.obstacles.items()},
        )


def _grip(among: Mapping[str, Grip], name: str) -> Grip:
    if name not in among:
        raise ValueError(f"there is no {name!r} to drag")
    return among[name]
