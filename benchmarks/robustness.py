"""Measure all compensators on all imperfect plants: two arms, two engines.

    .venv/bin/python benchmarks/robustness.py [--fresh] [--tables]

Runs one motion with the nominal model, on Pinocchio's plant and on
MuJoCo's. Writes results/robustness.csv, and from it the tables of
results/robustness.md. Runs that are in the CSV are not repeated, so that the script can
be stopped and continued; ``--fresh`` deletes the CSV, ``--tables`` only
writes the page and its figure. Takes half an hour on two cores.
"""

import csv
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track
from shared.iiwa_inertias import write_urdf
from shared.marked_sections import RESULTS, replace_section
from shared.robustness_figure import draw_figure

from hsp_control import load_experiment
from hsp_control.control.compensation import CompensatedController
from hsp_control.simulation.plants import (
    ContinuousPlant,
    IntegratedPlant,
    SampledPlant,
)

PROCESSES = 3
SETTLED = 1.5  # the transient of the start is over [s]
CSV = RESULTS / "robustness.csv"
HANDS = {"panda": "panda_tcp", "iiwa14": "iiwa_link_ee"}
ENGINES = {"rigid_body": "Pinocchio", "mujoco": "MuJoCo"}
MEASURES = {"error": "task error [mm]", "e_N": "‖e_N‖ [rad/s]", "rate": "rate [N·m/s]"}

RANDOM = {"inertias": {"random_mass": 0.2, "random_inertia": 0.2, "random_com": 0.01}}
COULOMB, VISCOUS = [0.8, 0.8, 0.6, 0.6, 0.3, 0.3, 0.2], 0.2
FRICTION = {"friction": {"coulomb": COULOMB, "viscous": VISCOUS}}
NOISE = {"sensors": {"velocity_noise": 0.02}}
ENCODER = {
    "sensors": {
        "encoder_resolution": 2.0 * np.pi / 2**19,
        "differenced_velocity": True,
    }
}
KNOWN = 0.8  # fraction of the true friction that the feed-forward uses
FEED_FORWARD = {"coulomb": [KNOWN * c for c in COULOMB], "viscous": KNOWN * VISCOUS}


@dataclass(frozen=True)
class Row:
    """An imperfect plant, one row of a table.

    Attributes:
        name: Its imperfections.
        plant: The same, for the configuration.
        frequency: Control frequency [Hz].
        seeds: Seeds of random imperfections; the table has the root mean square.
        imagined: Whether the feed-forward compensates friction that does not exist.
        robot: The only robot with this row; None: all.
    """

    name: str
    plant: dict[str, Any] = field(default_factory=dict)
    frequency: int = 1000
    seeds: tuple[int, ...] = (1,)
    imagined: bool = False
    robot: str | None = None

    @property
    def delay(self) -> int:
        """Delay of its efforts [periods]."""
        return int(self.plant.get("drives", {}).get("delay", 0))

    @property
    def noisy(self) -> bool:
        """Whether its sensors have noise."""
        return "sensors" in self.plant

    @property
    def friction(self) -> dict[str, Any] | None:
        """The friction parameters of the feed-forward, or None."""
        known = self.imagined or "friction" in self.plant
        return FEED_FORWARD if known else None


SEEDS = (0, 1, 2)
ROWS = [
    Row("exact"),
    Row("masses +20 %", {"inertias": {"mass_factor": 1.2}}),
    Row("masses -20 %", {"inertias": {"mass_factor": 0.8}}),
    Row("random ±20 %", RANDOM, seeds=SEEDS),
    Row("friction", FRICTION),
    Row("random ±20 %, friction", {**RANDOM, **FRICTION}, seeds=SEEDS),
    Row("payload of 2 kg", {"payload": {"mass": 2.0}}),
    Row("another source's inertias", robot="iiwa14"),
    Row("velocity noise 0.02 rad/s", NOISE),
    Row("random, friction, noise", {**RANDOM, **FRICTION, **NOISE}),
    Row("random, friction, 19-bit encoder", {**RANDOM, **FRICTION, **ENCODER}),
    Row("one period late", {"drives": {"delay": 1}}),
    Row("two periods late", {"drives": {"delay": 2}}),
    Row("500 Hz", frequency=500),
    Row("200 Hz", frequency=200),
    Row("100 Hz", frequency=100),
    Row("random, friction, 200 Hz", {**RANDOM, **FRICTION}, 200),
    Row("random, friction, 100 Hz", {**RANDOM, **FRICTION}, 100),
    Row("random, friction, noise, one late, 500 Hz",
        {**RANDOM, **FRICTION, **NOISE, "drives": {"delay": 1}}, 500),
    Row("exact, friction imagined", imagined=True),
]  # fmt: skip

Compensation = dict[str, Any]
COLUMNS: dict[str, Callable[[Row], Compensation | None]] = {
    "law alone": lambda row: {},
    "integral": lambda row: {"integral_action": {"rate": 5.0}},
    "observer": lambda row: {"momentum_observer": {"bandwidth": 50.0}},
    "feed-forward": lambda row: _when(row.friction, "friction_feed_forward"),
    "feed-forward + observer": lambda row: _when(
        row.friction,
        "friction_feed_forward",
        momentum_observer={"bandwidth": 50.0},
    ),
    "filter": lambda row: _when(
        {"cutoff": 50.0} if row.noisy or row == ROWS[0] else None, "velocity_filter"
    ),
    "predictor": lambda row: _when(
        {"effort_delay": row.delay} if row.delay else None, "predictor"
    ),
    "all": lambda row: {
        "velocity_filter": {"cutoff": 50.0},
        "momentum_observer": {"bandwidth": 20.0},
        "integral_action": {"rate": 5.0},
        "start_up_ramp": {"duration": 1.0},
        **(_when(row.friction, "friction_feed_forward") or {}),
        **(
            _when({"effort_delay": row.delay} if row.delay else None, "predictor") or {}
        ),
    },
}
"""Compensation of each column; None if the compensator does not apply to a row."""


def _when(settings: Any, name: str, **others: Any) -> Compensation | None:
    return None if settings is None else {name: settings, **others}


@dataclass(frozen=True)
class Job:
    """One cell: a robot, an engine, a row, a column and a seed."""

    robot: str
    engine: str
    row: int
    column: str
    seed: int


def jobs(robots: list[str], engines: list[str]) -> list[Job]:
    """Return all cells whose compensators apply."""
    return [
        Job(robot, engine, k, column, seed)
        for robot in robots
        for k, row in enumerate(ROWS)
        if row.robot in (None, robot)
        for engine in engines
        for column, compensation in COLUMNS.items()
        if compensation(row) is not None
        for seed in row.seeds
    ]


def experiment(job: Job, folder: Path) -> dict[str, Any]:
    """Return the configuration of a cell."""
    row, compensation = ROWS[job.row], COLUMNS[job.column](ROWS[job.row])
    plant = {"type": job.engine, "seed": job.seed, **row.plant}
    if row.robot == "iiwa14":
        folder.mkdir(exist_ok=True)
        plant["robot"] = {"name": str(write_urdf(folder))}
    config = configuration(job.robot, HANDS[job.robot], plant)
    config["simulation"]["control_period"] = 1.0 / row.frequency
    config["simulation"]["log_period"] = 1.0 / row.frequency
    config["compensation"] = {"momentum_observer": None, **(compensation or {})}
    config["limits"] = {"effort_rate": "none"}
    return config


def configuration(robot: str, hand: str, plant: dict[str, Any]) -> dict[str, Any]:
    """Return the configuration of the motion on a plant."""
    if "payload" in plant:
        plant = {**plant, "payload": {**plant["payload"], "frame": hand}}
    circle = {
        "type": "circle",
        "origin": "start",
        "center": [0.0, 0.0, 0.0],
        "radius": 0.1,
        "angular_rate": 2.0,
        "normal": [0.0, 0.0, 1.0],
    }
    task = {
        "type": "frame_position",
        "frame": hand,
        "trajectory": circle,
        "gains": {"natural_frequency": 20.0},
        "blend": 1.0,
    }
    return {
        "robot": {"name": robot},
        "tasks": {"hand": task},
        "null_space": {
            "gain": 10.0,
            "fields": [{"type": "joint_centering", "weight": 2.0}],
        },
        "plant": plant,
        "compensation": {"momentum_observer": None},
        "simulation": {
            "duration": 4.0,
            "control_period": 0.001,
            "log_period": 0.001,
            "integrator": {"type": "rk4", "step": 0.001},
        },
    }


def measured(config: dict[str, Any]) -> tuple[float, float, float]:
    """Run a configuration; return three root mean squares, inf if it diverges.

    They are the hand's error [mm], ‖e_N‖ [rad/s] and the efforts' rates [N·m/s], from
    1.5 s to the end. There is no log: it would take most of the time.
    """
    made = load_experiment(config)
    settings, plant = made.scenario.simulation, made.plant
    period = settings.control_period
    assert period is not None
    if isinstance(plant, ContinuousPlant):
        plant = IntegratedPlant(plant, made.integrator)
    assert isinstance(plant, SampledPlant)
    command = CompensatedController(made.controller, made.compensation)
    q, v, last = made.q0, made.v0, np.zeros(made.robot.nv)
    plant.reset(0.0, q, v)
    sums, efforts, rows = np.zeros(2), 0.0, 0
    steps = round(settings.duration / period)
    settled = round(SETTLED / period)
    for k in range(steps):
        t = k * period
        tau = command.effort(t, *plant.measure(t, q, v), period)
        if k > settled:
            efforts += float(np.mean(((tau - last) / period) ** 2)) / (steps - settled)
        if k > settled and k % max(1, round(0.005 / period)) == 0:
            output = made.controller.compute(t, q, v)
            e, e_N = output.task.error, output.null_space_error
            sums += 1e6 * (e @ e), e_N @ e_N
            rows += 1
        last = tau.copy()
        q, v = plant.advance(t, t + period, tau)
        if not np.abs(v).max() < 100.0:
            return np.inf, np.inf, np.inf
    error, e_N = np.sqrt(sums / rows)
    return float(error), float(e_N), float(np.sqrt(efforts))


def run(job: Job) -> tuple[float, float, float]:
    """Run a cell; return the same as `measured`."""
    with tempfile.TemporaryDirectory() as folder:
        return measured(experiment(job, Path(folder)))


def run_all() -> None:
    """Run the cells that the CSV does not contain, and append them."""
    done = set(read()) if CSV.is_file() else set()
    todo = [job for job in jobs([*HANDS], [*ENGINES]) if _key(job) not in done]
    todo.sort(key=_sort_key)
    if not CSV.is_file():
        names = ["robot", "engine", "plant", "compensation", "seed", *MEASURES]
        CSV.write_text(",".join(names) + "\n", encoding="utf-8")
    with ProcessPoolExecutor(PROCESSES) as pool:
        results = pool.map(run, todo)
        for job, result in zip(todo, track(results, total=len(todo)), strict=True):
            with CSV.open("a", encoding="utf-8", newline="") as file:
                numbers = (f"{x:.4g}" for x in result)
                csv.writer(file, lineterminator="\n").writerow([*_key(job), *numbers])


def _key(job: Job) -> tuple[str, str, str, str, str]:
    """Return the key of a cell in the CSV."""
    engine, plant = ENGINES[job.engine], ROWS[job.row].name
    return job.robot, engine, plant, job.column, str(job.seed)


def _sort_key(job: Job) -> tuple[int, int]:
    """Return the sort key: first seeds and the most important columns come first."""
    important = ("law alone", "feed-forward + observer", "all")
    return (
        2 * (job.seed != ROWS[job.row].seeds[0]) + (job.column not in important),
        (job.robot != "panda") + (job.engine != "rigid_body"),
    )


def read() -> dict[tuple[str, ...], dict[str, float]]:
    """Read the CSV; the keys are robot, engine, plant, compensation and seed."""
    names = ("robot", "engine", "plant", "compensation", "seed")
    with CSV.open(encoding="utf-8") as file:
        return {
            tuple(row[name] for name in names): {
                name: float(row[name]) for name in MEASURES
            }
            for row in csv.DictReader(file)
        }


def means() -> dict[tuple[str, ...], dict[str, float]]:
    """Return root mean squares over the seeds, by robot, engine, plant, compensation.

    Only seeds that all cells of an arm's row have, so that columns are comparable.
    """
    found = read()
    seeds: dict[tuple[str, ...], set[str]] = {}
    for *cell, seed in found:
        seeds.setdefault(tuple(cell), set()).add(seed)
    shared: dict[tuple[str, str], set[str]] = {}
    for (robot, _, plant, _), own in seeds.items():
        shared[robot, plant] = shared.get((robot, plant), own) & own
    cells: dict[tuple[str, ...], list[dict[str, float]]] = {}
    for key, values in found.items():
        if key[4] in shared[key[0], key[2]]:
            cells.setdefault(key[:4], []).append(values)
    return {
        key: {
            name: float(np.sqrt(np.mean([each[name] ** 2 for each in values])))
            for name in MEASURES
        }
        for key, values in cells.items()
    }


def tables() -> str:
    """Return the tables in Markdown, one per arm and measure."""
    cells, lines = means(), []
    for robot in HANDS:
        for measure, heading in MEASURES.items():
            lines += ["", f"### {robot}: {heading}", ""]
            lines += [f"| plant | {' | '.join(COLUMNS)} |"]
            lines += [f"|---|{'--:|' * len(COLUMNS)}"]
            for row in ROWS:
                if (robot, "Pinocchio", row.name, "law alone") not in cells:
                    continue
                shown = []
                for column, compensation in COLUMNS.items():
                    if compensation(row) is None:
                        shown.append("·")
                        continue
                    pair = [
                        cells.get((robot, engine, row.name, column), {}).get(measure)
                        for engine in ENGINES.values()
                    ]
                    shown.append(_format(pair))
                lines.append(f"| {row.name} | {' | '.join(shown)} |")
    return "\n".join(lines[1:]) + "\n"


def _format(pair: list[float | None]) -> str:
    """Return both engines' numbers, or one number if they agree to 5 %."""
    given = [each for each in pair if each is not None]
    if not given:
        return "–"
    if len(given) == 1:
        return f"{given[0]:.2g} / –" if pair[1] is None else f"– / {given[0]:.2g}"
    low, high = sorted(given)
    if low == high or high - low <= 0.05 * high:
        return f"{given[0]:.2g}"
    return f"{given[0]:.2g} / {given[1]:.2g}"


def main() -> None:
    """Run the cells, and write the tables of the page."""
    if "--fresh" in sys.argv:
        CSV.unlink(missing_ok=True)
    if "--tables" not in sys.argv:
        run_all()
    replace_section(RESULTS / "robustness.md", "tables", tables())
    shown = {
        robot: [row.name for row in ROWS if row.robot in (None, robot)]
        for robot in HANDS
    }
    draw_figure(means(), shown, [*COLUMNS])
    print(f"Wrote {CSV} and results/robustness.md")


if __name__ == "__main__":
    main()
