"""Errors in a user's task or trajectory are reported at the first step."""

from asyncio import CancelledError
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np
import pytest
from task_cases import GAINS, TIME, Case, Tumble, every_task, place, wobble

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import RateError
from hsp_control.control.declared_rates import check_task, check_trajectories
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.tasks import ErrorPart, Feedback, FunctionTask, SecondOrderTask
from hsp_control.trajectories import (
    CallableTrajectory,
    OrientationSample,
    OrientationTrajectory,
    PoseSample,
    PoseTrajectory,
    Trajectory,
    TrajectorySample,
)

ROBOT = hsp.Robot.load("panda")
HOME = ROBOT.home()
Break = Callable[[TaskSample], None]


def first_step(task: hsp.Task, t: float = 0.0) -> hsp.ControlOutput:
    made = hsp.Controller(ROBOT, [task])
    made.restart(origin=0.0)
    return made.compute(t, HOME, np.zeros(7))


class Height(SecondOrderTask):
    """The height of a frame and the square of its x, with mistakes on demand."""

    wrong: Any
    trajectory: Trajectory = wobble(np.array([0.6, 0.3]))

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        return (ErrorPart("height", "m", "m/s", 1), ErrorPart("square", "m", "m/s", 1))

    def placed(self, start: Start) -> Self:
        return self.checked(start.state.robot)

    def evaluate(
        self,
        state: hsp.RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        out, feedback = self.given(state, out, feedback)
        frame, desired = state.frame("panda_tcp"), self.trajectory.sample(state.t)
        x, _, z = frame.position
        x_dot, _, z_dot = frame.velocity[:3]
        J, J_dot = frame.jacobian, frame.jacobian_dot
        out.jacobian[:] = J[2], 2.0 * x * J[0]
        out.jacobian_dot[:] = J_dot[2], 2.0 * (x * J_dot[0] + x_dot * J[0])
        out.error[:] = desired.position - [z, x * x]
        out.error_rate[:] = desired.velocity - [z_dot, 2.0 * x * x_dot]
        fed_back = self.fed_back(feedback, out.error, out.error_rate)
        out.acceleration[:] = desired.acceleration + fed_back
        self.wrong(out, state)
        return out

    def reference_rate(self, state: hsp.RobotState) -> Array:
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: hsp.RobotState) -> tuple[Array, Array]:
        x, _, z = state.position("panda_tcp")
        return self.trajectory.sample(state.t).position, np.array([z, x * x])


def right(out: TaskSample, state: hsp.RobotState) -> None:
    pass


def scaled(name: str, row: int, by: float) -> Callable[..., None]:
    def change(out: TaskSample, state: hsp.RobotState) -> None:
        getattr(out, name)[row] *= by

    return change


def damped(out: TaskSample, state: hsp.RobotState) -> None:
    out.error[0] -= 0.01 * state.v[1]


E_DOT, J_DOT = "e' = ∂e/∂q·v + ∂e/∂t", "J' = ∂J/∂q·v + ∂J/∂t"
EQUATION = "where J a + J'v = a_x, e'' = -(Kv e' + Kp e + offset)"
MISTAKES: dict[str, tuple[Callable[..., None], str]] = {
    "e'": (scaled("error_rate", 1, -1.0), f"{E_DOT} is"),
    "J'": (scaled("jacobian_dot", 1, 0.0), f"{J_DOT} is 0 of square, panda_joint"),
    "J and J'": (
        lambda out, state: (
            scaled("jacobian", 1, 1.01)(out, state),
            scaled("jacobian_dot", 1, 1.01)(out, state),
        ),
        f"{EQUATION} is",
    ),
    "a_x": (scaled("acceleration", 1, 0.98), f"{EQUATION} is"),
    "v in e": (damped, "e depends on v: "),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_wrong_task_is_named(mistake: str) -> None:
    wrong, words = MISTAKES[mistake]
    first_step(Height(right))
    with pytest.raises(RateError) as caught:
        first_step(Height(wrong))
    message = str(caught.value)
    assert message.startswith("tasks.Height: task 'Height': ")
    assert words in message
    assert mistake == "v in e" or "Height.evaluate is wrong" in message


class Bounded(Height):
    """A task whose feedback saturates at large errors."""

    def fed_back(self, feedback: Feedback, error: Array, error_rate: Array) -> Array:
        damped = feedback.Kv @ error_rate + feedback.offset
        return np.asarray(damped + feedback.Kp @ np.tanh(5.0 * error) / 5.0)


class Undeclared(Height):
    """A task with feedback that it does not declare."""

    def evaluate(
        self,
        state: hsp.RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        out, feedback = self.given(state, out, feedback)
        out = super().evaluate(state, out, feedback)
        out.acceleration[:] += feedback.Kp @ (
            np.tanh(5.0 * out.error) / 5.0 - out.error
        )
        return out


def test_a_feedback_that_is_not_linear_is_declared() -> None:
    """With `fed_back` its own equation is checked; without, it is refused."""
    task = Bounded(right)
    first_step(task)
    robot_state = ROBOT.state(0.0, HOME, np.zeros(7))
    placed = task.placed(Start(robot_state, {}))
    found, linear = (each.evaluate(robot_state) for each in (placed, Height(right)))
    assert np.abs(found.acceleration - linear.acceleration).max() > 1e-3
    with pytest.raises(RateError, match="override fed_back: it declares another"):
        first_step(Undeclared(right))
    with pytest.raises(RateError, match=r"e'' = -Bounded.fed_back\(feedback, e, e'\)"):
        first_step(Bounded(scaled("acceleration", 1, 0.98)))


def test_a_task_that_comes_later_is_checked_when_it_comes() -> None:
    made = hsp.Controller(ROBOT, [hsp.FramePosition("panda_tcp")])
    made.compute(0.0, HOME, np.zeros(7))
    late = Height(scaled("jacobian_dot", 0, -1.0), priority=2)
    with pytest.raises(RateError, match=r"^task 'Height': Height\.evaluate is wrong"):
        made.at(1.0).add(late)
    assert [each.name for each in made.tasks] == ["panda_tcp"]
    made.at(1.0).add(Height(right, priority=2))


@every_task
def test_no_task_of_the_package_is_called_wrong(case: Case) -> None:
    """Every task as a user's subclass, in motion, with errors up to the largest."""
    motion = place(case, 5)
    for error in (0.0, 0.4):
        task: Any = case.family.build(motion.robot, motion, error, GAINS, 5)
        kind = type(f"Own{type(task).__name__}", (type(task),), {"__module__": "mine"})
        own = kind(**task.all_fields())
        check_task(own, motion.robot.state(TIME, motion.q, motion.v))
        check_trajectories(own, TIME)


def y(state: hsp.RobotState) -> Array:
    x, _, z = state.position("panda_link4")
    return np.array([x * z + np.sin(2.0 * state.t) * z])


def _exact(state: hsp.RobotState) -> tuple[Array, Array, Array]:
    frame, t = state.frame("panda_link4"), state.t
    (x, _, z), (u, _, w) = frame.position, frame.velocity[:3]
    J, J_dot, s, c = frame.jacobian, frame.jacobian_dot, np.sin(2 * t), np.cos(2 * t)
    slope, turned = np.array([[z, x + s]]), np.array([[w, u + 2 * c]])
    J, J_dot = J[[0, 2]], J_dot[[0, 2]]
    return slope @ [u, w] + 2 * c * z, slope @ J, turned @ J + slope @ J_dot


class TestFunctionTask:
    given: ClassVar[dict[str, Any]] = {
        "rate_function": lambda state: _exact(state)[0],
        "jacobian_function": lambda state: _exact(state)[1],
        "jacobian_rate_function": lambda state: _exact(state)[2],
    }

    @pytest.mark.parametrize("alone", [True, False])
    @pytest.mark.parametrize("name", given)
    def test_the_wrong_function_is_named(self, name: str, alone: bool) -> None:
        task = FunctionTask(y, **({name: self.given[name]} if alone else self.given))
        first_step(task)
        wrong: dict[str, Any] = {name: lambda state: 1.01 * self.given[name](state)}
        with pytest.raises(RateError) as caught:
            first_step(replace(task, **wrong))
        message = str(caught.value)
        assert f"task 'function_task': {name} is wrong: " in message
        assert message.endswith(
            f"or leave {name} out: the package then takes differences"
        )

    def test_a_function_that_reads_v_is_named(self) -> None:
        first_step(FunctionTask(y))
        with pytest.raises(RateError, match="y depends on v: at t = 0 s"):
            first_step(FunctionTask(lambda state: y(state) + 0.1 * state.v[0]))


class Wave(Trajectory):
    """sin t in each coordinate, from a time on, with mistakes on demand."""

    wrong: str = ""
    begin: float = 0.0

    @property
    def dimension(self) -> int:
        return 3

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        out = TrajectorySample.allocate(3) if out is None else out
        s = max(t - self.begin, 0.0)
        size, factor = np.array([1.0, 2.0, 3.0]), 1.02
        out.position[:] = 0.1 * size * (s - np.sin(s))
        out.velocity[:] = 0.1 * size * (1.0 - np.cos(s))
        out.acceleration[:] = 0.1 * size * np.sin(s)
        if self.wrong:
            getattr(out, self.wrong)[1] *= factor
        return out


class Turn(OrientationTrajectory):
    """`Tumble`, with mistakes on demand."""

    wrong: str = ""

    def sample(self, t: float, out: Any = None) -> OrientationSample:
        found = Tumble(np.eye(3)).sample(t)
        if self.wrong:
            getattr(found, self.wrong)[2] *= 1.02
        return found


class Both(PoseTrajectory):
    """Both of them."""

    position: Wave
    orientation: Turn

    def sample(self, t: float, out: Any = None) -> PoseSample:
        return PoseSample(self.position.sample(t), self.orientation.sample(t))


def waves(t: float) -> Array:
    return np.array([np.sin(t), np.cos(2.0 * t)])


def wave_rates(t: float) -> Array:
    return np.array([np.cos(t), -2.0 * np.sin(2.0 * t)])


def wave_accelerations(t: float) -> Array:
    return np.array([-np.sin(t), -4.0 * np.cos(2.0 * t)])


def waves_that_end(t: float) -> Array:
    if t > 0.25:  # raised at that time, not at the check; a BaseException
        raise CancelledError
    return waves(t)


def turned(t: float) -> Array:
    return wave_rates(t) * [1.0, -1.0]


WRONG: dict[str, tuple[Any, str]] = {
    "x'": (Wave("velocity"), "Wave: Wave.sample is wrong: x' is .* of entry 1"),
    "x''": (Wave("acceleration"), "Wave: Wave.sample is wrong: x'' is .* of entry 1"),
    "after a rest": (Wave("velocity", begin=0.05), "Wave.sample is wrong: x' is"),
    "ω": (Turn("angular_velocity"), r"Turn: Turn.sample is wrong: \[ω\]× R is"),
    "ω'": (Turn("angular_acceleration"), "Turn: Turn.sample is wrong: ω' is"),
    "of a pose": (Both(Wave("velocity"), Turn()), "Both: Both.sample is wrong: x' is"),
    "inside another": (
        hsp.trajectories.Crossfade(Wave("velocity"), hsp.Hold([0.0, 0.0, 0.0])),
        "Wave: Wave.sample is wrong: x' is",
    ),
    "velocity": (
        CallableTrajectory(waves, 2, velocity=turned),
        "CallableTrajectory: velocity is wrong: x' is .* of entry 1",
    ),
    "acceleration": (
        CallableTrajectory(waves, 2, velocity=wave_rates, acceleration=turned),
        "CallableTrajectory: acceleration is wrong: x'' is",
    ),
}
FINE: dict[str, Any] = {
    "a wave": Wave(),
    "a turn": Turn(),
    "a pose": Both(Wave(), Turn()),
    "velocity": CallableTrajectory(waves, 2, velocity=wave_rates),
    "all": CallableTrajectory(
        waves, 2, velocity=wave_rates, acceleration=wave_accelerations
    ),
    "acceleration": CallableTrajectory(waves, 2, acceleration=wave_accelerations),
    "one that ends": CallableTrajectory(waves_that_end, 2, velocity=wave_rates),
    "a function": CallableTrajectory(waves, 2),
}


@pytest.mark.parametrize("mistake", WRONG)
def test_a_wrong_trajectory_is_named(mistake: str) -> None:
    wrong, words = WRONG[mistake]
    with pytest.raises(RateError, match=f"^trajectory .*{words}"):
        check_trajectories(wrong, 0.2)


@pytest.mark.parametrize("variant", FINE)
def test_a_right_trajectory_is_not_named(variant: str) -> None:
    check_trajectories(FINE[variant], 0.2)


def test_it_is_found_wherever_it_is_used() -> None:
    """In a task, for an obstacle, and in a change, with the place in the message."""
    wrong = Wave("velocity")
    with pytest.raises(RateError, match=r"^tasks\.panda_tcp: trajectory Wave: "):
        first_step(hsp.FramePosition("panda_tcp", wrong, blend=0.5))
    ball = hsp.Obstacle("ball", hsp.shapes.Sphere(0.1), wrong)
    made = hsp.Controller(ROBOT, [hsp.FramePosition("panda_tcp")], scene=[ball])
    with pytest.raises(RateError, match=r"^scene\.ball: trajectory Wave: "):
        made.compute(0.0, HOME, np.zeros(7))
    made = hsp.Controller(ROBOT, [hsp.FramePosition("panda_tcp")])
    made.compute(0.0, HOME, np.zeros(7))
    with pytest.raises(RateError, match=r"^trajectory Wave: Wave\.sample is wrong"):
        made.at(0.5).reference("panda_tcp", wrong)
