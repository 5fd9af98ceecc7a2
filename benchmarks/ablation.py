"""The effect of the edge's constants: the same cases with half, twice or none.

    .venv/bin/python benchmarks/ablation.py [--cases N] [--robots ROBOT ...] [NAME ...]

A constant is replaced in a copy of the package; a line that is not found ends the
benchmark, so that always a constant of the present law is replaced. Targets
out of reach with defaults only, the kinds of `edge_rest.py`, in the metrics I and M(q),
at 10 ms, where a sampled loop tolerates least; and feasible tasks beside fields pushing
into limits. Writes the table of constants into benchmarks/results/edge.md.
"""

import argparse
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from edge_rest import KINDS, Case, case, measure
from shared.edge_cases import Arm, unit
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError
from hsp_control.null_space.metrics import Metric

ROOT = Path(__file__).resolve().parents[1]
ROBOTS, PERIOD = ("panda", "iiwa14", "xarm7"), 0.01
OF_ABLATION = ("position", "levels", "just out", "axes", "spring above", "mass")
NEAREST = ("position", "levels", "just out")  # the hand's distance is measured
FIELDS = (300.0, 1e4)  # beside a step of 10 cm [rad/s]
KEPT = 1e-3  # [m]

_EDGE = "edge/threshold.py"
_SHARES = "edge/shares.py"
_TARGET = "edge/limit_share.py"
_HELD = "edge/held_levels.py"

Edit = tuple[str, str, str]
"""A file, a line's begin, and its replacement."""


def constant(file: str, line: str, **others: float) -> dict[str, Edit]:
    """Return the edits that give a constant other values.

    Args:
        file: Where it is.
        line: Its line's begin, with its value last.
        **others: The others, by name.
    """
    begin = line.rsplit(" ", 1)[0]
    return {name: (file, line, f"{begin} {value}") for name, value in others.items()}


CONSTANTS: dict[str, dict[str, Edit]] = {
    "L": constant(_EDGE, "STIFFNESS = 200.0", half=100.0, twice=400.0, none=1e12),
    "less of L for one axis or two": {
        "none": (
            "tasks/feedback.py", "max(WHOLE + 1.0 - self.size, 1.0)", "1.0"
        ),
    },
    "40 below a held level": constant(
        _EDGE, "BELOW = 40.0", half=20.0, twice=80.0, none=0.0
    ),
    "50 1/s of a field": constant(
        _EDGE, "TURNING, QUICKEST = 50.0", half=25.0, twice=100.0, none=1e12
    ),
    "7 rad/s of a field": {
        "half": (_EDGE, "QUICKEST = 50.0, 7.0", "QUICKEST = 50.0, 3.5"),
        "twice": (_EDGE, "QUICKEST = 50.0, 7.0", "QUICKEST = 50.0, 14.0"),
    },
    "σ_x, 0.1": constant(_SHARES, "NEAR = 0.1", half=0.05, twice=0.2),
    "0.85 of ℓ": constant(_SHARES, "FAR = 0.85", less=0.7),
    "K of saturated levels": constant(
        _HELD, "STIFFEST = 1000.0", half=500.0, twice=2000.0, none=1e12
    ),
    "2, excess of the tasks": constant(
        _TARGET, "LARGE = 2.0", half=1.0, twice=4.0, none=1e12
    ),
    "r_f, the errors' own command": {
        "none": (_TARGET, "0.0 if law.problem.demands_known else 1.0", "1.0"),
    },
}  # fmt: skip
ROWS: dict[str, Edit | None] = {"as it is": None} | {
    f"{name}: {how}": edit
    for name, edits in CONSTANTS.items()
    for how, edit in edits.items()
}


def cases(robots: list[str], count: int) -> list[Case]:
    """Return ``count`` cases of a kind and robot; the same in every call."""
    found = []
    for robot in robots:
        arm = Arm(robot)
        for kind in OF_ABLATION:
            for seed in range(count):
                rng = np.random.default_rng([seed, KINDS.index(kind)])
                found.append(case(arm, kind, PERIOD, rng))
    return found


def constant_field(g: Array, state: hsp.RobotState) -> Array:
    """Return g."""
    return g


def kept(metric: Metric | None, name: str, size: float, seed: int) -> float:
    """Return how far a hand ends from a target within reach beside a field [m]."""
    arm, rng = Arm(name), np.random.default_rng([seed, round(size)])
    robot, d, u = arm.robot, rng.normal(size=arm.robot.nv), unit(rng)
    q0 = robot.home()
    here = robot.state(0.0, q0, np.zeros(robot.nv)).position(arm.frame)
    goal = hsp.trajectories.ComposedPose(hsp.Hold(here + 0.1 * u))
    field = hsp.fields.FunctionField(
        partial(constant_field, size * d / np.linalg.norm(d))
    )
    hand = hsp.FramePose(arm.frame, goal, name="hand")
    made = hsp.Controller(robot, [hand], field, metric=metric, start=q0)
    try:
        run = hsp.simulate(
            made, q0, duration=2.5, control_period=PERIOD, check_rate=False
        )
    except HspControlError:
        return float("inf")
    return float(np.linalg.norm(run["task.hand.error"][-1, :3]))


def measure_all(given: Path, results: Path) -> None:
    """Measure the package that is found first."""
    warnings.simplefilter("ignore")
    drawn = [Case(*each) for each in json.loads(given.read_text(encoding="utf-8"))]
    names = dict.fromkeys(case.robot for case in drawn)
    robots = {name: hsp.Robot.load(name) for name in names}
    mass = hsp.metrics.MassMatrixMetric()
    of_first = sum(case.robot == drawn[0].robot for case in drawn)
    seeds = range(2 * of_first // len(OF_ABLATION))
    found: dict[str, Any] = {
        "I": [measure(case, robots[case.robot]) for case in drawn],
        "M": [measure(case, robots[case.robot], mass) for case in drawn],
        "kept": [
            [kept(metric, *own) for own in itertools.product(names, FIELDS, seeds)]
            for metric in (None, mass)
        ],
    }
    results.write_text(json.dumps(found), encoding="utf-8")


def with_edit(edit: Edit | None, folder: Path) -> None:
    """Write a copy of the package in which a text is replaced."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "hsp_control", folder / "hsp_control")
    for data in ("robots", "configs"):
        (folder / data).symlink_to(ROOT / data)
    if edit is None:
        return
    name, old, new = edit
    file = folder / "hsp_control" / name
    text = file.read_text(encoding="utf-8")
    if text.count(old) != 1:
        raise SystemExit(f"{name} has {old!r} {text.count(old)} times, not once")
    file.write_text(text.replace(old, new), encoding="utf-8")


HEADER = (
    "| constant | rests in I | in M(q) | latest rest [s] | change in 1 ms / limit, "
    "half / most | too far from the goal [mm], half / most | within 1 mm beside a "
    "field, in I | in M(q) |\n"
    "|---|--:|--:|--:|--:|--:|--:|--:|\n"
)


def row(name: str, found: dict[str, Any]) -> str:
    """Return the line of a constant."""
    runs = [*found["I"], *found["M"]]
    rest = [
        f"{sum(run['rests'] for run in found[metric])} of {len(found[metric])}"
        for metric in ("I", "M")
    ]
    change = [run["change"] for run in runs]
    away = [1e3 * run["away"] for run in runs if run["kind"] in NEAREST]
    beside = [
        f"{sum(end < KEPT for end in ends)} of {len(ends)}" for ends in found["kept"]
    ]
    return (
        f"| {name} | {' | '.join(rest)} | {max(run['still'] for run in runs):.1f} | "
        f"{np.median(change):.2g} / {max(change):.2g} | {np.median(away):.2g} / "
        f"{max(away):.2g} | {' | '.join(beside)} |\n"
    )


def main() -> None:
    """Measure all copies, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=3, help="of a kind and robot")
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS))
    parser.add_argument("--keep", type=Path, help="a folder of runs already made")
    parser.add_argument("--measure", nargs=2, type=Path, help=argparse.SUPPRESS)
    parser.add_argument("names", nargs="*", default=list(ROWS))
    options = parser.parse_args()
    if options.measure:
        measure_all(*options.measure)
        return
    table = HEADER
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.keep or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        given = folder / "cases.json"
        if not given.exists():
            made = cases(options.robots, options.cases)
            given.write_text(json.dumps(made), encoding="utf-8")
        for name in options.names:
            results = folder / f"{name.replace('/', ' ')}.json"
            if not results.exists():
                with_edit(ROWS[name], folder / "copy")
                path = [str(folder / "copy"), str(Path(__file__).parent)]
                environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path)}
                command = [sys.executable, __file__, "--measure", given, results]
                subprocess.run(command, env=environment, check=True)
            line = row(name, json.loads(results.read_text(encoding="utf-8")))
            print(line, end="", flush=True)
            table += line
    if options.names == list(ROWS):
        replace_section(RESULTS / "edge.md", "ablation", table)


if __name__ == "__main__":
    main()
