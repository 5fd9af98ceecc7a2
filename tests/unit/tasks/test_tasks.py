"""Tasks: J, J' and e' against differences, and their error's law at large errors.

Everything is compared with what plain Pinocchio says of the motion
q(s) = q ⊕ (s v + ½ s² a) at the times t + s: differences of eighth order in s, whose
step is a fixed part of the motion's own time scale, so that their error is rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsp_control import (
    AngularMomentum,
    CenterOfMass,
    Controller,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Pointing,
    RelativePose,
    Robot,
    Task,
    ToolFrame,
    simulate,
)
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    GainError,
    HspControlError,
    JointNotFoundError,
    ShapeError,
    TaskError,
)
from hsp_control.tasks import TaskSample
from hsp_control.trajectories import (
    ComposedPose,
    HoldOrientation,
    HoldPose,
    Lissajous,
    OrientationSample,
    OrientationTrajectory,
)

pytestmark = pytest.mark.filterwarnings("error")
Array = NDArray[np.float64]

TIME = 0.7  # [s], when all is looked at
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


@cache
def load(name: str, root: Any = None) -> Robot:
    """Return a robot, or skip if example-robot-data is asked for and not there."""
    if name not in BUNDLED:
        pytest.importorskip("example_robot_data")
    return Robot.load(name, root=root)


# --- what is known without the package -----------------------------------------------

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


class Tumble(OrientationTrajectory):
    """R(τ) = exp(f a) exp(g b) R0 with f, g parabolas: w and w' are not parallel."""

    __slots__ = ("start", "time")
    a = np.array([0.6, -0.3, 0.5])
    b = np.array([-0.2, 0.8, 0.4])

    def __init__(self, start: Array, time: float = TIME) -> None:
        self.start = np.array(start)
        self.time = time

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        out = OrientationSample.allocate() if out is None else out
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


def wobble(position: Array) -> Lissajous:
    """Return a motion that passes through a point at `TIME`."""
    n = len(position)
    amplitudes, rates = 0.2 + 0.1 * np.arange(n), 1.3 + 0.4 * np.arange(n)
    phases = 0.3 * np.arange(n) + 0.2
    away = amplitudes * np.sin(rates * TIME + phases)
    return Lissajous(position - away, amplitudes, rates, phases)


# --- the members ---------------------------------------------------------------------


class Family:
    """How to build a kind of task with a known error, and to measure it without it."""

    largest = 3.0  # rad or m
    stride = 0.03  # of differences in the error, as a part of the motion's time scale
    rows: int

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        """Return the task whose error at (TIME, q) has the size ``error``."""
        raise NotImplementedError

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        """Return x(s), whose rate at s = 0 is J v."""
        raise NotImplementedError

    def size(self, error: float) -> float:
        """Return ‖e‖ for an error of that size."""
        return error

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        """Check the coordinates that a person would plot."""
        raise NotImplementedError


@dataclass(frozen=True)
class Position(Family):
    frame: str
    axes: str = "xyz"

    @property
    def rows(self) -> int:  # type: ignore[override]
        return len(self.axes)

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        target = self.coordinates(None, motion)(0.0)
        target = target + error * unit(np.random.default_rng(seed), self.rows)
        return FramePosition(
            robot, self.frame, wobble(target), gains, axes=self.axes, name="here"
        )

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        indices = ["xyz".index(axis) for axis in self.axes]
        return lambda s: motion.placement(s, self.frame).translation[indices]

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        x = self.coordinates(task, motion)(0.0)
        np.testing.assert_allclose(actual, x, rtol=0, atol=1e-14)
        np.testing.assert_allclose(reference - actual, e, rtol=0, atol=1e-14)


@dataclass(frozen=True)
class Orientation(Family):
    frame: str
    rows = 3

    def placement(self, motion: Motion, s: float) -> pin.SE3:
        return motion.placement(s, self.frame)

    def reference(
        self, motion: Motion, error: float, rng: np.random.Generator
    ) -> OrientationTrajectory:
        R = self.placement(motion, 0.0).rotation
        return Tumble(R @ pin.exp3(-error * unit(rng, 3)))

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        reference = self.reference(motion, error, np.random.default_rng(seed))
        return FrameOrientation(robot, self.frame, reference, gains)

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

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        rng = np.random.default_rng(seed)
        x = self.placement(motion, 0.0).translation
        turned = self.reference(motion, error, rng)
        moved = wobble(x + error * unit(rng, 3))
        return FramePose(robot, self.frame, ComposedPose(moved, turned), gains)

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
class Seen(Pose):
    """The pose of one frame in another's axes."""

    reference_frame: str = ""

    def placement(self, motion: Motion, s: float) -> pin.SE3:
        seen_from = motion.placement(s, self.reference_frame)
        return seen_from.actInv(motion.placement(s, self.frame))

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        pose = super().build(robot, motion, error, gains, seed)
        return RelativePose(
            robot, self.frame, self.reference_frame, pose.trajectory, gains
        )


@dataclass(frozen=True)
class Mass(Family):
    """The centre of mass."""

    axes: str = "xyz"

    @property
    def rows(self) -> int:  # type: ignore[override]
        return len(self.axes)

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        target = self.coordinates(None, motion)(0.0)
        target = target + error * unit(np.random.default_rng(seed), self.rows)
        return CenterOfMass(robot, wobble(target), gains, axes=self.axes)

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        model, data = motion.robot.model, motion.robot.model.createData()
        indices = ["xyz".index(axis) for axis in self.axes]
        return lambda s: pin.centerOfMass(model, data, motion.configuration(s))[indices]

    def check_measure(
        self, task: Any, motion: Motion, reference: Array, actual: Array, e: Array
    ) -> None:
        x = self.coordinates(task, motion)(0.0)
        np.testing.assert_allclose(actual, x, rtol=0, atol=1e-14)
        np.testing.assert_allclose(reference - actual, e, rtol=0, atol=1e-14)


@dataclass(frozen=True)
class Direction(Family):
    """Pointing; the reference is still, tumbles, or spins about what it points at."""

    frame: str
    axis: tuple[float, float, float]
    motion_of_reference: str
    rows = 2
    largest = 2.5
    stride = 0.01  # the coordinates end at pi

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        rng = np.random.default_rng(seed)
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        m = motion.placement(0.0, self.frame).rotation @ axis
        angle = rng.uniform(-np.pi, np.pi)
        n = np.array([np.cos(angle), np.sin(angle), 0.0]) * np.sin(error)
        n[2] = np.cos(error)
        # A rotation R_d with R_dᵀ m = n, turned about m by any angle.
        turn = pin.exp3(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        R_d = frame_along(m) @ turn @ frame_along(n).T
        reference = {
            "still": HoldOrientation(R_d),
            "tumbling": Tumble(R_d),
            "spinning": Spinning(R_d),
        }[self.motion_of_reference]
        return Pointing(robot, self.frame, self.axis, reference, gains)

    def coordinates(self, task: Any, motion: Motion) -> Callable[[float], Array]:
        """Return the turn in the frame's own axes, along two fixed ones across."""
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
        m = motion.placement(0.0, self.frame).rotation @ task.axis
        np.testing.assert_allclose(actual, m, rtol=0, atol=1e-14)
        assert np.linalg.norm(reference) == pytest.approx(1.0, abs=1e-14)
        R_d = task.trajectory.sample(TIME).rotation
        np.testing.assert_allclose(reference, R_d[:, 2], rtol=0, atol=1e-15)
        angle = np.arctan2(
            np.linalg.norm(np.cross(reference, actual)), reference @ actual
        )
        assert np.linalg.norm(e) == pytest.approx(np.tan(0.5 * angle), rel=1e-12)


class Spinning(OrientationTrajectory):
    """Turns about its own third axis at 1.7 rad/s: the direction stands still."""

    __slots__ = ("start",)

    def __init__(self, start: Array) -> None:
        self.start = np.array(start)

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        out = OrientationSample.allocate() if out is None else out
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

    def build(
        self, robot: Robot, motion: Motion, error: float, gains: Gains, seed: int
    ) -> Task:
        names = single_joints(robot) if self.joints is None else self.joints
        indices = [robot.velocity_index(joint).start for joint in names]
        wanted = error * unit(np.random.default_rng(seed), len(indices))
        moved = wobble(0.1 * np.arange(len(indices)) - 0.2) if self.moves else None
        # The rest of the reference is anything: here, where the robot is.
        shift = np.zeros(robot.nv)
        shift[indices] = wanted
        if moved is not None:
            shift[indices] -= moved.sample(TIME).position
        reference = pin.integrate(robot.model, motion.q, shift)
        return JointPosture(
            robot, reference, gains, displacement=moved, joints=self.joints
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
    """Return the joints of one freedom."""
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
    """Return C with J = C Rᵀ J_w, shape (2, 3): the pointing task's own rows."""
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
    Case("planar3r", Mass("xy")),
    Case("panda", Mass("yz")),
    Case("tiago_no_hand", Mass("xy"), "planar"),
    Case("ur5", Mass("xyz"), "free_flyer"),
    Case("ur5", Mass("yx"), "planar"),
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


@every_task
def test_the_rows_move_as_the_robot_does(case: Case) -> None:
    """J v and J' are the rates of the rows' coordinates and of J itself.

    Differences of eighth order leave 1e-11 here, most of it truncation.
    """
    for seed in (1, 2):
        motion = place(case, seed)
        robot = motion.robot
        task = case.family.build(robot, motion, 0.5, GAINS, seed)
        state = robot.state(TIME, motion.q, motion.v)
        sample = task.evaluate(state)
        assert sample.jacobian.shape == (task.rows, robot.nv)
        rate = motion.derivative(case.family.coordinates(task, motion))
        np.testing.assert_allclose(sample.jacobian @ motion.v, rate, rtol=0, atol=1e-10)

        def jacobian(s: float, motion: Motion = motion, task: Task = task) -> Array:
            q = motion.configuration(s)
            return task.evaluate(motion.robot.state(TIME + s, q, motion.v)).jacobian

        np.testing.assert_allclose(
            sample.jacobian_dot, motion.derivative(jacobian), rtol=0, atol=1e-10
        )


@pytest.mark.parametrize("case", [c for c in CASES if isinstance(c.family, Direction)])
def test_pointing_rows_are_fixed_in_the_frame(case: Case) -> None:
    """The same two orthonormal directions across the axis, wherever the robot is."""
    motion, other = place(case, 3), place(case, 4)
    task: Any = case.family.build(motion.robot, motion, 0.5, GAINS, 3)
    C = rows_in_the_frame(task, motion)
    np.testing.assert_allclose(C @ C.T, np.eye(2), rtol=0, atol=1e-13)
    axis = np.array(case.family.axis) / np.linalg.norm(case.family.axis)
    np.testing.assert_allclose(task.axis, axis, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.cross(*C), axis, rtol=0, atol=1e-13)
    np.testing.assert_allclose(rows_in_the_frame(task, other), C, rtol=0, atol=1e-13)


def gains_of(kind: str, rows: int, seed: int) -> tuple[Gains, Array, Array]:
    """Return gains and what they stand for; the matrices are not symmetric."""
    rng = np.random.default_rng(seed)
    if kind == "scalar":
        return GAINS, 25.0 * np.eye(rows), 10.0 * np.eye(rows)
    if kind == "per row":
        kp, kv = rng.uniform(15.0, 35.0, rows), rng.uniform(8.0, 12.0, rows)
        return Gains(kp, kv), np.diag(kp), np.diag(kv)
    kp = 25.0 * np.eye(rows) + rng.uniform(-2.5, 2.5, (rows, rows))
    kv = 12.0 * np.eye(rows) + rng.uniform(-1.0, 1.0, (rows, rows))
    return Gains(kp, kv), kp, kv


@pytest.mark.parametrize(
    ("part", "gains"),
    [(0.0, "matrix"), (0.03, "per row"), (1 / 3, "matrix"), (1.0, "scalar"),
     (1.0, "matrix")],
)  # fmt: skip
@every_task
def test_the_law_of_the_error(case: Case, part: float, gains: str) -> None:
    """With J a + J'v = a_x the reported error obeys e'' + Kv e' + Kp e = 0.

    At errors up to 3 rad or m (2.5 rad for pointing), in motion, with any motion in
    the null space. What is left, 5e-10 of e, is the rounding of second differences
    (1e-16/h² with h = 0.5 to 10 ms) and 1e-11 of what Kp e alone amounts to.
    """
    seed = 11
    motion = place(case, seed)
    robot, rng = motion.robot, np.random.default_rng(seed)
    rows = case.family.build(robot, motion, 0.1, GAINS, seed).rows
    chosen, Kp, Kv = gains_of(gains, rows, seed)
    error = part * case.family.largest
    task = case.family.build(robot, motion, error, chosen, seed)
    sample = task.evaluate(robot.state(TIME, motion.q, motion.v))
    assert np.linalg.norm(sample.error) == pytest.approx(
        case.family.size(error), rel=1e-9, abs=1e-14
    )

    J, wanted = sample.jacobian, sample.acceleration
    inverse = np.linalg.pinv(J)
    a = rng.normal(size=robot.nv)
    a += inverse @ (wanted - sample.jacobian_dot @ motion.v - J @ a)
    motion = Motion(robot, motion.q, motion.v, a, case.family.stride)

    def reported(s: float) -> Array:
        # The error is a function of (t, q): any velocity will do.
        state = robot.state(TIME + s, motion.configuration(s), motion.v)
        return task.evaluate(state).error

    e = sample.error
    e_dot = motion.derivative(reported)
    e_ddot = motion.derivative(reported, SECOND)
    size = 1.0 + np.abs(e_dot).max() + np.abs(e).max()
    np.testing.assert_allclose(sample.error_rate, e_dot, rtol=0, atol=3e-10 * size)
    np.testing.assert_allclose(e_ddot, -Kv @ e_dot - Kp @ e, rtol=0, atol=5e-9 * size)


@every_task
def test_reference_rate_is_the_motion_of_who_stays_on_the_reference(case: Case) -> None:
    """At e = 0, a robot with J v = reference_rate has e' = 0."""
    motion = place(case, 5)
    robot = motion.robot
    task = case.family.build(robot, motion, 0.0, GAINS, 5)
    state = robot.state(TIME, motion.q, motion.v)
    rate = task.reference_rate(state)
    J = task.evaluate(state).jacobian
    assert rate.shape == (task.rows,)
    state = robot.state(TIME, motion.q, np.linalg.pinv(J) @ rate)
    sample = task.evaluate(state)
    np.testing.assert_allclose(sample.error, 0.0, rtol=0, atol=2e-15 * 10)
    np.testing.assert_allclose(sample.error_rate, 0.0, rtol=0, atol=1e-13)
    # Only rates that depend on the robot's place may change with it, and none does
    # with its velocity.
    np.testing.assert_array_equal(task.reference_rate(state), rate)
    if not isinstance(case.family, Direction):
        elsewhere = robot.state(TIME, robot.neutral(), motion.v)
        np.testing.assert_array_equal(task.reference_rate(elsewhere), rate)
    moving = getattr(case.family, "moves", True) and (
        getattr(case.family, "motion_of_reference", "") not in {"still", "spinning"}
    )
    assert (np.linalg.norm(rate) > 0.01) == moving


@every_task
def test_measure(case: Case) -> None:
    """Reference and actual, as a person would plot them; beyond half a turn too."""
    for seed, part in ((6, 0.2), (7, 1.0)):
        motion = place(case, seed)
        error = part * case.family.largest
        task = case.family.build(motion.robot, motion, error, GAINS, seed)
        state = motion.robot.state(TIME, motion.q, motion.v)
        e = task.evaluate(state).error
        reference, actual = task.measure(state)
        case.family.check_measure(task, motion, reference, actual, e)


@every_task
def test_evaluate_writes_where_it_is_told_and_has_no_memory(case: Case) -> None:
    """The same state gives the same bits, whatever was evaluated between."""
    motion, other = place(case, 8), place(case, 9)
    robot = motion.robot
    task = case.family.build(robot, motion, 1.0, GAINS, 8)
    here = robot.state(TIME, motion.q, motion.v)
    first = task.evaluate(here)
    out = TaskSample(*(np.full_like(array, np.nan) for array in first))
    assert task.evaluate(robot.state(0.1, other.q, other.v), out) is out
    assert task.evaluate(here, out) is out
    for name, kept, written in zip(TaskSample._fields, first, out, strict=True):
        np.testing.assert_array_equal(kept, written, err_msg=name)
        assert not np.shares_memory(kept, written)


# --- near half a turn ----------------------------------------------------------------

near_pi = st.one_of(
    st.floats(0.0, 2.0 * np.pi),
    st.floats(0.0, 16.0).map(lambda k: np.pi - 10.0**-k),
    st.floats(0.0, 16.0).map(lambda k: np.pi + 10.0**-k),
    st.just(np.pi),
)
directions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 3)
    .map(np.array)
    .filter(lambda a: np.linalg.norm(a) > 1e-3)
    .map(lambda a: a / np.linalg.norm(a))
)


@cache
def panda_state() -> Any:
    """Return the Panda in motion, away from singularities."""
    motion = place(Case("panda", Pose("panda_tcp")), 12)
    return motion.robot.state(TIME, motion.q, motion.v)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(near_pi, directions)
@example(np.pi, np.array([1.0, 0.0, 0.0]))
@example(np.pi, np.array([0.0, 1.0, 0.0]))
@example(np.pi, np.array([0.0, 0.0, 1.0]))
@example(np.pi, np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0))
@example(0.0, np.array([0.0, 0.0, 1.0]))
def test_orientation_through_half_a_turn(angle: float, axis: Array) -> None:
    """The error is at most pi long, its rate and the acceleration are bounded.

    ‖Jlog‖ ≤ pi/2 up to pi, so |e'| ≤ pi/2 |w̃|; a few hundred rad/s² at these gains.
    """
    state = panda_state()
    R = state.frame("panda_tcp").rotation
    reference = Tumble(R @ pin.exp3(-angle * axis))
    task = FrameOrientation(state.robot, "panda_tcp", reference, GAINS)
    sample = task.evaluate(state)
    assert np.linalg.norm(sample.error) <= np.pi * (1 + 1e-15)
    shortest = min(angle, 2.0 * np.pi - angle)
    assert np.linalg.norm(sample.error) == pytest.approx(shortest, abs=1e-14)
    w = state.frame("panda_tcp").velocity[3:] - reference.sample(TIME).angular_velocity
    assert np.linalg.norm(sample.error_rate) <= 0.5 * np.pi * np.linalg.norm(w) + 1e-12
    assert np.abs(sample.acceleration).max() < 500.0


@settings(max_examples=300, deadline=None, derandomize=True)
@given(near_pi, st.floats(-np.pi, np.pi), st.sampled_from(["still", "tumbling"]))
@example(np.pi, 0.0, "still")
@example(np.pi, 0.0, "tumbling")
@example(np.pi, 1.0, "tumbling")
def test_pointing_through_the_antipode(angle: float, side: float, kind: str) -> None:
    """Never NaN; |e| is tan(angle/2) as long as 1 + cos(angle) ≥ 0.02, √99 beyond.

    The terms of second order reach 30 |n'|², with |n'| up to 3 rad/s here.
    """
    state = panda_state()
    m = state.frame("panda_tcp").rotation[:, 2]
    across = np.array([np.cos(side), np.sin(side), 0.0])
    n = np.sin(angle) * across + np.array([0.0, 0.0, np.cos(angle)])
    R_d = frame_along(m) @ frame_along(n / np.linalg.norm(n)).T
    reference = Tumble(R_d) if kind == "tumbling" else HoldOrientation(R_d)
    task = Pointing(state.robot, "panda_tcp", TOOL, reference, GAINS)
    sample = task.evaluate(state)
    assert all(np.isfinite(array).all() for array in sample)
    length = np.linalg.norm(sample.error)
    if 1.0 + np.cos(angle) > 0.0201:
        expected = abs(np.tan(0.5 * angle))
        assert length == pytest.approx(expected, rel=1e-12, abs=1e-14)
    if 1.0 + np.cos(angle) < 0.0199:
        assert length == pytest.approx(np.sqrt(99.0), rel=1e-12)
        assert np.linalg.norm(sample.error_rate) < 3.0 / 0.02
    assert np.abs(sample.acceleration).max() < 300.0


def test_pointing_exactly_opposite() -> None:
    """To the last bit: any way is as good, so the length is told, and no NaN."""
    robot = planar()
    opposite = HoldOrientation(np.diag([1.0, -1.0, -1.0]))
    task = Pointing(robot, "tip", TOOL, opposite, GAINS)
    for v in (np.zeros(3), np.ones(3)):
        sample = task.evaluate(robot.state(0.0, robot.neutral(), v))
        np.testing.assert_array_equal(
            task.measure(robot.state(0, robot.neutral(), v))[1], TOOL
        )
        assert np.linalg.norm(sample.error) == pytest.approx(np.sqrt(99.0), rel=1e-12)
        assert all(np.isfinite(array).all() for array in sample)


@pytest.mark.parametrize("degrees", [150.0, 170.0, 179.0])
def test_pointing_is_led_back_from_near_the_antipode(degrees: float) -> None:
    """From rest, along the great circle; never to the wrong pole."""
    robot, q0 = panda(), panda().home()
    here = robot.state(0.0, q0, np.zeros(7)).frame("panda_tcp").rotation[:, 2].copy()
    angle = np.radians(degrees)
    seen = np.array([np.sin(angle), 0.0, np.cos(angle)])
    wanted = HoldOrientation(frame_along(here) @ frame_along(seen).T)
    task = Pointing(robot, "panda_tcp", TOOL, wanted, Gains.from_frequency(3.0))
    run = simulate(Controller(robot, [task]), q0, duration=8.0, log_period=0.1)
    n = run["task.panda_tcp_pointing.actual"] @ wanted.rotation
    angles = np.arctan2(np.hypot(n[:, 0], n[:, 1]), n[:, 2])
    assert angles[0] == pytest.approx(angle, abs=1e-12)
    assert (np.diff(angles) < 0.0).all()
    assert angles[-1] < 1e-3
    np.testing.assert_allclose(n[:, 1], 0.0, rtol=0, atol=1e-7)


# --- errors --------------------------------------------------------------------------


def panda() -> Robot:
    return load("panda")


def planar() -> Robot:
    return load("planar3r")


def posture(robot: Robot, **options: Any) -> JointPosture:
    return JointPosture(robot, robot.neutral(), GAINS, **options)


def pose(robot: Robot, frame: str) -> FramePose:
    return FramePose(robot, frame, HoldPose(pin.SE3.Identity()), GAINS)


HOLD = HoldOrientation(np.eye(3))
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    "frame of a position": (
        lambda: FramePosition(panda(), "panda_tpc", Hold([0, 0, 0]), GAINS),
        FrameNotFoundError,
        r"no frame 'panda_tpc'; did you mean 'panda_tcp'\?",
    ),
    "frame of an orientation": (
        lambda: FrameOrientation(panda(), "hand", HOLD, GAINS),
        FrameNotFoundError,
        r"^no frame 'hand'; did you mean 'panda_hand'\?",
    ),
    "frame of a pose": (
        lambda: pose(panda(), "nowhere"),
        FrameNotFoundError,
        r"^no frame 'nowhere' \(the model has universe",
    ),
    "frame of a pointing": (
        lambda: Pointing(panda(), "panda_hnad", TOOL, HOLD, GAINS),
        FrameNotFoundError,
        r"did you mean 'panda_hand'",
    ),
    "twice the same axis": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0, 0]), GAINS, axes="xx"),
        TaskError,
        r"^axes 'xx': name distinct axes among x, y and z$",
    ),
    "no axis": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0]), GAINS, axes=""),
        TaskError,
        r"^axes '': name distinct axes",
    ),
    "another axis": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0]), GAINS, axes=["u"]),
        TaskError,
        r"^axes 'u': name distinct axes",
    ),
    "dimension of the trajectory": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0, 0]), GAINS),
        TaskError,
        r"^task 'panda_tcp' tracks the axes 'xyz'; its trajectory has dimension 2, "
        r"needs 3$",
    ),
    "more rows than freedoms": (
        lambda: pose(planar(), "tip"),
        TaskError,
        r"^task 'tip' has 6 rows; planar3r has 3 freedoms$",
    ),
    "name": (
        lambda: FramePosition(
            panda(), "panda_tcp", Hold([0, 0, 0]), GAINS, name="the hand"
        ),
        TaskError,
        r"^task name 'the hand': use letters, digits, '_' and '-'",
    ),
    "no direction": (
        lambda: Pointing(panda(), "panda_tcp", [0, 0, 0], HOLD, GAINS),
        TaskError,
        r"^axis \[0, 0, 0\] is not a direction: needs 3 numbers$",
    ),
    "direction of two numbers": (
        lambda: Pointing(panda(), "panda_tcp", [1, 0], HOLD, GAINS),
        TaskError,
        r"^axis \[1, 0\] is not a direction",
    ),
    "infinite direction": (
        lambda: Pointing(panda(), "panda_tcp", [1, 0, np.inf], HOLD, GAINS),
        TaskError,
        r"is not a direction",
    ),
    "joint": (
        lambda: posture(panda(), joints=["panda_joint8"]),
        JointNotFoundError,
        r"^no joint 'panda_joint8'; did you mean 'panda_joint\d'\?",
    ),
    "root": (
        lambda: posture(load("ur5", "planar"), joints=["root_joint"]),
        TaskError,
        r"^joint 'root_joint' has 3 freedoms; a posture task holds joints of one",
    ),
    "no joints": (
        lambda: posture(panda(), joints=[]),
        TaskError,
        r"^task 'posture' names no joint$",
    ),
    "twice the same joint": (
        lambda: posture(panda(), joints=["panda_joint1", "panda_joint1"]),
        TaskError,
        r"^task 'posture' names joint 'panda_joint1' twice$",
    ),
    "dimension of the displacement": (
        lambda: posture(panda(), displacement=Hold([0.0, 0.0])),
        TaskError,
        r"^task 'posture' holds 7 joints; its displacement has dimension 2$",
    ),
    "shape of the reference": (
        lambda: JointPosture(planar(), [0.0, 0.0, 0.0], GAINS),
        ShapeError,
        r"^configuration q has shape \(3,\); planar3r needs \(6,\) \(nq = 6, nv = 3\)$",
    ),
    "gains of another size": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0, 0, 0]), Gains([1, 2], 1)),
        GainError,
        r"^kp has shape \(2,\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
}


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=message) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind


def test_names() -> None:
    robot = panda()
    assert pose(robot, "panda_tcp").name == "panda_tcp"
    assert FrameOrientation(robot, "panda_tcp", HOLD, GAINS).name == (
        "panda_tcp_orientation"
    )
    assert Pointing(robot, "panda_tcp", TOOL, HOLD, GAINS).name == "panda_tcp_pointing"
    assert posture(robot).name == "posture"
    assert posture(robot, name="left-arm_2").name == "left-arm_2"
    assert posture(load("ur5", "planar")).joints == tuple(
        single_joints(load("ur5", "planar"))
    )


def test_arguments_are_copied() -> None:
    """Changing what was given in changes nothing."""
    robot = planar()
    reference, kp = robot.neutral(), np.array([1.0, 2.0, 3.0])
    task = JointPosture(robot, reference, Gains(kp, 4.0))
    state = robot.state(0.0, robot.neutral(), np.zeros(3))
    reference[:] = robot.integrate(robot.neutral(), np.ones(3))
    kp[:] = 7.0
    np.testing.assert_array_equal(task.evaluate(state).error, 0.0)
    np.testing.assert_array_equal(task.Kp, np.diag([1.0, 2.0, 3.0]))


# --- gains ---------------------------------------------------------------------------


def test_gains_in_three_forms() -> None:
    for kp, kv in (
        (4.0, 5.0),
        ([4.0, 4.0], [5.0, 5.0]),
        (4 * np.eye(2), 5 * np.eye(2)),
    ):
        Kp, Kv = Gains(kp, kv).matrices(2)
        np.testing.assert_array_equal(Kp, 4.0 * np.eye(2))
        np.testing.assert_array_equal(Kv, 5.0 * np.eye(2))
    Kp, Kv = Gains([1.0, 2.0], [[3.0, 0.5], [0.1, 4.0]]).matrices(2)
    np.testing.assert_array_equal(Kp, np.diag([1.0, 2.0]))
    np.testing.assert_array_equal(Kv, [[3.0, 0.5], [0.1, 4.0]])


def test_matrices_are_copies() -> None:
    gains = Gains(np.eye(2), np.eye(2))
    gains.matrices(2)[0][:] = 7.0
    np.testing.assert_array_equal(gains.matrices(2)[0], np.eye(2))


def test_repr_of_gains_can_be_read_back() -> None:
    gains = Gains([1.0, 2.0], 3.0)
    assert repr(gains) == "Gains(kp=[1.0, 2.0], kv=3.0)"
    assert repr(eval(repr(gains))) == repr(gains)


positive = st.floats(1e-3, 1e3)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(positive, st.floats(0.05, 5.0))
def test_gains_from_frequency(frequency: float, ratio: float) -> None:
    """s² + Kv s + Kp has |s| = ω0, and real parts of -ζ ω0 in the mean."""
    Kp, Kv = Gains.from_frequency(frequency, ratio).matrices(1)
    roots = np.roots([1.0, Kv[0, 0], Kp[0, 0]])
    assert np.prod(roots).real == pytest.approx(frequency**2, rel=1e-9)
    assert np.sum(roots).real == pytest.approx(-2.0 * ratio * frequency, rel=1e-9)


def test_gains_from_frequency_defaults_and_lists() -> None:
    assert repr(Gains.from_frequency(3.0)) == "Gains(kp=9.0, kv=6.0)"
    Kp, Kv = Gains.from_frequency([2.0, 3.0], [1.0, 0.5]).matrices(2)
    np.testing.assert_array_equal(Kp, np.diag([4.0, 9.0]))
    np.testing.assert_array_equal(Kv, np.diag([4.0, 3.0]))


GAIN_ERRORS: dict[str, tuple[Callable[[], Any], str]] = {
    "negative": (lambda: Gains(-1.0, 1.0), r"^kp is -1.0; must be greater than 0$"),
    "zero": (lambda: Gains(1.0, [1.0, 0.0]), r"^kv is \[1.0, 0.0\]; must be greater"),
    "diagonal": (
        lambda: Gains([[1.0, 0.0], [0.0, -2.0]], 1.0),
        r"^kp is \[\[1.0, 0.0\], \[0.0, -2.0\]\]; must be greater than 0$",
    ),
    "nan": (lambda: Gains(np.nan, 1.0), r"^kp is nan; needs finite numbers$"),
    "infinite": (lambda: Gains(1.0, np.inf), r"^kv is inf; needs finite numbers$"),
    "not square": (
        lambda: Gains(np.ones((2, 3)), 1.0),
        r"^kp has shape \(2, 3\); a matrix gain is square$",
    ),
    "three axes": (
        lambda: Gains(np.ones((1, 1, 1)), 1.0),
        r"^kp has shape \(1, 1, 1\)",
    ),
    "empty": (lambda: Gains([], 1.0), r"^kp is empty; needs numbers$"),
    "words": (
        lambda: Gains("stiff", 1.0),
        r"^kp is 'stiff'; needs numbers, a list or a matrix$",
    ),
    "ragged": (lambda: Gains([[1.0], [1.0, 2.0]], 1.0), r"needs numbers, a list or a"),
    "none": (lambda: Gains(None, 1.0), r"^kp is (nan|None); needs"),
    "shape of kp": (
        lambda: Gains([1.0, 2.0], 1.0).matrices(3),
        r"^kp has shape \(2,\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
    "shape of kv": (
        lambda: Gains(1.0, np.eye(2)).matrices(3),
        r"^kv has shape \(2, 2\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
    "no decay": (
        lambda: Gains([[1.0, 3.0], [3.0, 1.0]], 1.0).matrices(2),
        r"^gains give an error that does not decay: .* real part 1 1/s; needs less",
    ),
    "frequency": (
        lambda: Gains.from_frequency(0.0),
        r"^natural_frequency is 0.0; must be greater than 0$",
    ),
    "ratio": (
        lambda: Gains.from_frequency(1.0, -1.0),
        r"^damping_ratio is -1.0; must be greater than 0$",
    ),
    "frequency matrix": (
        lambda: Gains.from_frequency(np.eye(2) + 1.0),
        r"^natural_frequency and damping_ratio are numbers or lists$",
    ),
    "lists of different length": (
        lambda: Gains.from_frequency([1.0, 2.0], [1.0, 1.0, 1.0]),
        r"^natural_frequency and damping_ratio: ",
    ),
}


@pytest.mark.parametrize("which", GAIN_ERRORS)
def test_errors_of_gains(which: str) -> None:
    build, message = GAIN_ERRORS[which]
    with pytest.raises(GainError, match=message):
        build()


def test_a_task_is_named_after_its_frame_as_a_column_may_be() -> None:
    frames = {"tip/1.0": ToolFrame("panda_hand")}
    robot = Robot.load("panda", tool_frames=frames)
    task = FramePosition(robot, "tip/1.0", Hold([0.4, 0, 0.4]), Gains(1, 1))
    assert task.name == "tip_1_0"


# --- angular momentum ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "root"), [("panda", None), ("iiwa14", None), ("ur5", "free_flyer")]
)
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_angular_momentum_obeys_its_first_order_equation(
    name: str, root: Any, seed: int
) -> None:
    """ℓ = A v / m is Pinocchio's; J' is dJ/dt; ℓ' = J a + J'v gives e' = -K e."""
    robot = load(name, root)
    rng = np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    v, a = rng.standard_normal((2, robot.nv))
    motion = Motion(robot, q, v, a)
    target = wobble(np.array([0.1, -0.2, 0.3]))
    task = AngularMomentum(robot, target, 7.0)
    sample = task.evaluate(robot.state(TIME, q, v))
    data, mass = robot.model.createData(), pin.computeTotalMass(robot.model)

    def rows(s: float) -> Array:
        matrix = pin.ccrba(robot.model, data, motion.configuration(s), v)
        return matrix[3:] / mass

    def momentum(s: float) -> Array:
        return rows(s) @ (v + s * a)

    np.testing.assert_allclose(sample.jacobian, rows(0.0), rtol=0, atol=1e-13)
    scale = max(1.0, float(np.abs(sample.jacobian_dot).max()))
    np.testing.assert_allclose(
        sample.jacobian_dot, motion.derivative(rows), rtol=0, atol=1e-9 * scale
    )
    rate = motion.derivative(momentum)
    np.testing.assert_allclose(
        sample.jacobian @ a + sample.jacobian_dot @ v, rate, rtol=0, atol=1e-9 * scale
    )
    # Where the law is obeyed, ℓ' = a_x, the error's rate is what the sample says.
    desired = target.sample(TIME)
    np.testing.assert_allclose(sample.error, desired.position - momentum(0.0))
    np.testing.assert_allclose(
        desired.velocity - sample.acceleration, -7.0 * sample.error, atol=1e-12
    )
    np.testing.assert_allclose(sample.error_rate, -7.0 * sample.error)
