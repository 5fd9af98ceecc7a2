"""Streamed targets: tracking, delay and the change of efforts.

    .venv/bin/python benchmarks/streams.py

A Panda under the same law, efforts held for 1 ms, limits on; targets arrive late, some
never. Beside the policies of `hsp.Stream`: a zero-order hold of the newest target, and
linear interpolation after the same delay, both without bounds. Writes a table into
benchmarks/results/streams.md.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.trajectories import Trajectory, TrajectorySample

DURATION, PERIOD = 8.0, 0.001  # [s]
BEGIN = 1.0  # measured from here on [s]


class Arrival(NamedTuple):
    """A message: when it arrives, when it was made, and its content."""

    at: float
    made: float
    times: Array
    values: Array


class Case(NamedTuple):
    """A kind of stream: the motion that it follows, its messages, and the delay."""

    name: str
    truth: Callable[[float], Array]
    arrivals: list[Arrival]
    delay: float
    smoothing: float


class Received(Trajectory):
    """Usual alternatives: the newest target held, or lines between targets, delayed."""

    begin: Any = None
    lines: bool = False
    delay: float = 0.0
    heard: Any = None  # of one list of (time, value), which grows

    @property
    def dimension(self) -> int:
        """The number of coordinates."""
        return len(self.begin)

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the reference; its acceleration is always zero."""
        out = self._output(out)
        out.velocity[:] = out.acceleration[:] = 0.0
        points = self.heard[0]
        if not self.lines:
            out.position[:] = points[-1][1]
            return out
        k = bisect_right([time for time, _ in points], t - self.delay)
        if k in {0, len(points)}:
            out.position[:] = points[max(k - 1, 0)][1]
            return out
        (t0, x0), (t1, x1) = points[k - 1], points[k]
        out.velocity[:] = (x1 - x0) / (t1 - t0)
        out.position[:] = x0 + (t - self.delay - t0) * out.velocity
        return out


def hand_path(t: float) -> Array:
    """Return where the hand should be: a figure of eight at up to 0.3 m/s [m]."""
    s = 1.5 * t - np.sin(1.5 * t) * np.exp(-t)  # begins slowly
    return np.array([0.4, 0.15 * np.sin(s), 0.45 + 0.08 * np.sin(2.0 * s)])


def goals(rng: np.random.Generator) -> Iterator[Arrival]:
    """Yield goals at 20 Hz, 20 ± 10 ms late, 5 % of them lost."""
    for made in np.arange(0.0, DURATION, 0.05):
        if rng.random() > 0.05:
            at = made + 0.02 + rng.uniform(-0.01, 0.01)
            yield Arrival(at, made, np.zeros(1), hand_path(made)[None])


def tracked(rng: np.random.Generator) -> Iterator[Arrival]:
    """Yield a tracked hand at 60 Hz with 2 mm of noise, 10 ± 5 ms late."""
    for made in np.arange(0.0, DURATION, 1 / 60):
        noisy = hand_path(made) + rng.normal(scale=2e-3, size=3)
        at = made + 0.01 + rng.uniform(-0.005, 0.005)
        yield Arrival(at, made, np.zeros(1), noisy[None])


HOME = hsp.Robot.load("panda").home()


def arm_path(t: float) -> Array:
    """Return a posture, which swings by 0.3 rad."""
    phases = np.arange(7) * 0.7
    swing = np.sin(1.2 * t + phases) - np.sin(phases)
    return np.asarray(HOME + 0.3 * swing * (1.0 - np.exp(-t)))


def chunks(rng: np.random.Generator) -> Iterator[Arrival]:
    """Yield chunks of 16 postures at 10 Hz, 30 ms apart, up to 70 mrad off."""
    times = np.arange(16) * 0.03
    for made in np.arange(0.0, DURATION, 0.1):
        seam = rng.uniform(-0.035, 0.035, size=7)
        values = np.array([arm_path(made + each) for each in times]) + seam
        yield Arrival(made + 0.02 + rng.uniform(0.0, 0.02), made, times, values)


def in_order(arrivals: Iterator[Arrival]) -> list[Arrival]:
    """Return messages in the order in which they arrive."""
    return sorted(arrivals, key=lambda each: each.at)


def controller_of(case: Case, reference: Trajectory) -> hsp.Controller:
    """Return the controller that follows a reference; with the common field."""
    robot = hsp.Robot.load("panda")
    task: hsp.Task
    if len(case.truth(0.0)) == 3:
        task = hsp.FramePosition("panda_tcp", reference, name="followed")
    else:
        task = hsp.JointPosture(np.zeros(7), displacement=reference, name="followed")
    return hsp.Controller(robot, [task], hsp.JointCentering(), null_space_gain=8.0)


def start_of(case: Case) -> Array:
    """Return a configuration with the hand where the motion begins."""
    robot = hsp.Robot.load("panda")
    if len(case.truth(0.0)) != 3:
        return robot.home()
    task = hsp.FramePosition("panda_tcp", hsp.Hold(case.truth(0.0)))
    controller = hsp.Controller(robot, [task])
    run = hsp.simulate(controller, robot.home(), duration=3.0, control_period=PERIOD)
    return np.asarray(run.q[-1])


def followed(case: Case, way: str) -> tuple[str, ...]:
    """Return a row of the table: one way to follow a stream."""
    q0, left = start_of(case), list(case.arrivals)
    points: list[tuple[float, Array]] = [(-1.0, case.truth(0.0))]
    if way in {"zero-order hold", "linear"}:
        lines = way == "linear"
        reference: Trajectory = Received(case.truth(0.0), lines, case.delay, [points])
    else:
        reference = hsp.Stream(
            policy=way.split(",")[0],
            delay=case.delay,
            smoothing=case.smoothing if "smoothed" in way else 0.0,
        )
    controller, rows = controller_of(case, reference), iter(range(10**9))

    def deliver(recorder: object) -> None:
        t = PERIOD * next(rows)
        while left and left[0].at <= t:
            _, made, times, values = left.pop(0)
            if isinstance(reference, hsp.Stream):
                one = len(times) == 1
                stream = controller.stream(reference)
                send = stream.send if one else stream.send_chunk
                send(*((values[0],) if one else (values, times)), t=made)
                continue
            late = case.arrivals[0].at - case.arrivals[0].made
            held = values if way == "linear" else values[:1]
            del points[bisect_right([p[0] for p in points], made + late) :]
            points.extend(
                (made + late + each, value)
                for each, value in zip(times, held, strict=False)
            )

    run = hsp.simulate(
        controller,
        q0,
        duration=DURATION - 0.5,
        control_period=PERIOD,
        log_period=PERIOD,
        on_row=deliver,
    )
    return case.name, way, *figures(case, run)


def figures(case: Case, run: hsp.Rollout) -> tuple[str, ...]:
    """Return delay, error at this delay, and the change of efforts."""
    actual, t = run["task.followed.actual"], run.t
    late = t > BEGIN

    def error(delay: float) -> float:
        wanted = np.array([case.truth(each - delay) for each in t[late][::5]])
        return float(np.sqrt(np.mean((actual[late][::5] - wanted) ** 2)))

    delays = np.arange(0.0, 0.4, 0.005)
    errors = [error(delay) for delay in delays]
    best = int(np.argmin(errors))
    change = np.abs(np.diff(run.tau[late], axis=0))
    return (
        f"{1e3 * delays[best]:.0f}",
        f"{1e3 * errors[best]:.2f}",
        f"{np.sqrt(np.mean(change**2)) / PERIOD:.0f}",
        f"{change.max():.2f}",
        f"{100 * np.mean(run['status'][late] >= 2):.0f}",
    )


def main() -> None:
    """Follow all streams in all ways, and write the table."""
    rng = np.random.default_rng(0)
    cases = [
        Case("goals, 20 Hz", hand_path, in_order(goals(rng)), 0.12, 0.0),
        Case("tracked hand, 60 Hz", hand_path, in_order(tracked(rng)), 0.14, 0.1),
        Case("chunks, 10 Hz", arm_path, in_order(chunks(rng)), 0.05, 0.0),
    ]
    ways = ["zero-order hold", "linear", "latest", "interpolate", "extrapolate"]
    head = (
        "| stream | reference | delay [ms] | error [mm or mrad] | change of efforts, "
        "rms [N·m/s] | largest in 1 ms [N·m] | limited steps [%] |\n"
        "|---|---|--:|--:|--:|--:|--:|\n"
    )
    lines = []
    for case in cases:
        smoothed = ["interpolate, smoothed"] if case.smoothing else []
        for way in ways + smoothed:
            row = followed(case, way)
            print(*row, sep="  ", flush=True)
            lines.append(f"| {' | '.join(row)} |\n")
    replace_section(RESULTS / "streams.md", "streams.py", head + "".join(lines))


if __name__ == "__main__":
    main()
