r"""Compare this law with TSID while Talos stands and walks under the same plan.

    .venv-peers/bin/python \
        hsp_control/companions/walking/benchmark/walking_side_by_side.py

Both stand in the same closed loop on MuJoCo: the plan gets the measurement of the
period, writes references and switches contacts, and the controller follows. Times of a
step are taken in one run, of all controllers in turn at each of its states. Writes a
section of results.md.
"""

# ruff: noqa: E402
import os

# As in whole_body_side_by_side.py: TSID's solver is built with OpenMP.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import importlib
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[4] / "benchmarks"))
from shared.marked_sections import replace_section
from shared.timing import Compute
from walking import PUSH, WALKS

from hsp_control import Experiment, RobotState, load_experiment
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FallError
from hsp_control.control.measurement import Measurement
from hsp_control.simulation.plants import SampledPlant

PERIOD = 1e-3
SECTION = "hsp_control/companions/walking/benchmark/walking_side_by_side.py"
LAW = "this law"
WEIGHTS = (1e-2, 1e-3)  # of TSID's posture
FELL = 20.0  # joint speed at which a run is over [rad/s]
COMMON: dict[str, Any] = {"limits.position": "none"}
"""TSID's tasks here know no joint limits."""
CASES: dict[str, dict[str, Any]] = {
    "stands, pushed to the left": {
        "plan.speed": 0,
        "simulation.duration": 4,
        "plant.pushes": f"[{{frame: torso_2_link, force: [0, {PUSH}, 0], start: 2, "
        "duration: 0.1}]",
    },
    "walks, 0.35 m/s": {"plan.steps": 6, "simulation.duration": 8.5},
    "walks, 0.55 m/s": {
        "plan.speed": 0.55,
        "plan.steps": 6,
        "simulation.duration": 8.5,
    },
    "walks, pushed forward": {
        "plan.steps": 6,
        "simulation.duration": 8.5,
        "plant.pushes": f"[{{frame: torso_2_link, force: [{PUSH}, 0, 0], start: 2.7, "
        "duration: 0.1}]",
    },
}
Made = tuple[Compute, list[str]]
Make = Callable[[Experiment], Made]


def controllers() -> dict[str, Make]:
    """Return functions that make the controllers, by name."""
    made: dict[str, Make] = {LAW: this_law}
    try:
        peer: Any = importlib.import_module("shared.controllers.walking_tsid")
    except ImportError as error:
        print(f"TSID is not installed ({error}): make bench")
        return made
    for weight in WEIGHTS:
        made[f"TSID, posture weight {weight:.0e}"] = _tsid(peer, weight)
    return made


def this_law(experiment: Experiment) -> Made:
    """Return `hsp_control.Controller` as a user calls it."""
    controller, statuses = experiment.controller, list[str]()

    def compute(t: float, q: Array, v: Array) -> Array:
        output = controller.compute(t, q, v)
        statuses.append(str(output.status))
        return output.tau

    return compute, statuses


def _tsid(peer: Any, weight: float) -> Make:
    def make(experiment: Experiment) -> Made:
        made: Made = peer.make(
            experiment.controller,
            experiment.q0,
            gain=float(np.max(experiment.controller.null_space_gain)),
            posture_weight=weight,
        )
        return made

    return make


# ------------------------------------------------------------------- the closed loop


@dataclass
class Run:
    """One closed-loop run."""

    columns: dict[str, list[float]] = field(default_factory=dict)
    statuses: Counter[str] = field(default_factory=Counter)
    failure: str = ""
    way: float = 0.0

    def log(self, values: dict[str, float]) -> None:
        """Add the measurements of a period; missing ones are NaN."""
        for key, value in values.items():
            self.columns.setdefault(key, []).append(value)

    def rms(self, key: str) -> float:
        """Return the root mean square of a column."""
        return float(np.sqrt(np.nanmean(np.square(self.columns[key]))))

    def max(self, key: str) -> float:
        """Return the largest value of a column."""
        return float(np.nanmax(self.columns[key]))


def periods(
    experiment: Experiment, compute: Compute
) -> Iterator[tuple[Measurement, Any, Array]]:
    """Yield measurement, running plan and effort of each period.

    Raises:
        FallError: If the plan finds that the robot falls.
    """
    scenario, plant = experiment.scenario, experiment.plant
    assert isinstance(plant, SampledPlant)
    assert scenario.plan is not None
    plan = scenario.plan.begin(experiment.controller)
    q, v = experiment.q0.copy(), experiment.v0.copy()
    plant.reset(0.0, q, v)
    tau = np.zeros(experiment.robot.nv)
    for k in range(round(scenario.simulation.duration / PERIOD)):
        t = k * PERIOD
        measured = Measurement(
            k, t, q, v, applied=tau, wrenches=plant.contact_wrenches(t, q, v, tau)
        )
        plan.update(measured)
        tau = np.array(compute(t, q, v))
        yield measured, plan, tau
        q, v = plant.advance(t, t + PERIOD, tau)


def close_loop(experiment: Experiment, made: Made) -> Run:
    """Run a controller under the plan, and measure."""
    run, state = Run(), RobotState(experiment.robot)
    compute, statuses = made
    controller = experiment.controller
    tasks: dict[str, Any] = {task.name: task for task in controller.tasks}
    stands: dict[str, Array] = {}
    last: Array | None = None
    q = experiment.q0
    try:
        for measured, plan, tau in periods(experiment, compute):
            t, q, v = measured.t, measured.q, measured.v
            if np.abs(v).max() > FELL:
                run.failure = f"fell at t = {t:.2f} s"
                break
            state.update(t, q, v)
            channels = plan.log_channels()
            height = tasks["center_of_mass"].followed.sample(t).position[2]
            upright = tasks["trunk"].followed.sample(t).rotation
            trunk = state.frame(tasks["trunk"].frame).rotation
            row = {
                "dcm": _norm(
                    channels["plan.dcm"].value - channels["plan.dcm_reference"].value
                ),
                "height": abs(float(state.centroidal.position[2] - height)),
                "trunk": _angle(upright.T @ trunk),
                "effort": _norm(tau),
                "rate": np.nan
                if last is None
                else float(np.abs(tau - last).max()) / PERIOD,
                "foot": np.nan,
                "slip": np.nan,
            }
            last = tau
            for contact in controller.contacts:
                task, at = tasks[contact.name], state.position(contact.frame)
                if task.schedule.active(t):
                    there = task.followed.position.sample(t).position
                    row["foot"] = _norm(at - there)
                if contact.active(t) and contact.weight(t) >= 1.0:
                    first = stands.setdefault(contact.name, at.copy())
                    row["slip"] = np.fmax(row["slip"], _norm(at - first))
                else:
                    stands.pop(contact.name, None)
            run.log(row)
    except FallError as error:
        run.failure = str(error).partition(":")[2].partition(" s ")[0].strip()
        run.failure = f"fell {run.failure} s"
    run.way = _norm(q[:2] - experiment.q0[:2])
    run.statuses.update(statuses)
    return run


def _norm(x: Array) -> float:
    return float(np.linalg.norm(x))


def _angle(rotation: Array) -> float:
    """Return the angle of a rotation [rad]."""
    return float(np.arccos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0)))


HEADER = (
    "| controller | way [m] | ξ rms [mm] | height rms [mm] | trunk rms [mrad] | "
    "swing foot rms / max [mm] | effort rms [N·m] | effort's rate, 99.9 % / max "
    "[kN·m/s] | feet slipped, max [mm] | status |\n"
    "|---|--:|--:|--:|--:|--:|--:|--:|--:|---|\n"
)


def row(name: str, run: Run) -> str:
    """Return a line of the table."""
    steps = run.statuses.total()
    counts = ", ".join(
        f"{status}: {100.0 * count / steps:.3g} %"
        for status, count in sorted(run.statuses.items())
    )
    if run.failure:
        return f"| {name} | {run.failure}" + 8 * " |" + f" {counts} |\n"
    foot = "–"
    if np.isfinite(run.columns["foot"]).any():
        foot = f"{1e3 * run.rms('foot'):.2g} / {1e3 * run.max('foot'):.2g}"
    rate = 1e-3 * np.array(run.columns["rate"])
    cells = [
        f"{run.way:.2f}",
        f"{1e3 * run.rms('dcm'):.2g}",
        f"{1e3 * run.rms('height'):.2g}",
        f"{1e3 * run.rms('trunk'):.2g}",
        foot,
        f"{run.rms('effort'):.0f}",
        f"{np.nanquantile(rate, 0.999):.2g} / {np.nanmax(rate):.2g}",
        f"{1e3 * run.max('slip'):.2g}",
        counts,
    ]
    return f"| {name} | " + " | ".join(cells) + " |\n"


# --------------------------------------------------------------------------- timing


def times(experiment: Experiment, makes: dict[str, Make]) -> dict[str, Array]:
    """Return the time of each step by controller, and the number of feet, (steps,).

    This law drives the robot; the others compute the same steps beside it.
    """
    made = {name: make(experiment)[0] for name, make in makes.items()}
    names, law = list(made), made[LAW]
    found: dict[str, list[float]] = {name: [] for name in [*names, "feet"]}
    now = 0

    def all_of_them(t: float, q: Array, v: Array) -> Array:
        nonlocal now
        now += 1
        tau = np.zeros(experiment.robot.nv)
        turn = now % len(names)
        for name in names[turn:] + names[:turn]:
            started = perf_counter_ns()
            effort = made[name](t, q, v)
            found[name].append(1e-3 * (perf_counter_ns() - started))
            if made[name] is law:
                tau = np.array(effort)
        bearing = sum(each.active(t) for each in experiment.controller.contacts)
        found["feet"].append(float(bearing))
        return tau

    for _ in periods(experiment, all_of_them):
        pass
    return {name: np.array(each) for name, each in found.items()}


def timing_table(taken: dict[str, Array]) -> str:
    """Return the ratios of each step to TSID's, on two feet and on one."""
    feet = taken.pop("feet")
    reference = next((name for name in taken if name.endswith("1e-03")), LAW)
    lines = f"| time of a step, {reference} = 1 | on two feet | on one foot |\n"
    lines += "|---|--:|--:|\n"
    for name, each in taken.items():
        cells = []
        for count in (2.0, 1.0):
            ratio = (each / taken[reference])[feet == count]
            low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
            cells.append(f"{middle:.2f} ({low:.2f} to {high:.2f})")
        lines += f"| {name} | " + " | ".join(cells) + " |\n"
    return lines


INTRODUCTION = """Talos stands and walks under the same plan, on MuJoCo at 1 kHz. The
plan receives the measurements of its closed loop and returns references (so the error
of the divergent component ξ includes the controller's tracking error). Both have the
same gains, soles, friction pyramids, effort limits and contact damping, and the forces
of a foot that comes or goes fade alike; neither has joint limits. TSID 1.10 has soles
as constraints that are added and removed, centre of mass, trunk and swing foot with
weight 1, and a posture (Kp = 6, Kd = 7: K_N = 6 and g = -(q - q_start)). Status of this
law: 0 exact, 1 forces redistributed, 2 limited, 3 limits relaxed; of TSID: 0 solved,
otherwise its last effort is held. *Slipped*: the motion of a sole under full load.

"""


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", default="", help="part of the names of cases")
    parser.add_argument("--dry", action="store_true", help="write no page")
    options = parser.parse_args()
    text, makes = INTRODUCTION, controllers()
    for name, values in CASES.items():
        if options.case not in name:
            continue
        overrides = [f"{key}={value}" for key, value in (COMMON | values).items()]
        text += f"**{name.capitalize()}**\n\n{HEADER}"
        for controller, make in makes.items():
            experiment = load_experiment(WALKS["talos"], *overrides)
            text += row(controller, close_loop(experiment, make(experiment)))
            print(text.splitlines()[-1], flush=True)
        text += "\n"
    walked = CASES["walks, 0.35 m/s"] | {"plan.steps": 4, "simulation.duration": 5}
    overrides = [f"{key}={value}" for key, value in (COMMON | walked).items()]
    table = timing_table(times(load_experiment(WALKS["talos"], *overrides), makes))
    text += (
        f"{table}\nAll at the same states of one run, in turn, through Python with the "
        "references; medians and quartiles over the steps.\n"
    )
    print(table)
    if not options.dry:
        replace_section(Path(__file__).with_name("results.md"), SECTION, text)


if __name__ == "__main__":
    main()
