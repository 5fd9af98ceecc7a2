"""Hold and move a hand with arms that are not their models, beside other laws.

    .venv/bin/python benchmarks/real_arm.py [--seeds N] [--arms panda,ur5] [--out FILE]
                                            [--ours]

The same wrong arms for all: masses and inertias ±20 %, centres of mass ±10 mm; and "as
real", with a load of 0.5 kg, rotors of 0.05 kg m² and friction that no model contains,
2 ms of delay, a lag of 3 ms and velocities with noise. Each law has the gains of its
own project. Writes benchmarks/results/real_arm.md. A peer that is not installed is left
out, and named.
"""

import argparse
import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.compensation import CompensatedController, Compensation
from hsp_control.simulation.plants import SampledPlant

TESTS = Path(__file__).resolve().parents[1] / "tests" / "support"
sys.path.insert(0, str(TESTS))
from wrong_arms import ARMS, MORE_ARMS, WrongArm, posture  # noqa: E402

PAGE = Path(__file__).resolve().parent / "results" / "real_arm.md"
PERIOD = 1e-3
RADIUS, RATE = 0.08, 2.0  # of the circle [m, rad/s]
DURATION, SETTLED = 3.0, 2.0  # [s]
AT_REST = 0.05  # fastest joint of an arm that rests [rad/s]
KINDS = {
    "masses": "masses ±20 %, centres ±10 mm",
    "real": "as real: also 0.5 kg, rotors, friction, delay, lag, noise",
}
PEERS = {
    "jacobian_transpose": "JᵀK (crisp_controllers)",
    "isaac_lab_osc": "operational space (Isaac Lab)",
    "robosuite_osc": "operational space (robosuite)",
    "pink_rnea": "pink + RNEA",
    "tsid_pose": "TSID",
}
GUESSED = 0.1
"""Rotors in the model of one row, twice those of the arms as real [kg m²]."""
ROTORS = f"this law, motor_inertia: {GUESSED:g}"
WITHOUT, OURS = "this law, no observer", "this law, as it comes"
IMPEDANCE = "this law, crisp's impedance"

Compute = Callable[[float, Array, Array], Array]


@dataclass
class Point:
    """The target as a controller reads it."""

    position: Array


class Case:
    """A hand that is held, or moves on a circle from its start, as peers read it."""

    def __init__(self, name: str, moves: bool) -> None:
        self.robot = hsp.Robot.load(name)
        self.moves, self.rows = moves, 6
        self.q0 = posture(self.robot, name)
        self.frame = self.robot.end_effector
        rest = np.zeros(self.robot.nv)
        pose = self.robot.state(0.0, self.q0, rest).frame(self.frame)
        self.start, self.rotation = pose.position.copy(), pose.rotation.copy()

    def desired(self, t: float) -> Point:
        """Return the target."""
        angle = RATE * t if self.moves else 0.0
        around = np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0])
        return Point(self.start + RADIUS * around)

    def errors(self, t: float, q: Array) -> tuple[float, float]:
        """Return how far the hand is off [mm, °]."""
        pose = self.robot.state(t, q, np.zeros(self.robot.nv)).frame(self.frame)
        off = np.linalg.norm(self.desired(t).position - pose.position)
        turn = 0.5 * (np.trace(pose.rotation.T @ self.rotation) - 1.0)
        angle = np.degrees(np.arccos(np.clip(turn, -1.0, 1.0)))
        return 1e3 * float(off), float(angle)


def ours(
    case: Case,
    compensation: Compensation,
    impedance: bool = False,
    rotors: float | None = None,
) -> CompensatedController:
    """Return the chain of this law: the default gains, and a posture to return to."""
    robot = hsp.Robot.load(case.robot.name, motor_inertia=rotors)
    options: dict[str, Any] = {}
    if impedance:
        K, D = [600.0] * 3 + [30.0] * 3, [60.0] * 3 + [10.0] * 3
        options["impedance"] = hsp.Impedance(stiffness=K, damping=D)
    task = hsp.FramePose(case.frame, name="hand", **options)
    if case.moves:
        center = case.start - np.array([RADIUS, 0.0, 0.0])
        path = hsp.Circle(RADIUS, RATE, center, axes=np.eye(3)[:2])
        both = hsp.trajectories.ComposedPose(path)
        task = hsp.FramePose(case.frame, both, blend=1.0, name="hand", **options)
    field = hsp.TargetPosture(case.q0) if case.robot.nv > case.rows else None
    made = hsp.Controller(robot, [task], field, start=case.q0)
    return CompensatedController(made, compensation)


def wrong_arm(case: Case, kind: str, seed: int, delay: int = 0) -> SampledPlant:
    """Return the plant: for ``exact`` the model, after a delay [periods]."""
    name = case.robot.name
    if kind == "exact":
        arm = WrongArm(name, seed, mass=0.0, com=0.0, delay=delay)
    elif kind == "masses":
        arm = WrongArm(name, seed)
    else:
        arm = WrongArm(
            name, seed, load=0.5, rotor=0.05, coulomb=0.2, viscous=0.2, delay=2,
            lag=0.003, noise=0.01,
        )  # fmt: skip
    return arm.plant(case.robot)


@dataclass
class Run:
    """Measurements of a run: at its end, or in the circle's last second."""

    position: float = np.inf  # [mm]
    angle: float = np.inf  # [°]
    noise: float = np.inf  # efforts' rms change in a period [N·m]
    wandered: float = np.inf  # the joint farthest from its start, at the end [°]
    rests: bool = False


def measured(case: Case, plant: SampledPlant, compute: Compute) -> Run:
    """Return a run's measurements; all infinite if it diverges."""
    q, v = case.q0.copy(), np.zeros(case.robot.nv)
    plant.reset(0.0, q, v)
    errors, changes, last, fastest = [], [], np.zeros(case.robot.nv), 0.0
    for k in range(round(DURATION / PERIOD)):
        t = k * PERIOD
        try:
            tau = np.array(compute(t, *plant.measure(t, q, v)))
            q, v = plant.advance(t, t + PERIOD, tau)
        except Exception:  # peers raise their own types
            return Run()
        if not np.abs(v).max() < 100.0:
            return Run()
        if t >= SETTLED:
            errors.append(case.errors(t + PERIOD, q))
            changes.append(tau - last)
            fastest = max(fastest, float(np.abs(v).max()))
        last = tau
    off = np.array(errors)
    value = np.sqrt(np.mean(off**2, axis=0)) if case.moves else off[-1]
    noise = float(np.sqrt(np.mean(np.square(changes))))
    wandered = float(np.degrees(np.abs(case.robot.difference(case.q0, q)).max()))
    return Run(float(value[0]), float(value[1]), noise, wandered, fastest < AT_REST)


def laws(
    case: Case, kind: str, missing: dict[str, str], *, alone: bool = False
) -> dict[str, Callable[[], Compute]]:
    """Return the functions that make the controllers of a case."""

    def chain(compensation: Compensation, **options: Any) -> Compute:
        command = ours(case, compensation, **options)
        return lambda t, q, v: command.effort(t, q, v, PERIOD)

    found: dict[str, Callable[[], Compute]] = {
        OURS: lambda: chain(Compensation()),
        WITHOUT: lambda: chain(Compensation(momentum_observer=None)),
        IMPEDANCE: lambda: chain(Compensation(), impedance=True),
    }
    if kind == "real":  # else the arms have no rotors
        found[ROTORS] = lambda: chain(Compensation(), rotors=GUESSED)
    if alone:
        return {name: make for name, make in found.items() if name in (OURS, ROTORS)}
    if case.robot.nq != case.robot.nv:  # peers subtract postures
        return found
    for module, name in PEERS.items():
        try:
            peer = importlib.import_module(f"shared.controllers.{module}")
        except ImportError as error:
            missing[name] = str(error)
            continue
        found[name] = lambda peer=peer: peer.make(case, case.robot.model.copy())
    return found


def borne_delay(case: Case, make: Callable[[], Compute]) -> int:
    """Return the longest delay with which the model itself comes to rest [ms]."""
    longest = 0
    for delay in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32):
        plant = wrong_arm(case, "exact", 0, delay)
        own = plant.measure
        # Seen 1 mm beside, at first: something to settle.
        plant.measure = lambda t, q, v, own=own: own(t, q + 1e-3 * (t == 0.0), v)
        if not measured(case, plant, make()).rests:
            break
        longest = delay
    return longest


def main() -> None:
    """Run, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--arms", default=",".join(ARMS | MORE_ARMS))
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument(
        "--ours", action="store_true", help="this law with its defaults alone"
    )
    options = parser.parse_args()
    missing: dict[str, str] = {}
    alone = f" --ours --seeds {options.seeds}" if options.ours else ""
    introduction = INTRODUCTION.format(seeds=options.seeds, alone=alone)
    tables: dict[str, list[str]] = {kind: [] for kind in KINDS}
    ending: list[str] = []

    def write() -> None:
        lines = [introduction]
        for kind, words in KINDS.items():
            title = f"{words[0].upper()}{words[1:]}"
            lines += ["", f"## {title}", "", HEADER, *tables[kind]]
        why = [f"\nNot installed: {name} ({why})." for name, why in missing.items()]
        text = "\n".join([*lines, *ending, *why]) + "\n"
        options.out.write_text(text, encoding="utf-8")

    for arm in options.arms.split(","):
        for kind in KINDS:
            tables[kind] += rows(arm, kind, options.seeds, missing, options.ours)
        write()  # the available columns
    if options.ours:
        return
    case = Case("panda", moves=False)
    ending += ["", "## The delay that is tolerated", "", BORNE, ""]
    ending += ["| law | Panda [ms] |", "|---|--:|"]
    for name, make in laws(case, "exact", missing).items():
        ending.append(f"| {name} | {borne_delay(case, make)} |")
    write()
    print(f"Wrote {options.out}")


def rows(
    arm: str, kind: str, seeds: int, missing: dict[str, str], alone: bool
) -> list[str]:
    """Return the lines of an arm."""
    runs: dict[str, list[list[Run]]] = {}
    for case in (Case(arm, moves=False), Case(arm, moves=True)):
        for name, make in track(
            laws(case, kind, missing, alone=alone).items(),
            f"{arm}, {kind}",
            transient=True,
        ):
            own = [
                measured(case, wrong_arm(case, kind, seed), make())
                for seed in range(seeds)
            ]
            runs.setdefault(name, []).append(own)
    return [row(arm, name, held, circled) for name, (held, circled) in runs.items()]


def row(arm: str, name: str, held: list[Run], circled: list[Run]) -> str:
    """Return a line of a table."""

    def pair(values: list[float]) -> str:
        return f"{_number(float(np.median(values)))} / {_number(max(values))}"

    cells = [
        pair([each.position for each in held]),
        pair([each.angle for each in held]),
        pair([each.wandered for each in held]),
        pair([each.position for each in circled]),
        pair([each.angle for each in circled]),
        _number(float(np.median([each.noise for each in held]))),
        f"{sum(each.rests for each in held)} of {len(held)}",
    ]
    return f"| {arm} | {name} | {' | '.join(cells)} |"


def _number(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{value:.2g}" if value < 99 else "99+"


BORNE = """\
With which a pose settles on the model itself, whose wrist has no rotors: a damping of
10 N·m·s/rad on 0.007 kg m² tolerates less than a period."""
HEADER = (
    "| arm | law | held: hand [mm] | angle [°] | joint [°] | circle: hand [mm] "
    "| angle [°] | effort's change [N·m] | rests |\n"
    "|---|---|--:|--:|--:|--:|--:|--:|--:|"
)
INTRODUCTION = """\
# Arms that are not their models

Written by `.venv/bin/python benchmarks/real_arm.py{alone}`; do not edit.

A pose is held for 3 s, or the hand moves on a circle of 8 cm at 2 rad/s, at 1 kHz. No
law knows the differences. Median / worst of {seeds} seeds: the pose's error at the end,
and of the joint that is farthest from its start; rms on the circle in its last second;
the rms change of an effort in a period; how many rest, with no joint faster than
0.05 rad/s in the last second. – diverges.

Gains are those of each project: crisp_py's for a Franka, Isaac-Reach-Franka-OSC,
robosuite's `osc_pose.json`, pink's example with Kp = 100 and Kv = 20 in joint space.
TSID has the gains and weights of its UR5 exercise: with Kp = 5 it is 88 mm late on the
circle of an exact model, too.
This law has its defaults (Kp = 100, Kv = 20, K_N = 10): without an observer, as it
comes, with crisp's stiffness as its impedance, where the observer is off because a
spring must yield, and with rotors in its model: 0.1 kg m² for each joint, a guess,
where the arms as real have 0.05. Targets of peers have no velocity, so that they follow
a circle late. Jaco (kinova) has joints that turn on and on, whose angles peers
subtract: it has no rows of theirs."""


if __name__ == "__main__":
    main()
