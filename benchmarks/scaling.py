"""Measure how the cost of a step grows with joints, tasks, fields and obstacles.

    make bench          or          .venv-peers/bin/python benchmarks/scaling.py

Points are medians over interleaved rounds over many robot states; TSID is timed
where it is comparable. t = a + b n^p is fitted to each series. Writes
results/speed.md and its figure. To add a series, write a function that yields
(n, robot, controllers) and add it to SERIES.
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator
from scipy.optimize import curve_fit
from shared.marked_sections import FIGURES, RESULTS
from shared.timing import Compute, State, step_times

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.companions.plots import new_figure, save_for_a_column, styled
from hsp_control.companions.plots.palette import SERIES as SERIES_COLORS
from hsp_control.engine.plans import planned
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import (
    InverseCondition,
    JointCentering,
    LimitBarrier,
    Manipulability,
    ObstacleClearance,
    Rest,
    TargetPosture,
)
from hsp_control.trajectories import ComposedPose, HoldOrientation, TrajectorySample

DOCUMENT, FIGURE = RESULTS / "speed.md", FIGURES / "scaling.png"
GAINS = hsp.Gains(natural_frequency=10.0)
HAND = "panda_tcp"

Point = tuple[int, hsp.Robot, dict[str, Compute]]


@dataclass
class Law:
    """This law as a user calls it: (t, q, v) ↦ tau."""

    controller: hsp.Controller

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the effort."""
        return self.controller.compute(t, q, v).tau


# ------------------------------------------------------------------------- the series


def joints() -> Iterator[Point]:
    """Chains of 3 to 40 joints: a position of the tip, and a posture."""
    for n in (3, 5, 7, 10, 14, 20, 28, 40):
        robot = chain(n)
        yield n, robot, beside_tsid(robot, [f"link{n}"])


def tasks() -> Iterator[Point]:
    """A chain of 40 joints: 1 to 6 positions of three rows."""
    robot = chain(40)
    for n in range(1, 7):
        yield n, robot, beside_tsid(robot, [f"link{40 - 6 * k}" for k in range(n)])


def fields() -> Iterator[Point]:
    """A Panda's pose with 0 to 5 fields."""
    robot = hsp.Robot.load("panda")
    available: list[hsp.NullSpaceField] = [
        JointCentering(),
        LimitBarrier(),
        TargetPosture(robot.home()),
        Manipulability(HAND),
        InverseCondition(HAND),
    ]
    for n in range(len(available) + 1):
        field: hsp.NullSpaceField = Rest()
        if n:
            field = sum(available[1:n], start=1.0 * available[0])
        yield n, robot, {"this law": Law(panda_pose(robot, field))}


def obstacles() -> Iterator[Point]:
    """A Panda's pose with 0 to 50 moving balls, one in five of them near."""
    robot, rng = hsp.Robot.load("panda"), np.random.default_rng(0)
    balls = []
    for k in range(50):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        away = 0.55 if k % 5 == 0 else 1.2
        center = [away * np.cos(angle), away * np.sin(angle), rng.uniform(0.2, 0.9)]
        path = hsp.Circle(0.05, 1.0, center, normal=[0.0, 0.0, 1.0])
        balls.append(hsp.Obstacle(f"ball{k}", Sphere(0.1), path))
    posture = TargetPosture(robot.home())
    for n in (0, 1, 2, 5, 10, 20, 35, 50):
        field: hsp.NullSpaceField = posture
        if n:
            field = posture + 0.05 * ObstacleClearance(balls[:n])
        yield n, robot, {"this law": Law(panda_pose(robot, field))}


def levels() -> Iterator[Point]:
    """A chain of 40 joints: 1 to 5 levels of one position; and with a conflict.

    In conflict: a task of the lowest level wants another value of the first position,
    so that the law needs its recursion over the levels.
    """
    robot = chain(40)
    frames = [f"link{40 - 6 * k}" for k in range(5)]
    paths = circles(robot, frames)
    positions = [
        hsp.FramePosition(frame, path, gains=GAINS, priority=k + 1)
        for k, (frame, path) in enumerate(zip(frames, paths, strict=True))
    ]
    away = hsp.Hold(np.asarray(paths[0].center) + 0.3)
    conflicting = hsp.FramePosition(frames[0], away, gains=GAINS, name="conflicting")
    posture = TargetPosture(bent(robot))

    def law(tasks: list[hsp.FramePosition]) -> Law:
        return Law(hsp.Controller(robot, tasks, posture, singularity_threshold=1e-3))

    for n in range(1, 6):
        upper = positions[:n]
        conflict = [*upper, replace(conflicting, priority=n)]
        yield n, robot, {"this law": law(upper), "in conflict": law(conflict)}


SERIES: dict[str, Callable[[], Iterator[Point]]] = {
    "joints": joints,
    "tasks": tasks,
    "fields": fields,
    "obstacles": obstacles,
    "levels": levels,
}


# ---------------------------------------------------------------- robots, controllers


def chain(n: int) -> hsp.Robot:
    """Return an arm of n joints with alternating axes z, x and y, 2 m long."""
    length = 2.0 / n
    text = '<robot name="chain"><link name="link0"/>'
    for k in range(1, n + 1):
        axis = ("0 1 0", "0 0 1", "1 0 0")[k % 3]
        text += (
            f'<joint name="joint{k}" type="revolute"><parent link="link{k - 1}"/>'
            f'<child link="link{k}"/><origin xyz="0 0 {length}"/><axis xyz="{axis}"/>'
            '<limit lower="-2.9" upper="2.9" effort="500" velocity="5"/></joint>'
            f'<link name="link{k}"><inertial><mass value="{8.0 / n}"/>'
            f'<origin xyz="0 0 {0.5 * length}"/><inertia ixx="0.02" iyy="0.02" '
            'izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"chain{n}.urdf"
        file.write_text(text + "</robot>")
        return hsp.Robot.load(file)


def bent(robot: hsp.Robot) -> Array:
    """Return a posture far from singular."""
    return robot.integrate(robot.neutral(), 0.3 * np.ones(robot.nv))


def circles(robot: hsp.Robot, frames: list[str]) -> list[hsp.Circle]:
    """Return a small circle through the position of each frame."""
    state = robot.state(0.0, bent(robot), np.zeros(robot.nv))
    return [
        hsp.Circle(0.05, 2.0, state.position(frame), normal=[0.0, 0.0, 1.0])
        for frame in frames
    ]


def beside_tsid(robot: hsp.Robot, frames: list[str]) -> dict[str, Compute]:
    """Return this law and, if it is installed, TSID with positions of frames."""
    paths = circles(robot, frames)
    positions = [
        hsp.FramePosition(frame, path, gains=GAINS)
        for frame, path in zip(frames, paths, strict=True)
    ]
    posture = TargetPosture(bent(robot))
    controller = hsp.Controller(
        robot,
        positions,
        posture,
        null_space_gain=10.0,
        singularity_threshold=1e-3,  # compare the law without damping
    )
    law = Law(controller)
    found: dict[str, Compute] = {"this law": law}
    with suppress(ImportError):
        found["TSID"] = tsid_positions(robot, frames, paths)
    return found


def tsid_positions(
    robot: hsp.Robot, frames: list[str], paths: list[hsp.Circle]
) -> Compute:
    """Return TSID: a masked pose task for every frame, posture and effort bounds."""
    import tsid

    model, nv, zero = robot.model, robot.nv, np.zeros(robot.nv)
    wrapper = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", wrapper, False)
    problem.computeProblemData(0.0, bent(robot), zero)
    positions, samples, desired, followers = [], [], [], []
    for frame, path in zip(frames, paths, strict=True):
        task = tsid.TaskSE3Equality(frame, wrapper, frame)
        task.useLocalFrame(False)
        task.setKp(100.0 * np.ones(6))
        task.setKd(20.0 * np.ones(6))
        task.setMask(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
        problem.addMotionTask(task, 1.0, 1, 0.0)
        positions.append(task)
        samples.append(tsid.TrajectorySample(12, 6))
        desired.append(TrajectorySample.allocate(3))
        followers.append(planned(path.calls(desired[-1])).run)
    posture = tsid.TaskJointPosture("posture", wrapper)
    posture.setKp(10.0 * np.ones(nv))
    posture.setKd(11.0 * np.ones(nv))
    problem.addMotionTask(posture, 1e-3, 1, 0.0)
    bounds = tsid.TaskActuationBounds("effort", wrapper)
    bounds.setBounds(-500.0 * np.ones(nv), 500.0 * np.ones(nv))
    problem.addActuationTask(bounds, 1.0, 0, 0.0)
    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    still = tsid.TrajectorySample(nv)
    still.value(bent(robot))
    still.derivative(zero)
    place = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    rate, rate_dot = np.zeros(6), np.zeros(6)

    def compute(t: float, q: Array, v: Array) -> Array:
        for task, sample, out, follow in zip(
            positions, samples, desired, followers, strict=True
        ):
            follow(t)
            place[:3], rate[:3], rate_dot[:3] = out
            sample.value(place)
            sample.derivative(rate)
            sample.second_derivative(rate_dot)
            task.setReference(sample)
        posture.setReference(still)
        solution = solver.solve(problem.computeProblemData(t, q, v))
        if solution.status != 0:
            raise RuntimeError(f"TSID found no solution at t = {t:.4f} s")
        return problem.getActuatorForces(solution)

    compute.kept = (wrapper, positions, posture, bounds)  # type: ignore[attr-defined]
    return compute


def panda_pose(robot: hsp.Robot, field: hsp.NullSpaceField) -> hsp.Controller:
    """Return this law for a pose of the hand and a field."""
    frame = robot.state(0.0, robot.home(), np.zeros(robot.nv)).frame(HAND)
    pose = ComposedPose(
        hsp.Circle(0.05, 2.0, frame.position, normal=[0.0, 0.0, 1.0]),
        HoldOrientation(frame.rotation),
    )
    task = hsp.FramePose(HAND, pose, gains=GAINS)
    return hsp.Controller(robot, [task], field, null_space_gain=10.0)


# --------------------------------------------------------------------------- measuring


def states(robot: hsp.Robot, count: int) -> list[State]:
    """Return random states near the robot's home or flexed posture."""
    rng = np.random.default_rng(1)
    start = bent(robot) if robot.name.startswith("chain") else robot.home()
    return [
        (
            1e-3 * k,
            robot.integrate(start, 0.05 * rng.standard_normal(robot.nv)),
            0.1 * rng.standard_normal(robot.nv),
        )
        for k in range(count)
    ]


def measure(
    series: Callable[[], Iterator[Point]], rounds: int, block: int
) -> dict[str, Array]:
    """Return rows (n, median, lower and upper quartile [µs]) for each controller."""
    found: dict[str, list[tuple[float, ...]]] = {}
    for n, robot, controllers in series():
        path = states(robot, 5 * block)
        times = step_times(controllers, path, rounds, block, warm_up=block)
        for name, taken in times.items():
            low, middle, high = 1e6 * np.quantile(taken, [0.25, 0.5, 0.75])
            found.setdefault(name, []).append((n, middle, low, high))
            print(f"  {n:3d}  {name}: {middle:.1f} us", flush=True)
    return {name: np.array(rows) for name, rows in found.items()}


def growth(rows: Array) -> tuple[float, float, float]:
    """Return a, b and p of the fit t = a + b n^p to the rows with n ≥ 1."""
    n, t = rows[rows[:, 0] > 0, :2].T
    start = (t[0], max((t[-1] - t[0]) / n[-1], 1e-3), 1.0)
    bounds = ([0.0, 0.0, 0.3], [np.inf, np.inf, 3.0])
    (a, b, p), _ = curve_fit(_growth, n, t, start, bounds=bounds, sigma=t)
    return float(a), float(b), float(p)


def _growth(n: Array, a: float, b: float, p: float) -> Array:
    return a + b * n**p


# ---------------------------------------------------------------------------- writing

TEXT = """\
# How the cost of a step grows

Written by `make bench` (`benchmarks/scaling.py`); do not edit.

One `Controller.compute(t, q, v)` [µs], medians over {rounds} interleaved rounds of
{block} steps on one core, and the fitted t = a + b nᵖ, n ≥ 1.
Near a singularity a step takes more (Jacobi's method), up to the levels *in conflict*.
Ratios are valid for other machines, microseconds are not.

![Time of a step against joints, tasks and more](../../docs/figures/scaling.png)

"""
ABOUT = {
    "joints": "A position task (3 rows) at the tip of a chain, and a posture",
    "tasks": "Positions of a chain of 40 joints, 3 rows each, and a posture",
    "fields": "A Panda's pose; centering, limit barrier, posture, manipulability and "
    "inverse condition, in this order; the last two differentiate Jacobians, which "
    "determines the exponent",
    "levels": "Positions of a chain of 40 joints, one per level; in conflict: with a "
    "conflicting task for the first one at the lowest level",
    "obstacles": "A Panda's pose, posture, and moving balls against its 12 capsules",
}


def table(what: str, found: dict[str, Array]) -> str:
    """Return the table of a series with its fits."""
    first = next(iter(found.values()))
    head = "".join(f" {n:.0f} |" for n in first[:, 0])
    text = f"## {what.capitalize()}\n\n{ABOUT.get(what, '')}.\n\n"
    text += f"| controller |{head} fit |\n|---|"
    text += (len(first) + 1) * "--:|" + "\n"
    for name, rows in found.items():
        a, b, p = growth(rows)
        cells = "".join(f" {t:.1f} |" for t in rows[:, 1])
        text += f"| {name} |{cells} {a:.1f} + {b:.2g} n^{p:.2f} |\n"
    if "TSID" in found:
        ratio = found["this law"][:, 1] / found["TSID"][:, 1]
        text += "| ratio |" + "".join(f" {r:.2f} |" for r in ratio) + " |\n"
    return text + "\n"


def draw(everything: dict[str, dict[str, Array]]) -> None:
    """Draw the figure with one panel per series, of rows that begin with n, t."""
    styles = {
        "this law": (SERIES_COLORS[0], "-", "o"),
        "TSID": (SERIES_COLORS[1], "--", "s"),
        "in conflict": (SERIES_COLORS[2], ":", "^"),
    }
    with styled():
        figure = new_figure(4.6, 6.0)
        panels = figure.subplots(3, 2).ravel()
        for axes, (what, found) in zip(panels, everything.items(), strict=False):
            for name, rows in found.items():
                color, dashes, marker = styles[name]
                axes.plot(rows[:, 0], rows[:, 1], marker, color=color, ms=4.5)
                n = np.linspace(max(rows[0, 0], 1.0), rows[-1, 0], 100)
                a, b, p = growth(rows)
                label = f"{name}: as n$^{{{p:.1f}}}$"
                axes.plot(n, a + b * n**p, dashes, color=color, lw=1.5, label=label)
            top = max(rows[:, 1].max() for rows in found.values())
            axes.set(xlabel=what, ylim=(0.0, (1.15 + 0.13 * len(found)) * top))
            axes.xaxis.set_major_locator(
                MaxNLocator(6, steps=[1, 2, 5, 10], integer=True)
            )
            axes.legend(loc="upper left")
        for axes in panels[::2]:
            axes.set_ylabel("one step [µs]")
        for axes in panels[len(everything) :]:
            axes.set_axis_off()
            for name, (color, dashes, marker) in styles.items():
                axes.plot([], [], dashes, marker=marker, color=color, label=name)
            axes.legend(loc="center", title="medians, and their fit\n$t = a + b\\,n^p$")
        save_for_a_column(figure, FIGURE)


def written() -> dict[str, dict[str, Array]]:
    """Return the medians in the page's tables: rows (n, t) of each controller."""
    found: dict[str, dict[str, Array]] = {}
    for section in DOCUMENT.read_text(encoding="utf-8").split("\n## ")[1:]:
        table = [
            [cell.strip() for cell in line.strip("|").split("|")]
            for line in section.splitlines()
            if line.startswith("| ")
        ]
        counts = np.array(table[0][1:-1], dtype=float)
        found[section.splitlines()[0].lower()] = {
            name: np.column_stack([counts, np.array(times[:-1], dtype=float)])
            for name, *times in table[1:]
            if name != "ratio"
        }
    return found


def main() -> None:
    """Measure every series, print the times, and write page and figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=21, help="rounds of timing")
    parser.add_argument("--block", type=int, default=100, help="steps in a round")
    parser.add_argument(
        "--draw",
        action="store_true",
        help="only redraw the page's figures, measure nothing",
    )
    options = parser.parse_args()
    if options.draw:
        draw(written())
        return
    everything = {}
    for what, series in SERIES.items():
        print(what, flush=True)
        everything[what] = measure(series, options.rounds, options.block)
    text = TEXT.format(rounds=options.rounds, block=options.block)
    tables = [table(what, found) for what, found in everything.items()]
    DOCUMENT.write_text(text + "".join(tables))
    draw(everything)


if __name__ == "__main__":
    main()
