"""Measure steps of a frozen controller in C, in turns with the same in Python.

    .venv/bin/python benchmarks/without_python.py [CONFIG ...] [--turns N]

A step is `compute` and `applied`; a turn is 100,000 of them along the first ten seconds
of the run. The efforts are the same to the last bit. Writes
benchmarks/results/without_python.md.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.frozen import include_folder, library
from hsp_control.live.real_time import no_garbage_collection

STEPS, REPEATS, H = 10_000, 10, 0.001
Rows = NDArray[np.float64]


def states_of(experiment: hsp.Experiment) -> Rows:
    """Return rows of t, q and v of the closed loop."""
    own, robot = experiment.controller.preview(), experiment.robot
    q, v, rows = experiment.q0.copy(), experiment.v0.copy(), []
    for k in range(STEPS):
        rows.append([k * H, *q, *v])
        tau = own.compute(k * H, q, v).tau
        own.applied(tau, H)
        v = v + H * robot.forward_dynamics(q, v, tau)
        q = robot.integrate(q, H * v)
    return np.array(rows)


def times_in_python(experiment: hsp.Experiment, states: Rows) -> Rows:
    """Return the time of each step [us]."""
    own, nq = experiment.controller.preview(), experiment.robot.nq
    given = [(row[0], row[1 : 1 + nq].copy(), row[1 + nq :].copy()) for row in states]
    found, out = [], hsp.ControlOutput()
    with no_garbage_collection():
        for _ in range(REPEATS):
            own.restart()
            for t, q, v in given:
                begin = perf_counter_ns()
                own.compute(t, q, v, out=out)
                own.applied(out.tau, H)
                found.append(perf_counter_ns() - begin)
    return 1e-3 * np.array(found)


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "configs", nargs="*", default=["panda_limits", "panda_obstacle"]
    )
    parser.add_argument("--turns", type=int, default=10)
    options = parser.parse_args()
    compiler = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
    if compiler is None:
        sys.exit("no C compiler is there")
    with tempfile.TemporaryDirectory() as folder:
        place, own = Path(folder), library()
        program = place / "steps"
        source = Path(__file__).with_suffix(".c")
        flags = ["-O2", f"-I{include_folder()}", str(own), f"-Wl,-rpath,{own.parent}"]
        subprocess.run([compiler, source, *flags, "-o", program], check=True)
        table = (
            "| configuration | in | median [µs] | 99.9 % | largest |\n"
            "|---|---|--:|--:|--:|\n"
        )
        for name in options.configs:
            experiment = hsp.load_experiment(name)
            frozen = hsp.freeze(experiment.controller, place / "frozen.hsp")
            states = states_of(experiment)
            (place / "states").write_bytes(states.tobytes())
            command = [program, frozen, place / "states", str(STEPS), str(REPEATS)]
            times: dict[str, list[Rows]] = {"C": [], "Python": []}
            for _ in range(options.turns):
                done = subprocess.run(command, capture_output=True, check=True)
                times["C"].append(1e-3 * np.frombuffer(done.stdout, dtype=np.int64))
                times["Python"].append(times_in_python(experiment, states))
            for where, each in times.items():
                p50, p999, most = np.quantile(np.concatenate(each), [0.5, 0.999, 1.0])
                table += f"| {name} | {where} | {p50:.1f} | {p999:.1f} | {most:.0f} |\n"
    print(table)
    replace_section(RESULTS / "without_python.md", "without_python", table)


if __name__ == "__main__":
    main()
