"""Streamed targets that a hand cannot reach: how efforts change on the way to them.

    .venv/bin/python benchmarks/out_of_reach.py

A Panda within its limits, efforts held for 1 ms. Targets lie in random directions from
the shoulder, up to 0.9 m beyond its reach. Writes a table into docs/streams.md.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
from marked_sections import DOCS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array

PERIOD, DURATION = 1e-3, 5.0  # [s]
SHOULDER, REACH = np.array([0.0, 0.0, 0.333]), (0.9, 1.8)  # [m]
RESTS = 0.5
"""Of a hand that rests no effort changes by more than this in 1 ms [N·m]."""


def targets(count: int) -> Iterator[Array]:
    """Yield points in random directions from the shoulder."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        yield SHOULDER + rng.uniform(*REACH) * direction


def position(robot: hsp.Robot, target: Array, **waits: Any) -> hsp.tasks.Task:
    """Return a position task whose stream goes to a target, at up to 1 m/s."""
    stream = hsp.Stream(**waits)
    stream.send(target)
    return hsp.FramePosition("panda_tcp", stream)


def springs(robot: hsp.Robot, target: Array, **waits: Any) -> hsp.tasks.Task:
    """Return a pose on springs whose stream goes there, at up to 0.5 m/s."""
    stream = hsp.StreamPose(**waits)
    here = robot.state(0.0, robot.home(), np.zeros(robot.nv)).frame("panda_tcp")
    turned = pin.Quaternion(np.array(here.rotation)).coeffs()
    stream.send([*target, *turned])
    soft = hsp.Impedance(stiffness=[400.0] * 3 + [30.0] * 3, damping_ratio=1.0)
    return hsp.FramePose("panda_tcp", stream, impedance=soft)


def row(
    make: Any, count: int, threshold: float, waits: Any, rate: float | None = None
) -> str:
    """Return a row of the table; ``rate`` limits that of efforts [N·m/s]."""
    robot = hsp.Robot.load("panda")
    changes, restless, ahead, excess = [], 0, [], 0.0
    for target in targets(count):
        controller = hsp.Controller(
            robot,
            [make(robot, target, **waits)],
            hsp.JointCentering(),
            null_space_gain=8.0,
            singularity_threshold=threshold,
            limits=hsp.Limits(effort_rate=rate),
        )
        run = hsp.simulate(
            controller,
            robot.home(),
            duration=DURATION,
            control_period=PERIOD,
            log_period=PERIOD,
            integrator=hsp.integrators.SemiImplicitEuler(PERIOD),
        )
        change = np.abs(np.diff(run.tau, axis=0)).max(axis=1)
        changes.append(float(change.max()))
        restless += bool(change[-500:].max() > RESTS)
        error = run["task.panda_tcp.error"][:, :3]
        ahead.append(float(np.linalg.norm(error, axis=1).max()))
        excess = max(excess, run["velocity_excess"].max(), run["position_excess"].max())
    assert excess == 0.0, excess
    task = "position" if make is position else "pose on springs"
    lead = "0.1 m" if not waits else "none"
    return (
        f"| {task} | {threshold:g} | {lead} | {rate or 'none'} | "
        f"{np.median(changes):.0f} / {max(changes):.0f} | {max(ahead):.2f} | "
        f"{count - restless} of {count} |"
    )


def main() -> None:
    """Write the table."""
    lines = [
        "| task | `singularity_threshold` | `lead` | `effort_rate` [N·m/s] | largest "
        "change of an effort in 1 ms, median / most [N·m] | largest error [m] | comes "
        "to rest |",
        "|---|---|---|---|--:|--:|--:|",
    ]
    none = {"lead": None}
    for make, count, without in (
        (position, 40, none),
        (springs, 12, none | {"angular_lead": None}),
    ):
        for threshold in (0.03, 0.1):
            for waits in (without, {}):
                lines.append(row(make, count, threshold, waits))
                print(lines[-1], flush=True)
        for threshold in (0.03, 0.1):
            lines.append(row(make, count, threshold, {}, rate=1000.0))
            print(lines[-1], flush=True)
    replace_section(DOCS / "streams.md", "out_of_reach.py", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
