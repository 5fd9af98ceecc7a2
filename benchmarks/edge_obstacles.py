"""An obstacle on the way to a target out of reach, under a Panda's own effort rate.

    .venv/bin/python benchmarks/edge_obstacles.py [--cases N]

A ball of 8 cm stands on the line from the hand to where it cannot be, a third to two
thirds of the way to the nearest point. Positions, poses, and positions above an
orientation, at once, at 1 and 5 ms, with `effort_rate: 1000` and a minimum distance of
2 cm from all links. Writes the last table of benchmarks/results/edge.md.
"""

import argparse
import warnings

import numpy as np
import pinocchio as pin
from edge_cases import BEYOND, Arm, unit
from marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.constraints.limits import ObstacleDistance
from hsp_control.control.actuation import Status
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import ObstacleClearance
from hsp_control.robot.inverse_kinematics import Target
from hsp_control.trajectories import ComposedPose

KINDS, PERIODS, RADIUS, LEAST = ("position", "pose", "levels"), (1e-3, 5e-3), 0.08, 0.02
ROOM, STILL, REST, WATCHED = 0.03, 1e-3, 3.2, 1.0


def measured(seed: int, kind: str, period: float) -> dict[str, float]:
    """Return the numbers of a run."""
    arm, rng = Arm("panda"), np.random.default_rng([seed, KINDS.index(kind)])
    robot, near = arm.robot, 0.0
    while near < LEAST + ROOM:  # begin outside of the minimum distance
        x, d = arm.start(rng), unit(rng)
        here = arm.at(x)[0].translation
        goal = here + (arm.extent(d, rng) - d @ here + rng.uniform(*BEYOND)) * d
        target = Target(arm.frame, pin.SE3(np.eye(3), goal), 3)
        nearest = arm.nearest(target, x, rng)
        at = here + rng.uniform(1.0 / 3.0, 2.0 / 3.0) * (nearest - here)
        ball = hsp.Obstacle("ball", Sphere(RADIUS), hsp.Hold(at))
        clearance = ObstacleClearance(obstacles=[ball])
        start = robot.state(0.0, arm.configuration(x), np.zeros(robot.nv))
        near = clearance.proximity(start).nearest(start)[0]
    hand: hsp.Task = hsp.FramePosition(arm.frame, hsp.Hold(goal))
    if kind == "pose":
        hand = hsp.FramePose(arm.frame, ComposedPose(hsp.Hold(goal)))
    below = [hsp.FrameOrientation(arm.frame, priority=2)] * (kind == "levels")
    barriers = [ObstacleDistance(LEAST)]
    limits = hsp.Limits(effort_rate=1000.0, barriers=barriers)
    made = hsp.Controller(
        robot, [hand, *below], hsp.JointCentering(), limits=limits, scene=[ball]
    )
    run = hsp.simulate(
        made, arm.configuration(x), duration=REST + WATCHED, control_period=period,
        log_period=period,
    )  # fmt: skip
    lower, upper = robot.position_limits()
    found = []
    for q in run.q[:: max(1, round(5e-3 / period))]:
        state = robot.state(0.0, q, np.zeros(robot.nv))
        found.append(clearance.proximity(state).nearest(state)[0])
    change = np.abs(np.diff(run.tau, axis=0)) / robot.model.effortLimit
    change /= 1e3 * period
    return {
        "rests": float(change[round(REST / period) :].max() <= STILL),
        "change": float(change.max()),
        "nearest": min(found),
        "binds": float(min(found) < LEAST + 0.005),
        "speed": float((np.abs(run.v) / robot.model.velocityLimit).max()),
        "beyond": float(np.maximum(run.q - upper, lower - run.q).max()),
        "relaxed": float((run["status"] == Status.RELAXED).sum()),
    }


def main() -> None:
    """Run all cases, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20, help="of a kind and period")
    count = parser.parse_args().cases
    warnings.simplefilter("ignore")
    table = (
        "| target | period [ms] | rests | meets the ball | nearest to it [mm] | speed "
        "/ limit | beyond a position [rad] | steps relaxed | change in 1 ms / limit |\n"
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|\n"
    )
    for kind in KINDS:
        for period in PERIODS:
            runs = [measured(seed, kind, period) for seed in range(count)]
            print([round(1e3 * r["nearest"], 2) for r in runs], flush=True)
            of = {key: [run[key] for run in runs] for key in runs[0]}
            table += (
                f"| {kind} | {1e3 * period:g} | {sum(of['rests']):g} of {count} | "
                f"{sum(of['binds']):g} | {1e3 * min(of['nearest']):.2f} | "
                f"{max(of['speed']):.3f} | {max(0.0, *of['beyond']):.2g} | "
                f"{sum(of['relaxed']):g} | {max(of['change']):.2g} |\n"
            )
    print(table)
    replace_section(RESULTS / "edge.md", "obstacles", table)


if __name__ == "__main__":
    main()
