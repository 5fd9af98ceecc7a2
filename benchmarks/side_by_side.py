"""Run the same Panda task with this law and with the usual alternatives.

    make bench          or          .venv-peers/bin/python benchmarks/side_by_side.py

First every controller runs the case in closed loop with the same simulator. Those that
track are then timed, in one process, interleaved. Prints the tables and writes them to
results/side_by_side.md. A peer that is not installed gets a row with the reason.
"""

import argparse
import importlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from shared import beside_tsid
from shared.cases import FRAME, Case
from shared.controllers import operational_space, this_law
from shared.many_tasks import humanoid, two_arms
from shared.marked_sections import RESULTS
from shared.steps_in_cpp import StepsInCpp
from shared.timing import Compute, State, ratios, spread, step_times
from shared.tsid_in_cpp import CppSteps

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.null_space.fields import Manipulability
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import RigidBodyPlant

Make = Callable[[Case], Compute]

ROOT = Path(__file__).resolve().parent.parent
KHATIB = "operational space (NumPy)"
MAX_ERROR = 0.02  # a controller with a larger rms error is not timed [m]
STEP = 2.5e-4  # the simulator's fourth-order step [s]
EVERY = 4  # control periods between two measurements


# ----------------------------------------------------------------------- the peers


def peers() -> tuple[dict[str, Make], dict[str, tuple[str, Make]], dict[str, str]]:
    """Return controllers to compare, controllers to time, and why peers are missing.

    A controller to time comes with the name of the run that must track before.
    """
    law, khatib = "this law", "operational space + posture"
    compared: dict[str, Make] = {law: this_law.make, khatib: operational_space.make}
    timed: dict[str, tuple[str, Make]] = {
        "the Pinocchio calls alone": (law, _pinocchio_calls),
        law: (law, _this_law),
        "this law, and `diagnose`": (
            law,
            partial(_this_law, reads=hsp.Controller.diagnose),
        ),
        "this law, and its singular values": (law, partial(_this_law, reads=_values)),
        "this law, manipulability": (law, partial(_this_law, name="manipulability")),
        "this law, one obstacle (capsules)": (law, partial(_this_law, name="obstacle")),
        KHATIB: (khatib, operational_space.make),
    }
    missing: dict[str, str] = {}
    if tsid := _module("tsid_peer", missing):
        for weight in (1e-1, 1e-2, 1e-3, 1e-4):
            compared[f"TSID, posture weight {weight:.0e}"] = partial(
                tsid.make, posture_weight=weight
            )
        strict = "TSID, pose as constraint"
        compared[strict] = partial(tsid.make, strict=True)
        compared[f"{strict}, given g'"] = partial(
            tsid.make, strict=True, exact_rate=True
        )
        timed["TSID"] = ("TSID, posture weight 1e-03", tsid.make)
        timed[strict] = (strict, partial(tsid.make, strict=True))
    if pink := _module("pink_peer", missing):
        compared["pink + RNEA"] = pink.make
        compared["pink + RNEA, pose as constraint"] = partial(pink.make, strict=True)
        for solver in ("quadprog", "daqp", "proxqp"):
            make = partial(pink.make, solver=solver)
            timed[f"pink ({solver}) + RNEA"] = ("pink + RNEA", make)
    return compared, timed, missing


def _this_law(
    case: Case, name: str = "centering", *, reads: this_law.Reads | None = None
) -> Compute:
    fields: dict[str, hsp.NullSpaceField] = {
        "centering": hsp.JointCentering(weights=2.0),
        "manipulability": Manipulability(FRAME),
        "obstacle": hsp.TargetPosture(case.q0) + 0.3 * case.clearance,
    }
    return this_law.make(case, fields[name], reads=reads)


def _values(controller: hsp.Controller) -> Array:
    return controller.diagnose().singular_values


def _pinocchio_calls(case: Case) -> Compute:
    """Return the calls that every controller with J, J' and inverse dynamics needs."""
    model, data = case.robot.model, case.robot.model.createData()
    frame, a = model.getFrameId(FRAME), np.zeros(case.robot.nv)

    def compute(t: float, q: Array, v: Array) -> Array:
        pin.computeJointJacobiansTimeVariation(model, data, q, v)
        pin.updateFramePlacement(model, data, frame)
        return pin.rnea(model, data, q, v, a)

    return compute


def _module(name: str, missing: dict[str, str]) -> Any:
    try:
        return importlib.import_module(f"shared.controllers.{name}")
    except ImportError as error:
        peer = name.removesuffix("_peer")
        record = Path(sys.prefix) / "peers.json"
        known = json.loads(record.read_text()) if record.exists() else {}
        missing[peer] = known.get(peer, {}).get("failed", str(error))
        return None


# ------------------------------------------------------------------- the closed loop


@dataclass
class Run:
    """The closed-loop run of one controller."""

    columns: dict[str, Array] = field(default_factory=dict)
    failure: str = ""
    states: list[tuple[float, Array, Array]] = field(default_factory=list)

    def rms(self, name: str) -> float:
        """Return the root mean square of a column after the transient."""
        return float(np.sqrt((self.columns[name] ** 2).mean()))

    @property
    def tracks(self) -> bool:
        """Whether the controller tracks, so that it may be timed."""
        return not self.failure and self.rms("position") < MAX_ERROR


def close_loop(case: Case, make: Make) -> Run:
    """Run a controller on the rigid-body plant, with its effort held every period."""
    run, rows = Run(), []
    plant, integrator = RigidBodyPlant(case.robot), Rk4(STEP)
    q, v = case.q0.copy(), np.zeros(case.robot.nv)
    tau = np.zeros(case.robot.nv)

    def accelerate(t: float, q: Array, v: Array) -> Array:
        return plant.acceleration(t, q, v, tau)

    try:
        compute = make(case)
        for k in range(round(case.duration / case.period)):
            t = k * case.period
            run.states.append((t, q, v))
            tau[:] = compute(t, q, v)
            if t >= case.settled and k % EVERY == 0:
                effort = {"effort": float(np.linalg.norm(tau))}
                rows.append(case.measure(t, q, v) | effort)
            q, v = integrator.advance(case.robot, accelerate, t, t + case.period, q, v)
            if not np.abs(v).max() < 50.0:
                raise RuntimeError(f"diverged at t = {t:.2f} s")
    except Exception as error:  # peers raise their own types: report it in a row
        reason = (str(error).splitlines() or [""])[0]
        run.failure = f"{type(error).__name__}: {reason}"
    if rows and not run.failure:
        run.columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return run


HEADER = (
    "| controller | position rms / max [mm] | orientation rms [mrad] | "
    "‖P(g − v)‖ rms [rad/s] | relative to ‖P g‖ | minimum distance [mm] | "
    "smallest det(J Jᵀ) | ‖q − q_home‖ rms | effort rms [N·m] |\n"
    "|---|--:|--:|--:|--:|--:|--:|--:|--:|\n"
)


def row(name: str, run: Run) -> str:
    """Return a line of the closed-loop table."""
    if run.failure:
        return f"| {name} | {run.failure} |" + 7 * " |" + "\n"
    c, error = run.columns, run.rms("null_space_error")
    share = f"{100.0 * error / run.rms('null_space_flow'):.1f} %"
    if name.startswith("operational space"):  # its projector is in the metric M
        own = run.rms("null_space_error_M") / run.rms("null_space_flow_M")
        share += f" ({100.0 * own:.1f} % in its metric M)"
    cells = [
        f"{1e3 * run.rms('position'):.2g} / {1e3 * c['position'].max():.2g}",
        f"{1e3 * run.rms('orientation'):.2g}" if c["orientation"].any() else "free",
        f"{error:.2g}",
        share,
        f"{1e3 * c['distance'].min():.1f}",
        f"{c['manipulability'].min():.2g}",
        f"{run.rms('posture'):.2f}",
        f"{run.rms('effort'):.1f}",
    ]
    return f"| {name} | " + " | ".join(cells) + " |\n"


# --------------------------------------------------------------------------- timing


def case_times(
    case: Case, timed: dict[str, Make], rounds: int, block: int
) -> tuple[dict[str, Array], list[State]]:
    """Return the controllers' step times [s] along the law's path, and that path."""
    path = close_loop(case, this_law.make).states
    controllers: dict[str, Any] = {name: make(case) for name, make in timed.items()}
    law = "this law"
    if law in controllers:
        controllers["this law in C++"] = StepsInCpp(controllers[law].controller, path)
    if "TSID" in controllers:
        controllers[CPP] = CppSteps(controllers["TSID"], path)
    return step_times(controllers, path, rounds, block), path


def near_and_far(case: Case, say: Callable[[str], None]) -> str:
    """Time steps with the ball within the field's influence, and outside of it.

    Returns:
        The rows.
    """
    law = _this_law(case, name="obstacle")
    peer = importlib.import_module("shared.controllers.tsid_peer").make(case)
    states = close_loop(case, this_law.make).states
    probe = hsp.RobotState(case.robot)
    near = np.array(
        [
            case.clearance.minimum_distance(probe.update(*s)) < case.clearance.influence
            for s in states
        ]
    )
    rows = "".join(
        beside_tsid.row(f"Panda, {'pose' if case.rows == 6 else 'position'}, {what}",
                        law, peer, states, chosen)
        for what, chosen in (("ball near", near), ("ball far", ~near))
    )  # fmt: skip
    say(rows)
    return rows


def timing_table(times: dict[str, Array], extra: str = "") -> str:
    """Return a table of ratios, each with the quartiles over the rounds."""
    references = [n for n in REFERENCES if n in times]
    lines = "| controller | " + "".join(f"{n} = 1 | " for n in references) + "µs |\n"
    lines += "|---|" + (len(references) + 1) * "--:|" + "\n"
    for name, taken in times.items():
        cells = [spread(ratios(times, name, reference)) for reference in references]
        cells.append(f"{1e6 * np.median(taken):.1f}")
        lines += f"| {name} | " + " | ".join(cells) + " |\n"
    return lines + extra


CPP = "TSID in C++"
REFERENCES = ("TSID", CPP, "pink (quadprog) + RNEA")


def placo_row(
    case: Case, times: dict[str, Array], path: list[State], rounds: int, block: int
) -> str:
    """Return placo's row, timed in its own environment.

    Both environments run the operational-space controller: placo's ratio to it there
    times its ratio here is placo's ratio.
    """
    python = ROOT / ".venv-placo" / "bin" / "python"
    record = Path(sys.prefix) / "peers.json"
    known = json.loads(record.read_text()) if record.exists() else {}
    name, rest = "placo, over the operational space", len(REFERENCES) * " |" + "\n"
    if not python.exists() or "failed" in known.get("placo", {}):
        reason = known.get("placo", {}).get("failed", "no .venv-placo: make bench")
        return f"| placo | not installed: {reason} |{rest}"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.npz"
        case.save(file, path)
        script = ROOT / "benchmarks" / "shared" / "placo_side.py"
        done = subprocess.run(
            [str(python), str(script), str(file), str(rounds), str(block)],
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT / "benchmarks")},
        )
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or [""])[-1]
        return f"| placo | failed: {reason} |{rest}"
    result = json.loads(done.stdout.splitlines()[-1])
    if result["rms"]["placo"] > MAX_ERROR:
        error = 1e3 * result["rms"]["placo"]
        return f"| placo | does not track: {error:.0f} mm |{rest}"
    cells = []
    for reference in REFERENCES:
        if reference in times:
            ratio_here = np.median(times[KHATIB] / times[reference])
            ratios_there = np.quantile(result["ratio"], [0.25, 0.5, 0.75])
            cells.append(spread(ratio_here * ratios_there))
    cells.append(f"{result['microseconds']:.1f}")
    return f"| {name} (pin {result['pin']}) | " + " | ".join(cells) + " |\n"


def larger_robots(rounds: int, block: int, say: Callable[[str], None]) -> None:
    """Time this law and TSID on larger robots."""
    say("## Larger robots, several poses at once\n\n")
    say("| problem | this law, rms [mm] | TSID, rms [mm] | this law / TSID | µs |\n")
    say("|---|--:|--:|--:|--:|\n")
    for make in (two_arms, humanoid):
        problem = make()
        compute = {"law": problem.law(), "TSID": problem.tsid()}
        runs = {name: problem.run(c, 2.0) for name, c in compute.items()}
        errors = {name: rms for name, (rms, _) in runs.items()}
        line = (
            f"| {problem.name} | {1e3 * errors['law']:.2g} | {1e3 * errors['TSID']:.2g}"
        )
        if max(errors.values()) > MAX_ERROR:
            say(f"{line} | not timed: does not track | |\n")
            continue
        states = runs["law"][1]
        times = step_times(compute, states, rounds, block)
        quartiles = ratios(times, "law", "TSID")
        say(f"{line} | {spread(quartiles)} | {1e6 * np.median(times['law']):.0f} |\n")
    say("\nA pose for each frame, and a posture; settings as for the Panda.\n\n")


# ----------------------------------------------------------------------------- main

TEXT = """\
# Side by side

Written by `make bench` (`benchmarks/side_by_side.py`); do not edit.

A Panda's hand draws a circle of 0.1 m at 2 rad/s, from rest, while a ball of 0.1 m
moves near the elbow. Start, trajectory, ball, gains (ω0 = {w0:g} 1/s
critically damped, K_N = {K_N:g} 1/s, posture rate {alpha:g} 1/s) and simulator (rigid
bodies, effort held for 1 ms, RK4 of 0.25 ms) are the same for all; numbers are from
{settled:g} s to {duration:g} s. The field g attracts to the home posture and repels
from the ball; P is the Euclidean null-space projector. `benchmarks/README.md` has the
settings of each controller, and the form of g in it.

"""


def main() -> None:
    """Compare and time the controllers, print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=35, help="rounds of timing")
    parser.add_argument("--block", type=int, default=200, help="steps in a round")
    parser.add_argument("--duration", type=float, default=8.0, help="of a run [s]")
    parser.add_argument("--only", help="run controllers whose name contains this")
    parser.add_argument("--out", type=Path, default=RESULTS / "side_by_side.md")
    options = parser.parse_args()

    compared, timed, missing = peers()
    selected = options.only or ""
    base = Case()
    text = TEXT.format(
        w0=base.natural_frequency,
        K_N=base.null_space_gain,
        alpha=base.posture_rate,
        settled=base.settled,
        duration=options.duration,
    )
    print(text, end="")

    def say(line: str) -> None:
        nonlocal text
        text += line
        print(line, end="", flush=True)

    tracked: dict[int, set[str]] = {6: set(), 3: set()}
    for rows, title in ((6, "Pose (6 rows)"), (3, "Position (3 rows)")):
        say(f"## {title}, one moving obstacle\n\n" + HEADER)
        for name, make in compared.items():
            if selected in name and not (rows == 3 and name.startswith("pink + RNEA,")):
                run = close_loop(Case(rows=rows, duration=options.duration), make)
                say(row(name, run))
                if run.tracks:
                    tracked[rows].add(name)
        without = Case(rows=rows, obstacle=False, duration=options.duration)
        say(row("this law, field without the ball", close_loop(without, this_law.make)))
        for name, reason in missing.items():
            say(f"| {name} | not installed: {reason} |" + 7 * " |" + "\n")
        say("\n")

    span = 0.001 * (options.rounds * options.block + 20)
    measured: dict[int, dict[str, Array]] = {}
    for rows, title in ((6, "Pose (6 rows)"), (3, "Position (3 rows)")):
        say(f"## {title}: time of a step\n\n")
        case = Case(rows=rows, obstacle=False, duration=span)
        chosen = {n: make for n, (run, make) in timed.items() if run in tracked[rows]}
        times, path = case_times(case, chosen, options.rounds, options.block)
        measured[rows] = times
        placo = ""
        if KHATIB in times:
            placo = placo_row(case, times, path, options.rounds, options.block)
        say(timing_table(times, placo))
        say(
            f"\nMedians of {options.rounds} interleaved rounds of {options.block} "
            "steps, one process, quartiles in brackets; each step takes (t, q, v) and "
            "returns an effort; TSID in C++ is the same without Python, with its "
            "references computed before, which this law in C++ computes. Default of a "
            "row: hand task, posture or centering, no obstacle. In the row with the "
            "ball, the ball is within the field's influence in some rounds only: see "
            "below. placo runs in its own environment; its ratio is the product of its "
            "ratio to the operational space there and of that controller's ratio "
            "here.\n\n"
        )
    if "tsid" not in missing and not options.only:
        larger_robots(options.rounds, options.block, say)
        say(f"## The ball near and far\n\n{beside_tsid.HEADER}")
        rows = "".join(
            near_and_far(Case(rows=rows, obstacle=False, duration=span), say)
            for rows in (6, 3)
        )
        say(f"\n{beside_tsid.CPP}\n")
    say(
        f"Python {platform.python_version()}, {os.cpu_count()} cores, hsp_control "
        f"{hsp.__version__}, numpy {np.__version__}. Only ratios are valid for other "
        "machines.\n"
    )
    options.out.write_text(text)


if __name__ == "__main__":
    main()
