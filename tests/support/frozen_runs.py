"""Frozen controllers run by a C program, and the same controllers in Python."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import hsp_control as hsp
from hsp_control.frozen import compiler_flags

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples/without_python"
Rows = NDArray[np.float64]


def compiled(source: Path, folder: Path, *flags: str, language: str = "c") -> Path:
    """Compile a source and return the program; skip without a compiler."""
    names = ("cc", "gcc", "clang") if language == "c" else ("c++", "g++", "clang++")
    variable = os.environ.get("CC" if language == "c" else "CXX")
    found = next(filter(shutil.which, names), None)
    if not variable and not found:
        pytest.skip(f"no compiler for {source.name}: none of {', '.join(names)}")
    compiler = shlex.split(variable or str(found))
    program = folder / source.stem
    command = [*compiler, "-O1", "-Wall", "-Wextra", "-Werror", str(source), *flags]
    command += shlex.split(compiler_flags())
    subprocess.run([*command, "-o", str(program)], check=True)
    return program


def replayed(program: Path, frozen: Path, states: Rows) -> Rows:
    """Return status and tau of a frozen controller at rows of t, q and v."""
    lines = "\n".join(" ".join(f"{x:.17g}" for x in row) for row in states)
    environment = {"PATH": "/usr/bin:/bin"}  # without Python's environment
    # The sanitizer's options, and the C library's: which processor's sines it computes.
    for name in ("ASAN_OPTIONS", "GLIBC_TUNABLES"):
        if name in os.environ:
            environment[name] = os.environ[name]
    done = subprocess.run(
        [program, frozen],
        input=lines,
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    rows = [[float(x) for x in line.split()] for line in done.stdout.splitlines()]
    return np.array(rows)


def computed(controller: hsp.Controller, states: Rows, period: float = 0.001) -> Rows:
    """Return status and tau of a controller at rows of t, q and v, from its start."""
    own, nq = controller.preview(), controller.robot.nq
    found = []
    for t, *x in states:
        output = own.compute(t, np.array(x[:nq]), np.array(x[nq:]))
        own.applied(output.tau, period)
        found.append([float(output.status), *output.tau])
    return np.array(found)


def random_states(
    robot: hsp.Robot, q: Rows, count: int, seed: int, *, away: float, speed: float
) -> Rows:
    """Return rows of t, q and v around a configuration, a millisecond apart."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(count):
        moved = robot.integrate(q, rng.uniform(-away, away, robot.nv))
        rows.append([0.001 * k, *moved, *rng.normal(0.0, speed, robot.nv)])
    return np.array(rows)


def simulated_states(experiment: hsp.Experiment, duration: float) -> Rows:
    """Return rows of t, q and v of a closed loop, one per effort."""
    own, robot = experiment.controller.preview(), experiment.robot
    period = 0.001
    q, v = experiment.q0.copy(), experiment.v0.copy()
    rows = []
    for k in range(round(duration / period)):
        rows.append([k * period, *q, *v])
        tau = own.compute(k * period, q, v).tau
        own.applied(tau, period)
        a = robot.forward_dynamics(q, v, tau)
        v = v + period * a
        q = robot.integrate(q, period * v)
    return np.array(rows)


def commanded(
    controller: hsp.Controller,
    compensation: hsp.compensation.Compensation,
    states: Rows,
    period: float = 0.001,
) -> Rows:
    """Return status and tau of a controller with compensators, from its start."""
    command = hsp.compensation.CompensatedController(controller.preview(), compensation)
    nq, found = controller.robot.nq, []
    for t, *x in states:
        tau = command.effort(t, np.array(x[:nq]), np.array(x[nq:]), period)
        found.append([float(command.output.status), *tau])
    return np.array(found)
