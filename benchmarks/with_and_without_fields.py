"""Run every bundled configuration with and without its null-space field.

    .venv/bin/python benchmarks/with_and_without_fields.py [NAME ...]

Runs each configuration of `configs/` as it is, and once more without its first field
(with g = 0 if there is no other), measures both the same way, times the control step
against the Pinocchio calls that every controller needs, and prints the tables. A run of
all configurations also writes benchmarks/results/configurations.md.
"""

import argparse
import json
import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin
import yaml
from rich.console import Console
from rich.markdown import Markdown
from rich.progress import Progress

from hsp_control import RobotState, Rollout, load_experiment
from hsp_control.common.arrays import Array
from hsp_control.common.resources import bundled_configs
from hsp_control.config import Experiment
from hsp_control.null_space.fields import Clearance, ObstacleClearance, SelfClearance

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "benchmarks" / "results" / "configurations.md"
ROUNDS, STEPS = 15, 200  # of timing

INTRODUCTION = """\
# Configurations, with and without their fields

Written by `.venv/bin/python benchmarks/with_and_without_fields.py`; do not edit.

Each of these is a file in `configs/` that runs by name: `hsp run panda_limits`, then
`hsp plot out/panda_limits.npz`. The second row of each table is the same run without
the field that the first row names, and without limits, which would do some of what it
does; other fields stay. The law tracks the task in both
runs; the other columns show the effect of the field.

- **tracking**: root mean square of the task error over the whole run, of the worst
  task.
- **manipulability**: smallest √det(J Jᵀ) of a controlled frame's position rows.
- **distance**: minimum signed distance of the links, as capsules, to an obstacle, or to
  each other if there are two arms; negative if they overlap.
- **limit margin**: minimum distance of a joint from its limits; negative beyond them.
- **effort**, **speed**: largest ratio of a joint's value to its limit.
- **step**: a control step from Python in units of the bare Pinocchio calls that it
  needs (`computeJointJacobiansTimeVariation`, `updateFramePlacements`, `rnea`), timed
  interleaved, median of 15 rounds.
"""


@dataclass(frozen=True)
class RunMetrics:
    """One row of a table: the measurements of one run."""

    name: str
    tracking: str
    manipulability: float
    distance: float | None
    limit_margin: str
    effort: float
    speed: float
    step: float

    def row(self) -> str:
        """Return the row of the table."""
        distance = "–" if self.distance is None else f"{self.distance:.3f} m"
        return (
            f"| {self.name} | {self.tracking} | {self.manipulability:.4f} | {distance} "
            f"| {self.limit_margin} | {self.effort:.2f} | {self.speed:.2f} "
            f"| {self.step:.1f} |"
        )


HEADER = """\
| | tracking | manipulability | distance | limit margin | effort | speed | step |
|---|--:|--:|--:|--:|--:|--:|--:|"""


# -------------------------------------------------------------------------- measuring


def without_field(name: str) -> tuple[Experiment, str]:
    """Return a configuration without its first field, and that field's type.

    It has no limits either, which would do some of what the field does.
    """
    text = bundled_configs()[name].read_text(encoding="utf-8")
    first, *others = yaml.safe_load(text)["null_space"]["fields"]
    rest = json.dumps(others)
    other = load_experiment(name, "limits=none", f"null_space.fields={rest}")
    return other, first["type"]


def run_metrics(name: str, experiment: Experiment, rollout: Rollout) -> RunMetrics:
    """Measure a run."""
    robot, tasks = experiment.robot, experiment.controller.tasks
    clearance, state = clearance_of(experiment), RobotState(robot)
    frames = {task.frame for task in tasks if hasattr(task, "frame")}
    min_manipulability, min_distance = np.inf, np.inf
    for t, q, v in zip(rollout.t, rollout.q, rollout.v, strict=True):
        state.update(t, q, v)
        for frame in frames:
            J = state.frame(frame).jacobian[:3]
            square = max(0.0, float(np.linalg.det(J @ J.T)))
            min_manipulability = min(min_manipulability, square**0.5)
        if clearance is not None:
            min_distance = min(min_distance, clearance.minimum_distance(state))
    lower, upper = robot.position_limits()
    q = rollout["joint_positions"]
    margins = np.minimum(q - lower, upper - q).min(axis=0)
    tightest = int(margins.argmin())
    model = robot.model
    return RunMetrics(
        name,
        tracking=max((tracking(rollout, task.name) for task in tasks), key=_first),
        manipulability=min_manipulability,
        distance=None if clearance is None else min_distance,
        limit_margin=f"{margins[tightest]:.3f} {_unit(robot, tightest)}",
        effort=limit_ratio(rollout.tau, model.upperEffortLimit),
        speed=limit_ratio(rollout.v, model.upperVelocityLimit),
        step=step_ratio(experiment, rollout),
    )


def tracking(
    rollout: Rollout, task: str, since: float = 0.0, until: float = np.inf
) -> str:
    """Return the rms error of a task's position rows, and of its orientation rows."""
    error = rollout[f"task.{task}.error"][(rollout.t >= since) & (rollout.t <= until)]
    position = 1e3 * float(np.sqrt((error[:, :3] ** 2).sum(axis=1).mean()))
    text = f"{position:.2g} mm"
    if error.shape[1] == 6:
        turned = 1e3 * float(np.sqrt((error[:, 3:] ** 2).sum(axis=1).mean()))
        text += f", {turned:.2g} mrad"
    return text


def limit_ratio(values: Array, limits: Array) -> float:
    """Return the largest |value| / limit; joints without a limit do not count."""
    limited = (limits > 0.0) & (limits < 1e300)
    return float((np.abs(values[:, limited]) / limits[limited]).max())


def clearance_of(experiment: Experiment) -> Clearance | None:
    """Return a field that measures the run's distances, for any field of the run."""
    if experiment.scene:
        return ObstacleClearance(list(experiment.scene.values()))
    if len(experiment.robot.parts) > 1:
        return SelfClearance()
    return None


def step_ratio(experiment: Experiment, rollout: Rollout) -> float:
    """Return the time of a control step over that of the bare Pinocchio calls."""
    controller, robot = experiment.controller, experiment.robot
    model, data = robot.model, robot.model.createData()
    rows = np.linspace(0, len(rollout) - 1, STEPS).astype(int)
    states = [(float(rollout.t[k]), rollout.q[k], rollout.v[k]) for k in rows]
    a = np.zeros(robot.nv)

    def this_law() -> None:
        for t, q, v in states:
            controller.compute(t, q, v)

    def pinocchio() -> None:
        for _, q, v in states:
            pin.computeJointJacobiansTimeVariation(model, data, q, v)
            pin.updateFramePlacements(model, data)
            pin.rnea(model, data, q, v, a)

    return statistics.median(
        _timed(this_law) / _timed(pinocchio) for _ in range(ROUNDS)
    )


def _timed(function: Callable[[], None]) -> float:
    start = perf_counter()
    function()
    return perf_counter() - start


def _first(text: str) -> float:
    return float(text.split()[0])


def _unit(robot: Any, dof: int) -> str:
    joint = next(j for j in robot.joints.values() if j.idx_v == dof)
    return "m" if joint.shortname().startswith("JointModelP") else "rad"


# --------------------------------------------------------------------------- remarks


def remark(
    name: str, experiment: Experiment, rollout: Rollout, without: Rollout
) -> str:
    """Return a remark on a configuration that its table does not show; may be empty.

    Args:
        name: The configuration.
        experiment: The configuration, built.
        rollout: Its run.
        without: Its run without the field.
    """
    if name == "iiwa_singular":
        damped = rollout.t[rollout["damped"] > 0]
        before = tracking(rollout, "hand", until=float(damped[0]) - 0.1)
        after = tracking(rollout, "hand", since=9.5)
        runs = (rollout, without)
        peaks = [float(np.abs(run["acceleration"]).max()) for run in runs]
        return (
            f"The law is damped instead of exact from {damped[0]:.1f} s to "
            f"{damped[-1]:.1f} s, while the target is out of reach or nearly so. The "
            f"rms error is {before} before and {after} in the last half second; the "
            f"largest joint acceleration {peaks[0]:.1f} rad/s², {peaks[1]:.1f} without."
        )
    if name == "iiwa_null_space":
        path = _path(experiment, rollout, "iiwa_link_4")
        swung = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        moved = 1e3 * float(
            np.linalg.norm(rollout["task.hand.error"][:, :3], axis=1).max()
        )
        error = np.linalg.norm(rollout["null_space_error"], axis=1)[rollout.t > 2.0]
        speed = np.linalg.norm(rollout.v, axis=1)[rollout.t > 2.0]
        part = float(np.sqrt((error**2).mean() / (speed**2).mean()))
        return (
            f"The elbow travels {swung:.1f} m while the hand is never farther than "
            f"{moved:.2f} mm from where it was. From 2 s on the null-space error is "
            f"{100 * part:.1g} % of the null-space velocity (rms); the cause of this "
            "rest is that the effort is held for 1 ms."
        )
    if name == "panda_limits":
        drifts = []
        for run in (rollout, without):
            q = run["joint_positions"][run.t >= 5.0 - 1e-9]  # a turn takes 5 s
            drifts.append(float(np.abs(q[-1] - q[0]).max()))
        return (
            f"Over the last turn the joints come back to within {drifts[0]:.2g} rad; "
            f"without the field they drift by {drifts[1]:.2g} rad."
        )
    if name == "tiago_reach":
        base = float(np.linalg.norm(rollout.q[-1, :2] - rollout.q[0, :2]))
        torso = float(np.ptp(rollout["joint_positions"][:, 3]))
        return (
            f"The base ends {base:.1f} m from its start; the torso uses "
            f"{torso:.2f} m of its 0.35 m."
        )
    return ""


def _path(experiment: Experiment, rollout: Rollout, frame: str) -> Array:
    state = RobotState(experiment.robot)
    rows = zip(rollout.t, rollout.q, rollout.v, strict=True)
    return np.array([state.update(*row).position(frame).copy() for row in rows])


# ------------------------------------------------------------------------------ main


def sections(names: list[str], progress: Progress) -> Iterator[str]:
    """Run the configurations and return each one's section of the page."""
    bar = progress.add_task("", total=2.0 * len(names))
    for name in names:
        metrics, runs, seconds = [], [], []
        experiment = load_experiment(name)
        other, field = without_field(name)
        for label, run in ((f"with `{field}`", experiment), ("without", other)):
            progress.update(bar, description=f"{name}, {label.replace('`', '')}")
            done = progress.tasks[bar].completed

            def on_progress(part: float, done: float = done) -> None:
                progress.update(bar, completed=done + part)

            start = perf_counter()
            rollout = run.run(on_progress)
            seconds.append(perf_counter() - start)
            runs.append(rollout)
            metrics.append(run_metrics(label, run, rollout))
        duration = experiment.scenario.simulation.duration
        speeds = " and ".join(f"{duration / s:.1f}" for s in seconds)
        progress.console.print(f"{name}: real-time factors {speeds}", highlight=False)
        scenario = experiment.scenario
        text = remark(name, experiment, runs[0], runs[1])
        yield "\n".join(
            [
                f"## `{name}`",
                "",
                f"**{scenario.title}.**",
                "",
                HEADER,
                *(each.row() for each in metrics),
                *(("", text) if text else ()),
            ]
        )


def main(arguments: list[str] | None = None) -> int:
    """Run the given configurations and print the tables; write the page if all."""
    known = [name for name in bundled_configs() if "/" not in name]
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    names = parser.parse_args(arguments).names or known
    if unknown := set(names) - set(known):
        parser.error(f"unknown configuration {sorted(unknown)}; choose from {known}")
    console = Console(stderr=True)
    with Progress(console=console) as progress:
        found = list(sections(names, progress))
    page = "\n".join([INTRODUCTION, "\n\n".join(found), ""])
    Console().print(Markdown(page))
    if names == known:
        PAGE.write_text(page, encoding="utf-8")
        console.print(f"Wrote {PAGE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
