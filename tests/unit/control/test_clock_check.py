"""Implausible times of a loop are reported once."""

import re
import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from wording import wording

import hsp_control as hsp
from hsp_control.control.clock_check import ClockWarning

H = 0.002


def reported(times: Sequence[float], period: float = H) -> list[str]:
    """Return the messages about the clock of a loop."""
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [hsp.FramePosition()])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for t in times:
            output = controller.compute(t, robot.home(), np.zeros(7))
            controller.applied(output.tau, period)
            controller.applied(output.tau, period)  # the effort that was sent instead
    return [str(each.message) for each in caught if each.category is ClockWarning]


STEPS = H * np.arange(40)


@pytest.mark.parametrize(
    ("times", "period", "message"),
    [
        (1e3 * STEPS, H, "... advances by 2 s ... 0.002 s"),
        (1e9 * STEPS, H, "... advances by 2e+06 s"),
        (STEPS, 2.0, "... advances by 0.002 s ... 2 s"),
        (-STEPS, H, "... runs back: t = -0.01 s ... -0.002 s"),
        (np.zeros(200), H, "... stands still at t = 0 s"),
        (np.append(STEPS, STEPS), H, "... runs back: t = 0 s ... -0.078 s"),
        # every second step, so that no two in a row run back
        (
            np.where(np.arange(40) % 2, STEPS - 3 * H, STEPS),
            H,
            "... runs back ... -0.004",
        ),
    ],
)
def test_a_clock_of_something_else_is_reported_once(
    times: Sequence[float], period: float, message: str
) -> None:
    (found,) = reported(times, period)
    assert re.search(wording(message), found)


def test_a_state_with_an_absolute_clock_time_is_reported() -> None:
    """Times count from the first step."""
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [hsp.FramePosition()])
    state = robot.state(1.76e9, robot.home(), np.zeros(7))
    with pytest.warns(ClockWarning, match=r"has t = 1760000000 s, but .* call"):
        controller.compute(state)


def test_a_change_at_an_absolute_clock_time_is_reported() -> None:
    """The change would never begin; a robot at rest for a day is no clock error."""
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [hsp.FramePosition(name="hand")])
    controller.compute(1.76e9, robot.home(), np.zeros(7))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ClockWarning)
        controller.at(86400.0).null_space_gain(5.0)
    message = r"at t = 1760000001 s begins in 20370 days: times count from the first"
    with pytest.warns(ClockWarning, match=message) as caught:
        controller.at(1.76e9 + 1.0).null_space_gain(5.0)
    assert caught[0].filename == __file__


def test_ordinary_delays_of_a_loop_are_no_clock_error() -> None:
    """Late or repeated steps, steps after a pause, and any start time are accepted."""
    rng = np.random.default_rng(0)
    late = STEPS + H * rng.uniform(-0.4, 0.4, STEPS.size)
    twice = np.repeat(STEPS, 2)
    pause = np.concatenate([STEPS, 60.0 + STEPS])
    slow = np.cumsum(rng.choice([H, 30 * H], STEPS.size))
    rehearsed = np.concatenate([np.zeros(50), STEPS])
    for times in (STEPS, rehearsed, late, twice, pause, slow, 1.76e9 + STEPS):
        assert reported(times) == []


def test_the_integrators_stages_are_no_clock() -> None:
    """Times go back and forth; no effort is held."""
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [hsp.FramePosition()])
    with warnings.catch_warnings():
        warnings.simplefilter("error", ClockWarning)
        for t in (0.0, 0.5, 0.25, 0.25, 0.0, 0.5, *(a for a, _ in pairwise(STEPS))):
            controller.compute(t, robot.home(), np.zeros(7))


def moved(unit: float, noise: float = 0.0, *, kind: str = "numbers") -> list[str]:
    """Return the messages of a loop whose robot moves, or rests with noise of v."""
    rng = np.random.default_rng(2)
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [hsp.FramePosition()])
    still = np.zeros(7) if noise else np.linspace(-0.5, 0.4, 7)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for t in np.arange(300) * 1e-3:
            q = robot.home() + t * still + noise * 1e-3 * rng.normal(size=7)
            v = still + noise * rng.normal(size=7)
            if kind == "state":
                controller.compute(robot.state(unit * t, q, v))
            else:
                controller.compute(unit * t, q, v)
    return [str(each.message) for each in caught if each.category is ClockWarning]


@pytest.mark.parametrize("kind", ["numbers", "state"])
def test_times_in_milliseconds_are_reported_once_by_compute_alone(
    kind: str,
) -> None:
    (found,) = moved(1000.0, kind=kind)
    assert re.search(r"the last step 1 s: milliseconds\? Times are in s", found)
    assert moved(1.0, kind=kind) == []


def test_a_robot_that_rests_shows_no_unit() -> None:
    for unit in (1.0, 1000.0):
        assert moved(unit, noise=0.2) == []


MOVED_BY: dict[str, Callable[[hsp.Controller, np.ndarray], object]] = {
    "target": lambda made, x: made.set_target("hand", x),
    "velocity": lambda made, x: made.set_velocity("hand", 0.1 * x),
    "message": lambda made, x: made.stream("hand").send(x),
    "chunk": lambda made, x: made.stream("hand").send_chunk([x], [0.1]),
    "change": lambda made, x: made.at(made.state.t).reference("hand", hsp.Hold(x)),
}


@pytest.mark.parametrize("by", MOVED_BY)
def test_the_unit_is_seen_when_the_robot_moves_after_a_long_rest(by: str) -> None:
    """At rest the check is skipped, so that it costs no time."""
    robot = hsp.Robot.load("panda")
    task = hsp.FramePosition(name="hand")
    if by in ("message", "chunk"):
        task = hsp.FramePosition(trajectory=hsp.Stream(), name="hand")
    controller = hsp.Controller(robot, [task])
    motion, v = controller._memory.motion, np.full(7, 0.2)
    for k in range(320):
        controller.compute(float(k), robot.home(), np.zeros(7))
    assert not motion.undecided
    target = robot.state(0.0, robot.home(), v).position("panda_tcp")
    MOVED_BY[by](controller, target)
    assert motion.undecided

    def move() -> None:
        for k in range(40):
            q = robot.home() + k * 1e-3 * v
            controller.compute(320.0 + k, q, v)

    with pytest.warns(ClockWarning, match="milliseconds"):
        move()


@pytest.mark.parametrize(
    ("unit", "name"),
    [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")],
)
def test_times_in_another_unit_are_reported_without_a_period(
    unit: float, name: str
) -> None:
    """Nothing is applied: positions and velocities show the unit."""
    robot = hsp.Robot.load("panda")
    controller, v = hsp.Controller(robot, [hsp.FramePosition()]), 0.1 * np.ones(7)

    def run() -> None:
        for k in range(60):
            controller.compute(unit * H * k, robot.home() + H * k * v, v)

    with pytest.warns(ClockWarning, match=f"{name}[?] Times are in s") as caught:
        run()
    assert len(caught) == 1


def in_motion(times: Sequence[float], *, way: Sequence[float] = ()) -> list[str]:
    """Return the messages where nothing is applied, and the robot moves in each step.

    ``way``: the times by which it has moved [s]; by default it moves on steadily.
    """
    rng = np.random.default_rng(3)
    robot = hsp.Robot.load("panda")
    controller, v = hsp.Controller(robot, [hsp.FramePosition()]), 0.1 * np.ones(7)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for k, t in enumerate(times):
            s = way[k] if len(way) else H * k
            noisy = v + 0.01 * rng.normal(size=7)
            controller.compute(t, robot.home() + s * v, noisy)
    return [str(each.message) for each in caught if each.category is ClockWarning]


LONG = H * np.arange(500)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        (-LONG, "runs back: t = -0.0"),
        (0.0 * LONG, "stands still at t = 0 s, while the robot moves on"),
        (np.append(LONG, LONG[-1] + 0.0 * LONG), "stands still at t = 0.998 s"),
        (np.append(LONG, LONG), "runs back: t = 0 s came -0.998 s after"),
        (np.append(LONG, LONG - 0.5), "runs back: t = -0.5 s came -1.5 s after"),
        (LONG - 0.04 * (np.arange(500) // 10), "runs back: t = -0.02 s came -0.038 s"),
        # back by three periods, forward by five, and so on
        (np.where(np.arange(500) % 2, LONG - 3 * H, LONG), "runs back: t = 0.0"),
    ],
)
def test_a_clock_is_compared_with_the_motion_without_a_period(
    times: Sequence[float], message: str
) -> None:
    """At any time of a run, and once."""
    (found,) = in_motion(times)
    assert message in found


def test_a_repeated_state_hides_no_jump() -> None:
    steps = np.repeat(np.arange(1000), 1 + (np.arange(1000) % 25 == 0))
    (found,) = in_motion(np.append(LONG, LONG)[steps], way=H * steps)
    assert "runs back: t = 0 s came -0.998 s after" in found


def test_an_analysis_of_a_motion_is_no_clock_error() -> None:
    """A log that is read backwards, a state at many times, many states at one time."""
    still, back = 0.0 * LONG, LONG[::-1]
    anywhere = np.random.default_rng(4).uniform(-3.0, 3.0, LONG.size)
    assert in_motion(back, way=back) == []
    assert in_motion(LONG, way=still) == []
    assert in_motion(back, way=still) == []
    assert in_motion(still, way=anywhere) == []
    assert in_motion(anywhere, way=anywhere) == []


@pytest.mark.parametrize("times", [-STEPS, 0.0 * STEPS, np.append(STEPS, STEPS[:10])])
def test_a_recorder_says_why_it_records_nothing(times: Sequence[float]) -> None:
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [hsp.FramePosition()])

    def run() -> None:
        with hsp.Recorder(controller) as recorder:
            for t in times:
                recorder.record(controller.compute(t, robot.home(), np.zeros(7)))

    with pytest.warns(ClockWarning, match="recorded at later times only") as caught:
        run()
    assert len(caught) == 1
