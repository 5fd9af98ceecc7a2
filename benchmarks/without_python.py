"""Measure steps of a frozen controller in C, in turns with the same in Python.

    .venv/bin/python benchmarks/without_python.py [CONFIG ...] [--turns N] [--fifo N]

A step is `compute` and `applied`; a turn is 100,000 of them along the first ten seconds
of the run, ten turns are a million. The efforts are the same to the last bit. ``pose``
is the Panda of `side_by_side.py`; in .venv-peers TSID in C++ computes its steps, too,
with its references made before. ``--fifo`` gives all real-time priority. Writes
benchmarks/results/without_python.md: its tables of an idle machine, or of a busy one.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shared.cases import Case
from shared.controllers import this_law
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.frozen import compiler_flags
from hsp_control.live.real_time import no_garbage_collection, real_time_priority

STEPS, REPEATS, H = 10_000, 10, 0.001
PAUSE = 0.02
"""Between passes [s]: Linux stops a real-time process that takes 95 % of a second."""
IDLE = 0.5
"""Load of a machine on which nothing else runs."""
Rows = NDArray[np.float64]
Turn = Callable[[], Rows]
"""Makes the steps of a turn, and returns their times [us]."""


def states_of(controller: hsp.Controller, q: Rows, v: Rows) -> Rows:
    """Return rows of t, q and v of the closed loop."""
    own, robot = controller.preview(), controller.robot
    q, v, rows = q.copy(), v.copy(), []
    for k in range(STEPS):
        rows.append([k * H, *q, *v])
        tau = own.compute(k * H, q, v).tau
        own.applied(tau, H)
        v = v + H * robot.forward_dynamics(q, v, tau)
        q = robot.integrate(q, H * v)
    return np.array(rows)


def in_python(controller: hsp.Controller, states: Rows) -> Turn:
    """Return turns of a controller."""
    own, nq = controller.preview(), controller.robot.nq
    given = [(row[0], row[1 : 1 + nq].copy(), row[1 + nq :].copy()) for row in states]

    def turn() -> Rows:
        found = []
        with no_garbage_collection():
            for _ in range(REPEATS):
                sleep(PAUSE)
                own.restart()
                for t, q, v in given:
                    begin = perf_counter_ns()
                    own.applied(own.compute(t, q, v).tau, H)
                    found.append(perf_counter_ns() - begin)
        return 1e-3 * np.array(found)

    return turn


def in_c(controller: hsp.Controller, states: Rows, program: Path) -> Turn:
    """Return turns of the same, frozen."""
    place = program.parent
    frozen = hsp.freeze(controller, place / "frozen.hsp")
    (place / "states").write_bytes(states.tobytes())
    command = [program, frozen, place / "states", str(STEPS), str(REPEATS)]

    def turn() -> Rows:
        done = subprocess.run(command, capture_output=True, check=True)
        return 1e-3 * np.frombuffer(done.stdout, dtype=np.int64)

    return turn


def tsid_in_cpp(case: Case, states: Rows) -> Turn | None:
    """Return turns of TSID, if it is there."""
    try:
        from shared.controllers import tsid_peer
        from shared.tsid_in_cpp import CppSteps

        peer = tsid_peer.make(case)
    except (ImportError, AttributeError):
        return None
    nq = case.robot.nq
    rows = [(row[0], row[1 : 1 + nq].copy(), row[1 + nq :].copy()) for row in states]
    steps = CppSteps(peer, rows)

    def turn() -> Rows:
        assert peer is not None  # which keeps TSID's robot
        passes = []
        for _ in range(REPEATS):
            sleep(PAUSE)
            passes.append(1e-3 * steps.elapsed(0, len(rows)))
        return np.concatenate(passes)

    return turn


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "configs", nargs="*", default=["pose", "panda_limits", "panda_obstacle"]
    )
    parser.add_argument("--turns", type=int, default=10)
    parser.add_argument("--fifo", type=int, metavar="PRIORITY")
    options = parser.parse_args()
    compiler = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
    if compiler is None:
        sys.exit("no C compiler is there")
    load = os.getloadavg()[0]
    table = (
        f"A load of {load:.1f} on {os.cpu_count()} cores, {options.turns} turns.\n\n"
        "| steps | in | median [µs] | 99.9 % | largest |\n|---|---|--:|--:|--:|\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "steps"
        flags = ["-O2", *shlex.split(compiler_flags()), "-o", program]
        subprocess.run([compiler, Path(__file__).with_suffix(".c"), *flags], check=True)
        for name in options.configs:
            case = Case()
            if name == "pose":
                law: Any = this_law.make(case)
                controller: hsp.Controller = law.controller
                q, v = case.q0, np.zeros(case.robot.nv)
            else:
                experiment = hsp.load_experiment(name)
                controller = experiment.controller
                q, v = experiment.q0, experiment.v0
            states = states_of(controller, q, v)
            turns: dict[str, Turn | None] = {
                "C": in_c(controller, states, program),
                "Python": in_python(controller, states),
                "TSID in C++": tsid_in_cpp(case, states) if name == "pose" else None,
            }
            times: dict[str, list[Rows]] = {}
            with real_time_priority(options.fifo):
                for _ in range(options.turns):
                    for where, turn in turns.items():
                        if turn is not None:
                            times.setdefault(where, []).append(turn())
            for where, each in times.items():
                p50, p999, most = np.quantile(np.concatenate(each), [0.5, 0.999, 1.0])
                table += f"| {name} | {where} | {p50:.1f} | {p999:.1f} | {most:.0f} |\n"
    print(table)
    section = "fifo" if options.fifo else "usual"
    if load < IDLE:
        section = f"idle {section}"
    replace_section(RESULTS / "without_python.md", section, table)


if __name__ == "__main__":
    main()
