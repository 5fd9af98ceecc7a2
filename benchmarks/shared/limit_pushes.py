"""Pushes on robots that stand: a part of `limit_rollouts.py`."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation import Status
from shared.rollouts import STEP, run_parallel


class Legs(NamedTuple):
    """A legged robot and how it is pushed.

    Attributes:
        name: The bundled configuration.
        overrides: Changes of the configuration.
        frame: The frame that is pushed.
        body: The task whose last three rows are the orientation of the trunk.
        force_ratio: Force over weight.
        ground: Friction coefficient of the plant's ground.
    """

    name: str
    overrides: tuple[str, ...]
    frame: str
    body: str
    force_ratio: float
    ground: float


STANDING = ("tasks.center_of_mass.trajectory={type: hold}",)
LEGS = (
    Legs("talos_circle", STANDING, "base_link", "trunk", 0.2, 0.7),
    Legs("solo12_trunk", (), "base_link", "trunk", 0.2, 0.8),
)
START, PUSHED, DURATION = 1.0, 0.1, 4.0  # [s]


class Pushed(NamedTuple):
    """Measurements of a pushed run.

    Attributes:
        fell: Whether the trunk sank by 10 cm, tilted by 30°, or the run ended early.
        sunk: How far the root sank below its start [m].
        tilted: Largest error of the trunk's orientation [rad].
        moved: Largest error of the first task [m].
        planned: Largest used fraction of a friction cone, of the controller's forces.
        simulated: The same, of the engine's forces.
        pulls: Number of steps at which a force of the controller pulls.
        relaxed: Number of steps at which limits contradicted each other.
        rows: Number of steps.
        after: Error of the first task in the last 0.2 s [m].
    """

    fell: bool
    sunk: float
    tilted: float
    moved: float
    planned: float
    simulated: float
    pulls: int
    relaxed: int
    rows: int
    after: float


@cache
def weight(name: str) -> float:
    """Return a configuration's robot's weight [N]."""
    model = hsp.load_experiment(f"whole_body/{name}").robot.model
    return 9.81 * float(sum(inertia.mass for inertia in model.inertias))


def push(legs: Legs, seed: int) -> Pushed:
    """Run with a push in a random horizontal direction, and measure it."""
    heading = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    force = legs.force_ratio * weight(legs.name)
    setting: dict[str, Any] = {
        "frame": legs.frame,
        "force": [force * float(np.cos(heading)), force * float(np.sin(heading)), 0.0],
        "start": START,
        "duration": PUSHED,
    }
    rollout = hsp.load_experiment(
        f"whole_body/{legs.name}",
        *legs.overrides,
        f"plant.pushes=[{setting}]",
        f"simulation.duration={DURATION}",
        f"simulation.log_period={STEP}",
    ).run()
    columns = rollout.columns
    names = [c.split(".")[1] for c in columns if c.endswith("friction_used")]
    forces = [
        c for c in columns if c.startswith("plant.contact.") and c[-6:] == ".force"
    ]
    first = next(iter(rollout.meta["tasks"]))
    moved = np.linalg.norm(rollout[f"task.{first}.error"][:, :3], axis=1)
    tilted = np.linalg.norm(rollout[f"task.{legs.body}.error"][:, -3:], axis=1).max()
    height = rollout["q"][:, 2]
    sunk = float(height[0] - height.min())
    completed = rollout.meta["status"] == "completed"
    return Pushed(
        fell=not completed or sunk > 0.1 or tilted > np.pi / 6.0,
        sunk=sunk,
        tilted=float(tilted),
        moved=float(moved.max()),
        planned=max(
            float(np.nanmax(rollout[f"contact.{n}.friction_used"])) for n in names
        ),
        simulated=max(cone_used(rollout[c], legs.ground) for c in forces),
        pulls=sum(
            int((rollout[f"contact.{n}.force"][:, 2] < 0.0).sum()) for n in names
        ),
        relaxed=int((rollout["status"] == Status.RELAXED).sum()),
        rows=len(rollout),
        after=float(moved[-200:].max()),
    )


def cone_used(force: Array, friction: float) -> float:
    """Return the largest used fraction of a cone while in contact (> 1 N) [-]."""
    contact = force[:, 2] > 1.0
    slope = np.linalg.norm(force[contact, :2], axis=1) / force[contact, 2]
    return float(slope.max(initial=0.0)) / friction


def push_of(item: tuple[Legs, int]) -> Pushed:
    """Call `push` with one argument, as a process pool does."""
    return push(*item)


def table(count: int) -> str:
    """Push each robot so many times, and return the table."""
    return leg_table(
        {
            legs: run_parallel(push_of, ((legs, k) for k in range(count)), legs.name)
            for legs in LEGS
        }
    )


def leg_table(runs: dict[Legs, list[Pushed]]) -> str:
    """Return the table of all pushes."""
    lines = (
        "| robot | push | falls | worst error of the first task [mm], and at the end | "
        "worst tilt [°] | friction used: controller, engine | pulling forces | relaxed "
        "steps |\n|---|---|--:|--:|--:|--:|--:|--:|\n"
    )
    for legs, pushed in runs.items():
        force = legs.force_ratio * weight(legs.name)
        rows = sum(each.rows for each in pushed)
        lines += (
            f"| `{legs.name}` | {force:.0f} N for {PUSHED:g} s | "
            f"{sum(each.fell for each in pushed)} of {len(pushed)} | "
            f"{1e3 * max(each.moved for each in pushed):.2g}, "
            f"{1e3 * max(each.after for each in pushed):.2g} | "
            f"{np.rad2deg(max(each.tilted for each in pushed)):.2g} | "
            f"{100 * max(each.planned for each in pushed):.1f} %, "
            f"{100 * max(each.simulated for each in pushed):.1f} % | "
            f"{sum(each.pulls for each in pushed)} | "
            f"{sum(each.relaxed for each in pushed)} of {rows} |\n"
        )
    return lines
