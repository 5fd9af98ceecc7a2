"""Compare this law with TSID: Talos and G1 on two feet, on two plants.

    make bench      or      .venv-peers/bin/python benchmarks/whole_body_side_by_side.py

Runs every controller on ideal contacts and on MuJoCo, times the steps interleaved along
the same states, and the parts of this law's step. Prints the tables and writes them to
benchmarks/results/whole_body_side_by_side.md.
"""

# ruff: noqa: E402
import os

# TSID's wheel is built with OpenMP: with a second thread its solver takes a hundred
# times as long if another process uses that core. Both controllers get one thread.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import importlib
import platform
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
from shared import beside_tsid
from shared.marked_sections import RESULTS
from shared.standing import COM, G1, HAND, PERIOD, TALOS, TRUNK, Body, Engine, Standing
from shared.timing import Compute, State, ratios, spread, step_times

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.law import Outcome

ROOT = Path(__file__).resolve().parent.parent
LAW = "this law"
WEIGHTS = (1e-2, 1e-3, 1e-4)  # of TSID's posture
EVERY = 10  # control periods between two measurements
FALLEN = 20.0  # joint speed at which a run is over [rad/s]
Made = tuple[Compute, list[str]]  # a controller, and the statuses of its steps


def controllers() -> dict[str, Callable[[Standing], Made]]:
    """Return functions that make the controllers, by name."""
    made: dict[str, Callable[[Standing], Made]] = {LAW: this_law}
    try:
        peer: Any = importlib.import_module("shared.controllers.standing_tsid")
    except ImportError as error:
        print(f"TSID is not installed ({error}): make bench")
        return made
    for weight in WEIGHTS:
        made[f"TSID, posture weight {weight:.0e}"] = _tsid(peer, weight)
    return made


def _tsid(peer: Any, weight: float) -> Callable[[Standing], Made]:
    return lambda case: peer.make(case, posture_weight=weight)


def this_law(case: Standing) -> Made:
    """Return `hsp_control.Controller` as a user calls it."""
    controller = case.controller()
    statuses: list[str] = []

    def compute(t: float, q: Array, v: Array) -> Array:
        output = controller.compute(t, q, v)
        statuses.append(f"{output.status}{' damped' if output.damped else ''}")
        return output.tau

    return compute, statuses


# ------------------------------------------------------------------- the closed loop


@dataclass
class Run:
    """The closed-loop run of one controller on one plant."""

    columns: dict[str, Array] = field(default_factory=dict)
    statuses: Counter[str] = field(default_factory=Counter)
    states: list[State] = field(default_factory=list)
    failure: str = ""

    def rms(self, name: str) -> float:
        """Return the root mean square of a column."""
        return float(np.sqrt((self.columns[name] ** 2).mean()))


def close_loop(case: Standing, engine: Engine, made: Made, duration: float) -> Run:
    """Run a controller on a plant, with its effort held every period."""
    run, rows = Run(), []
    compute, statuses = made
    q, v = case.q0.copy(), np.zeros(case.robot.nv)
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        run.states.append((t, q, v))
        tau = np.array(compute(t, q, v))
        if k % EVERY == 0:
            outside = case.outside_cones(q, engine.wrenches(t, q, v, tau))
            now = {"effort": float(np.linalg.norm(tau)), "outside": float(outside)}
            rows.append(case.measure(t, q, v) | now)
        q, v = engine.advance(t, q, v, tau)
        if not np.abs(v).max() < FALLEN:
            run.failure = f"fell at t = {t:.2f} s"
            break
    run.statuses.update(statuses)
    run.columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return run


HEADER = (
    "| controller | CoM rms / max [mm] | hand rms / max [mm] | trunk rms [mrad] | "
    "‖q − q_start‖ rms [rad] | ‖P(g − v)‖ rms [rad/s] | effort rms [N·m] | "
    "outside the cones | soles shifted [mm] | status |\n"
    "|---|--:|--:|--:|--:|--:|--:|--:|--:|---|\n"
)


def row(name: str, run: Run) -> str:
    """Return a line of the table."""
    if run.failure:
        return f"| {name} | {run.failure} |" + 8 * " |" + "\n"
    c, steps = run.columns, run.statuses.total()
    counts = ", ".join(
        f"{status}: {100.0 * count / steps:.3g} %"
        for status, count in sorted(run.statuses.items())
    )
    cells = [
        *(f"{1e3 * run.rms(n):.2g} / {1e3 * c[n].max():.2g}" for n in (COM, HAND)),
        f"{1e3 * run.rms(TRUNK):.2g}",
        f"{run.rms('posture'):.2f}",
        f"{run.rms('null_space_error'):.2g}",
        f"{run.rms('effort'):.1f}",
        f"{100.0 * c['outside'].mean():.3g} %",
        f"{1e3 * c['slip'].max():.2g}",
        counts,
    ]
    return f"| {name} | " + " | ".join(cells) + " |\n"


# --------------------------------------------------------------------------- timing


def timing_table(times: dict[str, Array]) -> str:
    """Return the table of ratios to TSID, with the quartiles over the rounds."""
    reference = next((n for n in times if n.endswith("1e-03")), LAW)
    lines = f"| controller | {reference} = 1 | µs |\n|---|--:|--:|\n"
    for name, taken in times.items():
        cell = spread(ratios(times, name, reference))
        lines += f"| {name} | {cell} | {1e6 * np.median(taken):.0f} |\n"
    return lines


def parts_table(case: Standing, states: list[State]) -> str:
    """Return the table of the times of the parts of this law's step."""
    controller = case.controller()
    controller.compute(*states[0])
    state = controller.state
    active = controller.active_stack
    now = controller._in_force
    ((limits, _),) = now.limits.sets
    actuation = now.mixture.actuation(active, limits)
    support = active.support
    times: dict[str, list[int]] = {}

    def timed(name: str, function: Callable[[], Any]) -> Any:
        started = perf_counter_ns()
        result = function()
        times.setdefault(name, []).append(perf_counter_ns() - started)
        return result

    def law() -> Outcome:
        return active.resolve(state.t)

    for t, q, v in states:
        timed("kinematics, one pass of Pinocchio", lambda: state.update(t, q, v))  # noqa: B023
        timed("contacts, tasks, field, metric and law", law)
        a = active.law.acceleration
        wanted = timed("inverse dynamics", lambda: state.inverse_dynamics(a).copy())  # noqa: B023
        timed("map of the corner forces", lambda: support.update(active.law))
        timed(
            "minimum-norm forces",
            lambda: support.minimum_norm_forces(wanted),  # noqa: B023
        )
        timed("cones", support.permits)
        # Pinocchio's pass is kept until the state changes: the second call is cheap.
        delivered = timed("deliver, total", lambda: actuation.deliver(a))  # noqa: B023
        key = f"deliver, status {delivered[3]}"
        times.setdefault(key, []).append(times["deliver, total"][-1])
    lines = "| part | median [µs] | steps |\n|---|--:|--:|\n"
    for name, each in times.items():
        lines += f"| {name} | {1e-3 * np.median(each):.0f} | {len(each)} |\n"
    return lines


# ---------------------------------------------------------------------------- main


def compare(
    body: Body, options: argparse.Namespace, say: Callable[[str], None]
) -> None:
    """Run the comparison for a robot, and write its tables."""
    case, chosen = Standing(body), controllers()
    path: list[State] = []
    for title, engine in (("ideal contacts", case.ideal), ("MuJoCo", case.mujoco)):
        say(f"## {body.name}: {title}\n\n{HEADER}")
        for name, make in chosen.items():
            run = close_loop(case, engine(), make(case), options.duration)
            say(row(name, run))
            if name == LAW:
                path = run.states
        say("\n")
    made = {name: make(case)[0] for name, make in chosen.items()}
    say(f"## {body.name}: time of a step\n\n")
    say(timing_table(step_times(made, path, options.rounds, options.block)))
    say(
        f"\nMedians of {options.rounds} interleaved rounds of {options.block} steps "
        "along this law's path on MuJoCo, quartiles in brackets.\n\n"
    )
    reference = f"TSID, posture weight {1e-3:.0e}"
    if reference in made:
        law, statuses = this_law(case)
        for state in path:
            law(*state)
        found = np.array([each[0] for each in statuses])
        costs = beside_tsid.HEADER + "".join(
            beside_tsid.row(
                f"{body.name} on two feet, {what}", law, made[reference], path, chosen
            )
            for what, chosen in (
                ("exact (status 0)", found == "0"),
                ("forces redistributed (1)", found == "1"),
                ("limits active (2)", found == "2"),
            )
        )
        say(f"By the status of this law's step:\n\n{costs}\n{beside_tsid.CPP}\n")
    parts = parts_table(case, path[::5])
    say(
        "Times of the parts of this law's step (*deliver* contains "
        f"map, minimum-norm forces and cones):\n\n{parts}\n"
    )


INTRODUCTION = """# Whole bodies, side by side with TSID

Written by `make bench` (`benchmarks/whole_body_side_by_side.py`); do not edit.

Two soles are on the ground; the centre of mass follows a circle of 3 cm radius, a hand
one of 8 cm, the trunk stays upright, and the posture field attracts to the start.
{duration:g} s from rest at 1 kHz, the effort is held. Both have the same model, soles,
friction pyramids (within the cone of {friction:g}), effort limits, task gains
(ω₀ = 10 1/s) and contact damping; TSID's posture has Kp = 12 and Kd = 8, which is
K_N = 6 and g = -2 (q - q_start). TSID 1.10 has contacts as constraints, forces at the
soles' corners and eiquadprog-fast; tasks have weight 1. There are no joint limits,
neither in the controllers nor in the plants.

All run on one thread. TSID's solver, built with OpenMP, needed 0.12 ms per step with
one and 11 ms with two on a machine with two busy cores. This is not a property of TSID,
and no ratio here is measured like that.

The *ideal contacts* provide any force, also one that a real ground could not:
*outside the cones* is the fraction of instants with such a force. MuJoCo's contacts
slip instead: *soles shifted*. P is the projector into the null space of contacts and
tasks, the same for all. Status of this law: 0 exact, 1 forces redistributed, 2 limited,
3 limits relaxed, and *damped* if the task Jacobian is so near to a loss of rank that
the law is damped and not exact (`singularity_threshold`, at its default). Status of
TSID: 0 solved; otherwise its last effort is held.

"""


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=3.0)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--block", type=int, default=40)
    parser.add_argument("--only", choices=("talos", "g1"))
    out = RESULTS / "whole_body_side_by_side.md"
    parser.add_argument("--out", type=Path, default=out)
    options = parser.parse_args()
    text = ""

    def say(part: str) -> None:
        nonlocal text
        text += part
        print(part, end="", flush=True)

    say(INTRODUCTION.format(duration=options.duration, friction=0.7))
    for body in (TALOS, G1):
        if options.only in (None, body.name):
            compare(body, options, say)
    say(
        f"Python {platform.python_version()}, hsp_control {hsp.__version__}, numpy "
        f"{np.__version__}. Only ratios are valid for other machines.\n"
    )
    options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
