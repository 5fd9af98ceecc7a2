"""Measure the real-time factor of rollouts on one core.

    .venv/bin/python benchmarks/rollouts.py [--rounds N] [--steps]

First what a step costs, rows of the log included, in parts of what it cannot do
without: one `compute`, and one articulated-body algorithm (ABA) for each stage of the
integrator. Then 10 s of a Panda at 1 kHz (6-D pose and joint centering) with a
fixed-step plant and with RK4, logged every 10 ms and at every step, in turns; then
every bundled configuration as it is. Times include logging, but not compilation. They
are processor times, so that other processes on the machine matter little. Memory is the
size of the log's columns.
"""

import argparse
import statistics
from time import perf_counter, process_time
from typing import Any

import numpy as np

from hsp_control import Rollout, load_experiment
from hsp_control.common.resources import bundled_configs
from hsp_control.engine.plans import planned

PANDA: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {
        "hand": {
            "type": "frame_pose",
            "trajectory": {
                "type": "composed",
                "position": {
                    "type": "circle", "origin": "start", "center": [0, 0, 0],
                    "radius": 0.1, "angular_rate": 2.0, "normal": [0, 0, 1],
                },
            },
            "gains": {"natural_frequency": 10.0},
            "blend": 1.0,
        }
    },
    "null_space": {"gain": 8.0, "fields": [{"type": "joint_centering", "weight": 2.0}]},
    "simulation": {"duration": 10.0, "control_period": 0.001},
}  # fmt: skip


def run(config: Any, *overrides: str) -> tuple[float, Rollout]:
    """Run a configuration; return the real-time factor and the rollout."""
    experiment = load_experiment(config, *overrides)
    times: list[float] = []
    rollout = experiment.run(lambda done: times.append(process_time()))
    return float(rollout.t[-1] - rollout.t[0]) / (times[-1] - times[0]), rollout


def row(name: str, factors: list[float], rollout: Rollout) -> str:
    """Return a row of a table."""
    size = sum(column.nbytes for column in rollout.columns.values()) / len(rollout)
    error = max(
        abs(rollout[f"task.{task}.error"]).max() for task in rollout.meta["tasks"]
    )
    return (
        f"| {name} | {statistics.median(factors):.3g} | {min(factors):.3g} to "
        f"{max(factors):.3g} | {len(rollout)} | {size:.0f} B | {error:.2g} |"
    )


def step_costs(rounds: int) -> None:
    """Print what a step costs, in parts of `compute` and of the dynamics."""
    stages = {"semi_implicit_euler": 1, "rk4": 4}
    periods = {"every 10 ms": 0.01, "every step": 0.001}
    cases = {
        (kind, name): load_experiment(
            PANDA, f"simulation.integrator={{type: {kind}}}",
            f"simulation.log_period={period}", "simulation.duration=3",
        )
        for kind in stages for name, period in periods.items()
    }  # fmt: skip
    experiment = cases["rk4", "every 10 ms"]
    robot, controller = experiment.robot, experiment.controller
    q, v, n = experiment.q0, experiment.v0, np.arange(robot.nv)
    states = [(1e-3 * k, q + 1e-3 * np.sin(k + n), 1e-2 * np.cos(k + n))
              for k in range(1000)]  # fmt: skip
    dynamics = robot.bind_forward_dynamics(q, v, np.zeros(robot.nv))
    forward_dynamics = planned(dynamics.calls).call()
    found: dict[tuple[str, str], list[float]] = {case: [] for case in cases}
    for round_ in range(rounds + 1):
        for case, each in cases.items():
            begin = perf_counter()
            for state in states:
                controller.compute(*state)
            law = (perf_counter() - begin) / len(states)
            begin = perf_counter()
            for _ in states:
                forward_dynamics()
            forward = (perf_counter() - begin) / len(states)
            rows: list[float] = []
            each.run(lambda _, rows=rows: rows.append(perf_counter()))  # type: ignore
            row = statistics.median(np.diff(rows)[len(rows) // 3 :])
            step = row * 0.001 / periods[case[1]]
            if round_ > 0:  # the first compiles
                found[case].append(step / (law + stages[case[0]] * forward))
    print("| integrator | a row | a step, in parts of compute + ABA | range |")
    print("|---|---|--:|---|")
    for (kind, name), parts in found.items():
        print(f"| {kind}, {stages[kind]} ABA | {name} | {statistics.median(parts):.2f} "
              f"| {min(parts):.2f} to {max(parts):.2f} |")  # fmt: skip
    print()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", action="store_true", help="the first table alone")
    arguments = parser.parse_args()
    rounds = arguments.rounds
    step_costs(rounds)
    if arguments.steps:
        return
    head = "| {} | real-time factor | range | rows | row size | largest error |"
    cases = {
        f"{name}, a row {logged}": (f"simulation.integrator={{type: {kind}}}", period)
        for name, kind in (("fixed step", "semi_implicit_euler"), ("RK4", "rk4"))
        for logged, period in (("every 10 ms", "0.01"), ("every step", "0.001"))
    }
    found: dict[str, list[float]] = {name: [] for name in cases}
    rollouts = {}
    for _ in range(rounds):
        for name, (integrator, period) in cases.items():
            log = f"simulation.log_period={period}"
            factor, rollouts[name] = run(PANDA, integrator, log)
            found[name].append(factor)
    print(head.format("Panda, 10 s at 1 kHz"), "|---|--:|---|--:|--:|--:|", sep="\n")
    for name, factors in found.items():
        print(row(name, factors, rollouts[name]))
    print()
    print(head.format("configuration"), "|---|--:|---|--:|--:|--:|", sep="\n")
    for name in bundled_configs():
        runs = [run(name) for _ in range(rounds)]
        print(row(f"`{name}`", [factor for factor, _ in runs], runs[-1][1]), flush=True)


if __name__ == "__main__":
    main()
