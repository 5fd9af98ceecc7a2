"""Every task on several robots, and their motion by plain Pinocchio.

The motion is q(s) = q ⊕ (s v + ½ s² a) at the times t + s: differences are of eighth
order in s, with a step of a fixed fraction of the motion's time scale, so that their
error is rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load

import hsp_control as hsp
from hsp_control import (
    CenterOfMass,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    JointPosture,
    NullSpaceField,
    Pointing,
    Robot,
    Task,
)
from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Matrix
from hsp_control.geometry import Scene
from hsp_control.geometry.scene import Start
from hsp_control.tasks import RelativePose

Kind = TypeVar("Kind", bound=Task | NullSpaceField)

TIME = 0.7  # [s], of the evaluation
GAINS = Gains(25.0, 10.0)
FRAMES = {
    "planar3r": "tip",
    "panda": "panda_tcp",
    "iiwa14": "iiwa_link_ee",
    "ur5": "tool0",
    "kinova": "j2s6s200_end_effector",
    "tiago_no_hand": "arm_tool_link",
}
BUNDLED = ("planar3r", "panda", "iiwa14")


def placed(part: Kind, robot: Robot) -> Kind:
    """Return a task or field for a robot that starts at rest at home."""
    at_rest = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    return part.placed(Start(at_rest, Scene()))


def planar() -> Robot:
    return load("planar3r")


# --- independent of the package ------------------------------------------------------


# Eighth order, at -4 h ... 4 h.
FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
SECOND = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040
NODES = np.arange(-4, 5)


@dataclass
class Motion:
    """q(s) = q ⊕ (s v + ½ s² a) about a state, and differences along it."""

    robot: Robot
    q: Array
    v: Array
    a: Array
    stride: float = 0.03

    def __post_init__(self) -> None:
        speed = max(1.0, np.abs(self.v).max(), np.sqrt(np.abs(self.a).max()))
        self.step = self.stride / speed
        self._data = self.robot.model.createData()

    def configuration(self, s: float) -> Array:
        displacement = s * self.v + 0.5 * s * s * self.a
        return pin.integrate(self.robot.model, self.q, displacement)

    def placement(self, s: float, frame: str) -> pin.SE3:
        model, q = self.robot.model, self.configuration(s)
        pin.framesForwardKinematics(model, self._data, q)
        return self._data.oMf[model.getFrameId(frame)].copy()

    def derivative(
        self, function: Callable[[float], Array], weights: Array = FIRST
    ) -> Array:
        """Return f'(0), or f''(0) with the weights `SECOND`."""
        order = 1 if weights is FIRST else 2
        values = [np.array(function(s), dtype=float) for s in NODES * self.step]
        return np.tensordot(weights, values, 1) / self.step**order


class Tumble(hsp.trajectories.OrientationTrajectory):
    """R(τ) = exp(f a) exp(g b) R0 with f, g parabolas: w and w' are not parallel."""

    start: Matrix
    time: float = TIME

    a = np.array([0.6, -0.3, 0.5])
    b = np.array([-0.2, 0.8, 0.4])

    def sample(
        self, t: float, out: hsp.trajectories.OrientationSample | None = None
    ) -> hsp.trajectories.OrientationSample:
        out = hsp.trajectories.OrientationSample.allocate() if out is None else out
        s = t - self.time
        f, f_dot, f_ddot = s + 0.8 * s * s, 1.0 + 1.6 * s, 1.6
        g, g_dot, g_ddot = 0.7 * s - 0.5 * s * s, 0.7 - s, -1.0
        A = pin.exp3(f * self.a)
        Ab = A @ self.b
        out.rotation[:] = A @ pin.exp3(g * self.b) @ self.start
        out.angular_velocity[:] = f_dot * self.a + g_dot * Ab
        out.angular_acceleration[:] = (
            f_ddot * self.a + g_ddot * Ab + f_dot * g_dot * np.cross(self.a, Ab)
        )
        return out


def unit(rng: np.random.Generator, size: int) -> Array:
    """Return a random direction."""
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)


def frame_along(direction: Array) -> Array:
    """Return a rotation whose third axis is the direction."""
    columns = np.linalg.qr(np.column_stack([direction, np.eye(3)]))[0][:, [1, 2, 0]]
    columns[:, 2] = direction
    columns[:, 0] *= np.linalg.det(columns)
    return columns


def wobble(position: Array) -> hsp.trajectories.Lissajous:
    """Return a motion that passes through a point at `TIME`."""
    n = len(position)
    amplitudes, rates = 0.2 + 0.1 * np.arange(n), 1.3 + 0.4 * np.arange(n)
    phases = 0.3 * np.arange(n) + 0.2
    away = amplitudes * np.sin(rates * TIME + phases)
    return hsp.trajectories.Lissajous(amplitudes, rates, phases, position - away)


# --- the members ---------------------------------------------------------------------


class Family:
    """Builds a type of task with a known error, and measures it independently."""

    largest = 3.0  # rad or m
    # step of differences of the error, relative to the motion's time scale
    stride = 0.03
    rows: int

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        """Return the task whose error at (TIME, q) has the size ``error``."""
        raise NotImplementedError

    def build(
        self,
        robot: Robot,
        motion: Motion,
        error: float,
        gains: Gains,
        seed: int,
        largest: Any = "none",
    ) -> Task:
        """Return the same, placed, with linear feedback by default."""
        made: Any = self.make(robot, motion, error, gains, seed)
        return placed(replace(made, largest_error=largest), robot)

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        """Return x(s), whose rate at s = 0 is J v."""
        raise NotImplementedError

    def size(self, error: float) -> float:
        """Return ‖e‖ for an error of that size."""
        return error

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        """Check the plotted coordinates: here those of the task."""
        x = self.coordinates(task, motion)(0.0)
        np.testing.assert_allclose(actual, x, rtol=0, atol=1e-14)
        np.testing.assert_allclose(reference - actual, e, rtol=0, atol=1e-14)


@dataclass(frozen=True)
class Position(Family):
    frame: str
    axes: str = "xyz"

    @property
    def rows(self) -> int:  # type: ignore[override]
        return len(self.axes)

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        target = self.coordinates(None, motion)(0.0)
        target = target + error * unit(np.random.default_rng(seed), self.rows)
        return self.task(wobble(target), gains)

    def task(self, target: Any, gains: Gains) -> Task:
        return FramePosition(
            self.frame, target, gains=gains, axes=self.axes, name="here"
        )

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        indices = ["xyz".index(axis) for axis in self.axes]
        return lambda s: motion.placement(s, self.frame).translation[indices]


@dataclass(frozen=True)
class Orientation(Family):
    frame: str
    rows = 3

    def placement(self, motion: Motion, s: float) -> pin.SE3:
        return motion.placement(s, self.frame)

    def reference(
        self, motion: Motion, error: float, rng: np.random.Generator
    ) -> hsp.trajectories.OrientationTrajectory:
        R = self.placement(motion, 0.0).rotation
        return Tumble(R @ pin.exp3(-error * unit(rng, 3)))

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        reference = self.reference(motion, error, np.random.default_rng(seed))
        return FrameOrientation(self.frame, reference, gains=gains)

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        R = self.placement(motion, 0.0).rotation
        return lambda s: pin.log3(self.placement(motion, s).rotation @ R.T)

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        R = self.placement(motion, 0.0).rotation
        check_quaternions(reference, actual, R, e)


@dataclass(frozen=True)
class Pose(Orientation):
    rows = 6

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        rng = np.random.default_rng(seed)
        x = self.placement(motion, 0.0).translation
        turned = self.reference(motion, error, rng)
        moved = wobble(x + error * unit(rng, 3))
        return FramePose(
            self.frame, hsp.trajectories.ComposedPose(moved, turned), gains=gains
        )

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        turned = super().coordinates(task, motion)
        return lambda s: np.concatenate(
            [self.placement(motion, s).translation, turned(s)]
        )

    def size(self, error: float) -> float:
        return np.sqrt(2.0) * error

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        placement = self.placement(motion, 0.0)
        np.testing.assert_allclose(
            actual[:3], placement.translation, rtol=0, atol=1e-14
        )
        np.testing.assert_allclose((reference - actual)[:3], e[:3], rtol=0, atol=1e-14)
        check_quaternions(reference[3:], actual[3:], placement.rotation, e[3:])


@dataclass(frozen=True)
class ToolPose(Pose):
    """The pose of a frame, its position along the axes of the desired frame."""

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        task: Any = super().make(robot, motion, error, gains, seed)
        return replace(task, along="tool")


@dataclass(frozen=True)
class Seen(Pose):
    """The pose of one frame in another's axes."""

    reference_frame: str = ""

    def placement(self, motion: Motion, s: float) -> pin.SE3:
        seen_from = motion.placement(s, self.reference_frame)
        return seen_from.actInv(motion.placement(s, self.frame))

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        pose = super().make(robot, motion, error, gains, seed)
        return RelativePose(
            self.frame, pose.trajectory, reference=self.reference_frame, gains=gains
        )


@dataclass(frozen=True)
class Mass(Position):
    """The centre of mass."""

    frame: str = ""

    def task(self, target: Any, gains: Gains) -> Task:
        return CenterOfMass(target, gains=gains, axes=self.axes)

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        model, data = motion.robot.model, motion.robot.model.createData()
        indices = ["xyz".index(axis) for axis in self.axes]
        return lambda s: pin.centerOfMass(model, data, motion.configuration(s))[indices]


@dataclass(frozen=True)
class Direction(Family):
    """Pointing; the reference is constant, tumbles, or spins about its own
    direction."""

    frame: str
    axis: tuple[float, float, float]
    motion_of_reference: str
    rows = 2
    largest = 2.5
    stride = 0.01  # the coordinates end at pi

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        rng = np.random.default_rng(seed)
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        m = motion.placement(0.0, self.frame).rotation @ axis
        angle = rng.uniform(-np.pi, np.pi)
        n = np.array([np.cos(angle), np.sin(angle), 0.0]) * np.sin(error)
        n[2] = np.cos(error)
        # A rotation R_d with R_dᵀ m = n, rotated about m by any angle.
        turn = pin.exp3(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        R_d = frame_along(m) @ turn @ frame_along(n).T
        reference = {
            "still": hsp.trajectories.HoldOrientation(R_d),
            "tumbling": Tumble(R_d),
            "spinning": Spinning(R_d),
        }[self.motion_of_reference]
        return Pointing(self.frame, axis=self.axis, trajectory=reference, gains=gains)

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        """Return the rotation in the frame's axes, along two fixed perpendicular
        ones."""
        R = motion.placement(0.0, self.frame).rotation
        across = rows_in_the_frame(task, motion)
        return lambda s: (
            across @ pin.log3(R.T @ motion.placement(s, self.frame).rotation)
        )

    def size(self, error: float) -> float:
        return np.tan(0.5 * error)

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        m = motion.placement(0.0, self.frame).rotation @ axis
        np.testing.assert_allclose(actual, m, rtol=0, atol=1e-14)
        assert np.linalg.norm(reference) == pytest.approx(1.0, abs=1e-14)
        R_d = task.trajectory.sample(TIME).rotation
        np.testing.assert_allclose(reference, R_d[:, 2], rtol=0, atol=1e-15)
        angle = np.arctan2(
            np.linalg.norm(np.cross(reference, actual)), reference @ actual
        )
        assert np.linalg.norm(e) == pytest.approx(np.tan(0.5 * angle), rel=1e-12)


class Spinning(hsp.trajectories.OrientationTrajectory):
    """Rotates about its own third axis at 1.7 rad/s: the direction is constant."""

    start: Matrix

    def sample(
        self, t: float, out: hsp.trajectories.OrientationSample | None = None
    ) -> hsp.trajectories.OrientationSample:
        out = hsp.trajectories.OrientationSample.allocate() if out is None else out
        spin = pin.exp3(np.array([0.0, 0.0, 1.7 * (t - TIME)]))
        out.rotation[:] = self.start @ spin
        out.angular_velocity[:] = 1.7 * self.start[:, 2]
        out.angular_acceleration[:] = 0.0
        return out


@dataclass(frozen=True)
class Posture(Family):
    joints: tuple[str, ...] | None
    moves: bool
    rows: int = field(default=0)

    def make(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        names = single_joints(robot) if self.joints is None else self.joints
        indices = [robot.velocity_index(joint).start for joint in names]
        wanted = error * unit(np.random.default_rng(seed), len(indices))
        moved = wobble(0.1 * np.arange(len(indices)) - 0.2) if self.moves else None
        # The rest of the reference is arbitrary: here the robot's pose.
        shift = np.zeros(robot.nv)
        shift[indices] = wanted
        if moved is not None:
            shift[indices] -= moved.sample(TIME).position
        reference = pin.integrate(robot.model, motion.q, shift)
        return JointPosture(
            reference, gains=gains, displacement=moved, joints=self.joints
        )

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        model = motion.robot.model
        indices = [motion.robot.velocity_index(j).start for j in task.joints]
        return lambda s: pin.difference(model, motion.q, motion.configuration(s))[
            indices
        ]

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        robot = motion.robot
        indices = [robot.velocity_index(joint).start for joint in task.joints]
        positions = pin.difference(robot.model, robot.neutral(), motion.q)[indices]
        np.testing.assert_allclose(actual, positions, rtol=0, atol=1e-14)
        np.testing.assert_allclose(reference - actual, e, rtol=0, atol=1e-14)


def single_joints(robot: Robot) -> list[str]:
    """Return the single-DOF joints."""
    joints = list(zip(robot.model.names, robot.model.joints, strict=True))[1:]
    return [name for name, joint in joints if joint.nv == 1]


def check_quaternions(reference: Array, actual: Array, R: Array, e: Array) -> None:
    """Check two unit quaternions of one hemisphere against R and R_d = R exp(e)."""
    assert reference @ actual >= 0.0
    for quaternion, rotation in ((actual, R), (reference, R @ pin.exp3(e))):
        assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-14)
        found = pin.Quaternion(quaternion).toRotationMatrix()
        np.testing.assert_allclose(found, rotation, rtol=0, atol=1e-13)


def rows_in_the_frame(task: Any, motion: Motion) -> Array:
    """Return C with J = C Rᵀ J_w, shape (2, 3): the pointing task's rows."""
    frame = task.frame
    state = motion.robot.state(TIME, motion.q, motion.v)
    J_w = pin.computeFrameJacobian(
        motion.robot.model,
        motion.robot.model.createData(),
        motion.q,
        motion.robot.frame_id(frame),
        pin.ReferenceFrame.LOCAL,
    )[3:]
    return task.evaluate(state).jacobian @ np.linalg.pinv(J_w)


@dataclass(frozen=True)
class Case:
    """A member on a robot."""

    robot: str
    family: Any
    root: str | None = None

    def __str__(self) -> str:
        family = self.family
        labels = [type(family).__name__.lower()]
        for key in ("axes", "motion_of_reference"):
            if text := getattr(family, key, ""):
                labels.append(text)
        if isinstance(family, Posture):
            labels.append("moving" if family.moves else "still")
            labels.append("some" if family.joints else "all")
        return "-".join([self.robot, *([self.root] if self.root else []), *labels])


TOOL, HAND = (0.0, 0.0, 1.0), (0.3, -2.0, 0.9)
CASES = [
    *(
        Case(robot, Position(FRAMES[robot], axes))
        for robot, axes in (
            ("planar3r", "xy"),
            ("planar3r", "y"),
            ("panda", "xyz"),
            ("panda", "zx"),
            ("iiwa14", "x"),
            ("iiwa14", "yz"),
            ("ur5", "zyx"),
            ("kinova", "xyz"),
            ("tiago_no_hand", "xyz"),
        )
    ),
    *(
        Case(robot, family(FRAMES[robot]), root)
        for family in (Orientation, Pose)
        for robot, root in (
            ("panda", None),
            ("iiwa14", None),
            ("ur5", None),
            ("kinova", None),
            ("tiago_no_hand", None),
            ("ur5", "free_flyer"),
            ("ur5", "planar"),
        )
    ),
    *(
        Case(robot, Direction(FRAMES[robot], axis, reference))
        for robot, axis, reference in (
            ("panda", TOOL, "still"),
            ("panda", HAND, "tumbling"),
            ("panda", TOOL, "spinning"),
            ("iiwa14", HAND, "still"),
            ("ur5", HAND, "tumbling"),
            ("kinova", TOOL, "tumbling"),
            ("tiago_no_hand", HAND, "spinning"),
        )
    ),
    *(
        Case(robot, Seen(FRAMES[robot], reference_frame=frame), root)
        for robot, frame, root in (
            ("panda", "panda_link1", None),
            ("tiago_no_hand", "base_link", None),
            ("ur5", "base_link", "free_flyer"),
        )
    ),
    Case("planar3r", Mass(axes="xy")),
    Case("panda", Mass(axes="yz")),
    Case("tiago_no_hand", Mass(axes="xy"), "planar"),
    Case("ur5", Mass(axes="xyz"), "free_flyer"),
    Case("ur5", Mass(axes="yx"), "planar"),
    Case("planar3r", Posture(None, False)),
    Case("planar3r", Posture(None, True)),
    Case("planar3r", Posture(("joint3", "joint1"), True)),
    Case("panda", Posture(None, True)),
    Case("panda", Posture(("panda_joint4", "panda_joint2"), False)),
    Case("iiwa14", Posture(None, False)),
    Case("ur5", Posture(None, True), "planar"),
    Case("kinova", Posture(None, True)),
    Case("tiago_no_hand", Posture(None, False)),
    Case("tiago_no_hand", Posture(("wheel_left_joint", "arm_2_joint"), True)),
]
every_task = pytest.mark.parametrize("case", CASES, ids=str)


def place(case: Case, seed: int) -> Motion:
    """Return a motion through a random state where the task's rows are independent."""
    robot, rng = load(case.robot, case.root), np.random.default_rng(seed)
    for _ in range(100):
        q, v = robot.random_configuration(rng), 0.7 * rng.normal(size=robot.nv)
        motion = Motion(robot, q, v, np.zeros(robot.nv))
        task = case.family.build(robot, motion, 0.1, GAINS, seed)
        J = task.evaluate(robot.state(TIME, q, v)).jacobian
        if np.linalg.svd(J)[1][-1] > 0.15:
            return motion
    raise AssertionError("no configuration away from singularities")
