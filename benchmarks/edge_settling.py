"""Do steps within reach settle as soon as in an earlier version?

    .venv/bin/python benchmarks/edge_settling.py CHECKOUT [--cases N]

Steps of 0.1 to 0.5 m along which the arm stays well within reach: of a hand's position,
of its pose, and of a position above an orientation that is turned by up to 1 rad. The
same cases with the earlier version, whose checkout is given. Settled: within 5 mm, and
10 mrad, for good. Writes the fourth table of benchmarks/results/edge.md.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.trajectories import ComposedPose, HoldOrientation

HERE = Path(__file__).resolve().parent
ROBOTS = "panda", "ur5", "iiwa14", "xarm7"
KINDS, PERIOD, LONG = (3, 6, 33), 1e-3, 4.0
NAMES = {3: "position", 6: "pose", 33: "position above orientation"}
NEAR = 5e-3, 10e-3  # [m, rad]


def drawn(count: int) -> list[dict[str, Any]]:
    """Return random steps, ``count`` of a kind and robot."""
    from edge_cases import POINTS, Arm, unit

    found = []
    for name in ROBOTS:
        arm = Arm(name)
        for kind in KINDS:
            for seed in range(count):
                rng = np.random.default_rng([seed, kind])
                follows = False
                while not follows:
                    q0 = arm.start(rng)
                    here, _ = arm.at(q0)
                    goal = here.translation + rng.uniform(0.1, 0.5) * unit(rng)
                    turn = rng.uniform(0.0, 1.0) * unit(rng) * (kind != 3)
                    shares = np.linspace(0.0, 1.0, POINTS)
                    way = [
                        pin.SE3(
                            here.rotation @ pin.exp3(s * turn),
                            here.translation + s * (goal - here.translation),
                        )
                        for s in shares
                    ]
                    follows = arm.follows(q0, way, min(kind, 6), 1.0)
                made = {"robot": name, "kind": kind, "q0": q0, "goal": goal}
                made["rotation"] = way[-1].rotation
                found.append({k: getattr(v, "tolist", lambda v=v: v)()
                              for k, v in made.items()})  # fmt: skip
    return found


def settles(case: dict[str, Any], robot: hsp.Robot) -> float:
    """Return when a step has settled [s]; inf: not at all."""
    frame, q0 = robot.end_effector, np.array(case["q0"])
    goal, turned = np.array(case["goal"]), HoldOrientation(np.array(case["rotation"]))
    tasks: list[hsp.Task]
    if case["kind"] == 6:
        tasks = [hsp.FramePose(frame, ComposedPose(hsp.Hold(goal), turned))]
    else:
        tasks = [hsp.FramePosition(frame, hsp.Hold(goal))]
    if case["kind"] == 33:
        tasks.append(hsp.FrameOrientation(frame, turned, priority=2))
    made = hsp.Controller(robot, tasks, hsp.JointCentering())
    run = hsp.simulate(made, q0, duration=LONG, control_period=PERIOD, log_period=0.01)
    off = np.zeros(len(run.t), dtype=bool)
    for q, k in zip(run.q, range(len(off)), strict=True):
        at = robot.state(0.0, q, np.zeros(robot.nv)).frame(frame)
        angle = pin.log3(np.array(case["rotation"]).T @ at.rotation)
        off[k] = np.linalg.norm(goal - at.position) > NEAR[0]
        off[k] |= case["kind"] != 3 and np.linalg.norm(angle) > NEAR[1]
    last = np.flatnonzero(off)
    return float(run.t[last[-1]]) if not off[-1] else np.inf


def main() -> None:
    """Measure both versions and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path)
    parser.add_argument("--cases", type=int, default=20, help="of a kind and robot")
    parser.add_argument("--measure", nargs=2, type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        given, results = options.measure
        warnings.simplefilter("ignore")
        robots = {name: hsp.Robot.load(name) for name in ROBOTS}
        read = json.loads(given.read_text(encoding="utf-8"))
        times = [settles(case, robots[case["robot"]]) for case in read]
        results.write_text(json.dumps(times), encoding="utf-8")
        return
    from marked_sections import RESULTS, replace_section

    cases = drawn(options.cases)
    both: list[Array] = []
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "cases.json"
        given.write_text(json.dumps(cases), encoding="utf-8")
        for root in (options.checkout.resolve(), HERE.parent):
            results = Path(folder) / "times.json"
            environment = {**os.environ, "PYTHONPATH": str(root)}
            subprocess.run(
                [sys.executable, __file__, str(root), "--measure", given, results],
                env=environment, check=True,
            )  # fmt: skip
            both.append(np.array(json.loads(results.read_text(encoding="utf-8"))))
    table = (
        "| arm | step of | of | earlier, half / most [s] | now | now / earlier: half | "
        "nine tenths | most |\n|---|---|--:|--:|--:|--:|--:|--:|\n"
    )
    for name in ROBOTS:
        for kind in KINDS:
            of = [(c["robot"], c["kind"]) == (name, kind) for c in cases]
            old, new = both[0][of], both[1][of]
            ratio = new / old
            table += (
                f"| {name} | {NAMES[kind]} | {len(ratio)} | {np.median(old):.2f} / "
                f"{old.max():.2f} | {np.median(new):.2f} / {new.max():.2f} | "
                f"{np.median(ratio):.2f} | {np.quantile(ratio, 0.9):.2f} | "
                f"{ratio.max():.2f} |\n"
            )
    print(table)
    replace_section(RESULTS / "edge.md", "settling", table)


if __name__ == "__main__":
    main()
