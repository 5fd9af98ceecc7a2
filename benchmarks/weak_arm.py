"""Talos with a weak arm: which tasks deviate, with and without `static_effort`.

    .venv/bin/python benchmarks/weak_arm.py

configs/whole_body/talos_weak_arm.yaml on MuJoCo and on ideal contacts, and without
`static_effort`. Writes a table into benchmarks/results/weak_arm.md and draws
docs/figures/weak_arm.png; ``--draw`` only draws.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
from marked_sections import FIGURES, RESULTS, replace_section
from matplotlib.figure import Figure

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.companions.plots import new_figure, styled
from hsp_control.companions.plots.palette import INK, SERIES
from hsp_control.control.actuation import Status

NAME = "whole_body/talos_weak_arm"
IDEAL = (
    "plant={type: rigid_contacts, contacts: {left_sole_link: {}, right_sole_link: {}}}"
)
WITH, WITHOUT = "`static_effort`, MuJoCo", "without it, MuJoCo"
RUNS = {
    WITH: (),
    "`static_effort`, ideal contacts": (IDEAL,),
    WITHOUT: ("limits.static_effort=null",),
}


class RunData(NamedTuple):
    """The data of a run with N rows.

    Attributes:
        t: Time, shape (N,) [s].
        effort_ratio: Effort over its limit, of each motor of the arm, shape (N, 7).
        worst: Largest effort over its limit, of any motor.
        hand: Distance of the hand from its path, shape (N,) [mm].
        mass: Distance of the centre of mass from its path, shape (N,) [mm].
        trunk: Tilt of the trunk, shape (N,) [mrad].
        fastest: Speed of the fastest joint, shape (N,) [rad/s].
        status: Status of the controller's steps, shape (N,).
        ended: How it ended.
    """

    t: Array
    effort_ratio: Array
    worst: float
    hand: Array
    mass: Array
    trunk: Array
    fastest: Array
    status: Array
    ended: str


def run(*overrides: str) -> RunData:
    """Run the configuration, and return the data."""
    experiment = hsp.load_experiment(NAME, *overrides)
    rollout = experiment.run()
    limits = experiment.controller.limits
    assert limits is not None
    names = experiment.robot.dof_names
    arm = [i for i, name in enumerate(names) if name.startswith("arm_right")]
    errors = {
        task: 1e3 * np.linalg.norm(rollout[f"task.{task}.error"], axis=1)
        for task in rollout.meta["tasks"]
    }
    used = np.abs(rollout["tau"]) / limits.effort
    return RunData(
        t=rollout.t,
        effort_ratio=used[:, arm],
        worst=float(used.max()),
        hand=errors["hand"],
        mass=errors["center_of_mass"],
        trunk=errors["trunk"],
        fastest=np.abs(rollout["v"][:, 6:]).max(axis=1),
        status=rollout["status"],
        ended=str(rollout.meta["status"]),
    )


def run_all(overrides: tuple[str, ...]) -> RunData:
    """Call `run` with one argument, as a process pool does."""
    return run(*overrides)


def table(found: dict[str, RunData]) -> str:
    """Return the table: one row for each run."""
    lines = (
        "| | largest effort / limit | centre of mass, rms / max [mm] | trunk, "
        "max [mrad] | hand, rms / max [mm] | fastest joint [rad/s] | limited, relaxed "
        "steps | |\n|---|--:|--:|--:|--:|--:|--:|---|\n"
    )
    for label, data in found.items():
        limited, relaxed = (
            100 * (data.status == k).mean() for k in (Status.LIMITED, Status.RELAXED)
        )
        lines += (
            f"| {label} | {100 * data.worst:.1f} % | "
            f"{np.sqrt((data.mass**2).mean()):.2g} / {data.mass.max():.2g} | "
            f"{data.trunk.max():.2g} | "
            f"{np.sqrt((data.hand**2).mean()):.2g} / {data.hand.max():.3g} | "
            f"{data.fastest.max():.2g} | {limited:.0f} %, {relaxed:.1f} % | "
            f"{data.ended} |\n"
        )
    return lines


def figure(found: dict[str, RunData]) -> Figure:
    """Draw efforts of the arm, errors of hand and centre of mass, speeds, status."""
    drawn = new_figure(8.4, 7.6)
    efforts, hand, mass, speed, status = drawn.subplots(
        5, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 1.0, 0.18)
    )
    shown = found[WITH]
    dashes = ("-", "--", ":")
    for color, dash, joint in zip(SERIES, dashes, (1, 3, 4), strict=False):
        efforts.plot(
            shown.t,
            100 * shown.effort_ratio[:, joint],
            dash,
            color=color,
            lw=1.6,
            label=f"arm_right_{joint + 1}",
        )
    efforts.axhline(100, color=INK, lw=1.0, label="limit")
    efforts.set_ylabel("effort\n[% of limit]")
    efforts.set_ylim(0.0, 108.0)
    efforts.set_title("(a)  Efforts of the weak arm, with static_effort")
    hand.set_title("(b)  With static_effort, and without")
    named = {WITH: "with static_effort", WITHOUT: "without"}
    for color, dash, label in zip(SERIES, dashes, (WITH, WITHOUT), strict=False):
        data = found[label]
        style = {"color": color, "ls": dash, "lw": 1.6, "label": named[label]}
        hand.semilogy(data.t, data.hand + 1e-3, **style)
        mass.semilogy(data.t, data.mass + 1e-3, **style)
        speed.plot(data.t, data.fastest, **style)
    hand.set_ylabel("hand error\n[mm]")
    mass.set_ylabel("centre of mass\nerror [mm]")
    speed.set_ylabel("fastest joint\n[rad/s]")
    for axes in (hand, mass):
        axes.set_ylim(1e-2, None)
    for axes, columns in ((efforts, 4), (hand, 2)):
        above = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.02)}
        axes.legend(**above, ncols=columns)
    limited = shown.status >= Status.LIMITED
    status.fill_between(shown.t, 0.0, 1.0, where=limited, color=INK, alpha=0.45, lw=0)
    status.set(ylim=(0.0, 1.0), yticks=[], xlabel="time [s]")
    status.set_ylabel("limited", rotation=0, ha="right", va="center")
    status.grid(visible=False)
    drawn.align_ylabels([efforts, hand, mass, speed])
    return drawn


def main() -> None:
    """Run, write the table, and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="only draw the figure")
    drawn_only = parser.parse_args().draw
    chosen = [WITH, WITHOUT] if drawn_only else [*RUNS]
    with ProcessPoolExecutor(2) as pool:
        runs = pool.map(run_all, [RUNS[name] for name in chosen])
        found = dict(zip(chosen, runs, strict=True))
    if not drawn_only:
        text = table(found)
        print(text)
        replace_section(RESULTS / "weak_arm.md", "weak_arm", "\n" + text + "\n")
    with styled():
        figure(found).savefig(FIGURES / "weak_arm.png", dpi=120)


if __name__ == "__main__":
    main()
