"""What each ingredient of the edge is for: the same cases without it.

    .venv/bin/python benchmarks/ablation.py [--cases N] [--robots ROBOT ...] [NAME ...]

An ingredient is left out of a copy of the package by replacing lines of it; a line that
is not found ends the benchmark, so that what is left out is always a part of the code
as it is. Constants are halved and doubled, too. Defaults only, at 1 and 5 ms: targets
out of reach as in `edge.py`, hands on springs, two levels, pushes, a steady force, one
axis or two, also without limits; of a planar arm, which has none, what it can have. For
ingredients of the limits also the rollouts of `limit_robots.py`, and efforts bisected
on the way to stretched postures where a limit binds. Writes the second table of
benchmarks/results/edge.md.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from edge_cases import Arm, unit
from edge_rest import IN_THE_PLANE, OUT, Case, case, is_planar, measure
from limit_robots import roll_out
from marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array

ROOT = Path(__file__).resolve().parents[1]
ROBOTS, PERIODS = ("panda", "ur5", "iiwa14"), (0.001, 0.005)
KINDS = (*OUT, "push", "steady", "spring above", "just out", "axes", "unlimited")
NEAREST = ("position", "levels", "just out")  # the hand's distance counts
ROLLOUTS, WAYS, POINTS = 24, 6, 1000  # of a robot; of a way

_LIMITS = "constraints/limits/acceleration_bounds.py"
_COST = "control/actuation/deviation_cost.py"
_EDGE = "edge/threshold.py"
_SHARES = "edge/shares.py"
_TARGET = "edge/limited_target.py"
_LEVELS = "edge/damped_levels.py"
_SENT = "control/actuation/sent_effort.py"
_MODEL = "robot/model.py"

Edit = tuple[str, str, str]
"""A file, a text in it, and what replaces it."""


def constant(file: str, line: str, *values: float) -> tuple[tuple[Edit, ...], ...]:
    """Return the edits that give a constant other values.

    Args:
        file: Where it is.
        line: Its line's begin, with its value last.
        *values: The others.
    """
    begin = line.rsplit(" ", 1)[0]
    return tuple(((file, line, f"{begin} {value}"),) for value in values)


_HALF_L, _TWICE_L, _NO_L = constant(_EDGE, "STIFFNESS = 200.0", 100.0, 400.0, 1e12)
_HALF_B, _TWICE_B, _NO_B = constant(_EDGE, "BELOW = 40.0", 20.0, 80.0, 0.0)
_HALF_T, _TWICE_T, _NO_T = constant(
    _EDGE, "TURNING, QUICKEST = 50.0", 25.0, 100.0, 1e12
)
_HALF_N, _TWICE_N = constant(_SHARES, "NEAR = 0.1", 0.05, 0.2)

INGREDIENTS: dict[str, tuple[Edit, ...]] = {
    "nothing": (),
    "bounded error": ((_MODEL, "return 0.35 * self.size, 1.25", "return 1e3, 1e3"),),
    "bounded force of springs": (
        (_MODEL, "return float(turns.max()) / lever, 0.5 * float(turns.max())",
         "return np.inf, np.inf"),
    ),
    "threshold that follows (L)": _NO_L,
    "L: half of it": _HALF_L,
    "L: twice": _TWICE_L,
    "less of L for one axis or two": (
        ("tasks/feedback.py", "max(WHOLE + 1.0 - self.size, 1.0)", "1.0"),
    ),
    "threshold of the field": _NO_T,
    "50 1/s: half of it": _HALF_T,
    "50 1/s: twice": _TWICE_T,
    "7 rad/s: half of it": ((_EDGE, "QUICKEST = 50.0, 7.0", "QUICKEST = 50.0, 3.5"),),
    "7 rad/s: twice": ((_EDGE, "QUICKEST = 50.0, 7.0", "QUICKEST = 50.0, 14.0"),),
    "threshold below a held level": _NO_B,
    "40: half of it": _HALF_B,
    "40: twice": _TWICE_B,
    "what those above it draw": (
        (_LEVELS, "opposed[k] -= J[", "opposed[k] -= 0.0 * J["),
    ),
    "how a null space turns": (
        (_EDGE, "following.size / above))", "0.0 / above))"),
    ),
    "share: near": (
        (_SHARES, "return float(smooth_share(2.0 - 2.0 *", "return float(0.0 * ("),
    ),
    "near, 0.1: half of it": _HALF_N,
    "near, 0.1: twice": _TWICE_N,
    "share: far": (
        (_SHARES, "return float(smooth_share((most - FAR)", "return float(0.0 * (most"),
    ),
    "far, 0.85: 0.7": ((_SHARES, "FAR = 0.85", "FAR = 0.7"),),
    "share: limits": (
        (_TARGET, "change[i] = tasks * (", "change[i] = 0.0 * ("),
    ),
    "static effort": (
        ("constraints/limits/limits.py", "_HELD = 0.95", "_HELD = 100.0"),
    ),
    "effort's rate": ((_MODEL, "_LEG_RATE = 11.0, 500.0", "_LEG_RATE = 1e9, 1e9"),),
    "barrier of the speed knows the rate": (
        (_LIMITS, "if gap > 0.0 and jerk < np.inf:", "if gap > np.inf:"),
    ),
    "steeper beyond the speed": ((_LIMITS, "_STEEPER = 4.0", "_STEEPER = 1.0"),),
    "speed's margin of the error": (
        (_LIMITS, "velocity[i] - error[i] /", "velocity[i] - 0.0 * error[i] /"),
    ),
    "position's drift": ((_LIMITS, "_SHIFT = 0.1", "_SHIFT = 0.0"),),
    "steady force": (
        (_SENT, "steady[i] = _shared(drift[i], present)", "steady[i] = 0.0"),
    ),
    "null space dearer with the error": (
        (_COST, "_MOST = 1.0, 0.2, 0.1", "_MOST = 0.0, 0.0, 0.1"),
    ),
    "springs cost what is below them": (
        (_COST, "(standing or not springs)", "(standing or True)"),
    ),
    "directions that levels share": (
        (_COST, "count = _write_damped_level(directions)",
         "count = _write_levels(directions, 1)\n"
         "        _write_roots(directions, count)"),
        (_COST, "count = _write_levels(directions, first_damped)",
         "count = _write_levels(directions, directions.ends.shape[0])"),
        (_COST, "        _write_shared(directions, count)", "        pass"),
    ),
}  # fmt: skip


def cases(robots: list[str], kinds: list[str], count: int) -> list[Case]:
    """Return ``count`` cases of a kind, robot and period; the same in every call."""
    found = []
    for robot in robots:
        arm = Arm(robot)
        for kind in kinds:
            if is_planar(robot) and kind not in IN_THE_PLANE:
                continue
            for period in PERIODS:
                key = [KINDS.index(kind), PERIODS.index(period)]
                for seed in range(count):
                    rng = np.random.default_rng([seed, *key])
                    found.append(case(arm, kind, period, rng))
    return found


def jump(name: str, seed: int) -> float:
    """Return the largest jump of an effort [N·m] on the way to a stretched posture.

    Joints have a largest acceleration, so that a limit binds; levels are one or two.
    """
    robot, rng = hsp.Robot.load(name), np.random.default_rng(seed)
    (lower, upper), n = robot.position_limits(), robot.nv
    begin = np.clip(robot.home() + rng.uniform(-1, 1, n), lower + 0.1, upper - 0.1)
    way = np.clip(0.02 * rng.normal(size=n), lower + 0.01, upper - 0.01) - begin
    here = robot.state(0.0, begin, np.zeros(n)).position(robot.end_effector)
    goal = here + rng.uniform(0.3, 1.5) * unit(rng)
    hands: list[hsp.Task] = [hsp.FramePosition(robot.end_effector, hsp.Hold(goal))]
    if seed % 2:
        hands.append(hsp.FrameOrientation(robot.end_effector, priority=2))
    limits = hsp.Limits(acceleration=rng.uniform(2.0, 20.0), effort_rate="none")
    made = hsp.Controller(robot, hands, limits=limits, start=begin)
    v = 0.2 * rng.normal(size=n)

    def effort(share: float) -> Array:
        tau = made.compute(0.0, begin + share * way, v).tau.copy()
        turned = np.linalg.norm(made.active_stack.rows.error[3:])
        # At half a turn an orientation has two ways back.
        return tau if turned < 3.1 else np.full(n, np.nan)

    shares = np.linspace(0.0, 1.0, POINTS)
    efforts = np.array([effort(share) for share in shares])
    worst = int(np.nanargmax(np.abs(np.diff(efforts, axis=0)).max(axis=1)))
    low, high = shares[worst : worst + 2]
    for _ in range(20):
        middle = 0.5 * (low + high)
        parts = [effort(each) for each in (low, middle, high)]
        first, second = np.abs(np.diff(parts, axis=0)).max(axis=1)
        low, high = (low, middle) if first > second else (middle, high)
    return float(max(first, second))


def measure_all(given: Path, results: Path, *, limits: bool) -> None:
    """Measure the package that is found first; also what its limits do, or not."""
    warnings.simplefilter("ignore")
    drawn = [Case(*each) for each in json.loads(given.read_text(encoding="utf-8"))]
    robots = {name: hsp.Robot.load(name) for name in {case.robot for case in drawn}}
    found: dict[str, Any] = {
        "runs": [measure(case, robots[case.robot]) for case in drawn]
    }
    if limits:
        found |= limited()
    results.write_text(json.dumps(found), encoding="utf-8")


def limited() -> dict[str, Any]:
    """Return what limits do in random rollouts, and where they bind."""
    rolled = [roll_out((name, seed)) for name in ROBOTS for seed in range(ROLLOUTS)]
    violated = np.sum([run.violated for run in rolled], axis=0)
    return {
        "steps": sum(len(run.status) for run in rolled),
        "speed": int(violated[2]),
        "position": int(violated[3]),
        "jump": max(jump(name, seed) for name in ROBOTS for seed in range(WAYS)),
    }


def without(edits: tuple[Edit, ...], folder: Path) -> None:
    """Write a copy of the package in which texts are replaced."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "hsp_control", folder / "hsp_control")
    for data in ("robots", "configs"):
        (folder / data).symlink_to(ROOT / data)
    for name, old, new in edits:
        file = folder / "hsp_control" / name
        text = file.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise SystemExit(f"{name} has {old!r} {text.count(old)} times, not once")
        file.write_text(text.replace(old, new), encoding="utf-8")


HEADER = (
    "| without | rests | change in 1 ms / limit, half / most | too far from the goal "
    "[mm], half / most | F/k off by | joint beyond its range, pushed [rad] | steps "
    "beyond a speed, a position | jump of an effort [N·m] |\n"
    "|---|--:|--:|--:|--:|--:|--:|--:|\n"
)


def row(name: str, found: dict[str, Any]) -> str:
    """Return the line of an ingredient."""
    runs = found["runs"]
    rest = [run["rests"] for run in runs]
    change = [run["change"] for run in runs]
    away = [1e3 * run["away"] for run in runs if run["kind"] in NEAREST]
    yields = [100.0 * run["yields"] for run in runs if run["yields"] is not None]
    beyond = max(run["beyond"] for run in runs)
    limits = "| |"
    if "jump" in found:
        violated = f"{found['speed']}, {found['position']} of {found['steps']}"
        limits = f"| {violated} | {found['jump']:.2g}"
    return (
        f"| {name} | {sum(rest)} of {len(rest)} | {np.median(change):.2g} / "
        f"{max(change):.2g} | {np.median(away):.2g} / {max(away):.2g} | "
        f"{max(yields, default=0.0):.2g} % | {max(beyond, 0.0):.2g} {limits} |\n"
    )


def main() -> None:
    """Measure all copies, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=3, help="of a kind, robot, period")
    parser.add_argument("--robots", nargs="+", default=[*ROBOTS, "planar3r"])
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    parser.add_argument("--keep", type=Path, help="a folder of runs already made")
    parser.add_argument("--measure", nargs=2, type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--limits", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("names", nargs="*", default=list(INGREDIENTS))
    options = parser.parse_args()
    if options.measure:
        measure_all(*options.measure, limits=options.limits)
        return
    table = HEADER
    with tempfile.TemporaryDirectory() as temporary:
        kept = (options.keep or Path(temporary)).resolve()
        kept.mkdir(parents=True, exist_ok=True)
        given = kept / "cases.json"
        if not given.exists():
            made = cases(options.robots, options.kinds, options.cases)
            given.write_text(json.dumps(made), encoding="utf-8")
        for name in options.names:
            results = kept / f"{name}.json"
            if not results.exists():
                edits = INGREDIENTS[name]
                without(edits, kept / "copy")
                path = [str(kept / "copy"), str(Path(__file__).parent)]
                environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path)}
                command = [sys.executable, __file__, "--measure", given, results]
                if all(file in (_LIMITS, _COST) for file, _, _ in edits):
                    command.append("--limits")
                subprocess.run(command, env=environment, check=True)
            line = row(name, json.loads(results.read_text(encoding="utf-8")))
            print(line, end="", flush=True)
            table += line
    if options.names == list(INGREDIENTS):
        replace_section(RESULTS / "edge.md", "ablation", table)


if __name__ == "__main__":
    main()
