"""Talos with a weak arm: what gives way, by how much, with and without each bound.

    .venv/bin/python benchmarks/weak_arm.py

configs/whole_body/talos_weak_arm.yaml on MuJoCo and on ideal contacts, without its two
bounds, and with one of them. Writes a table into docs/whole_body.md and draws
docs/figures/weak_arm.png.
"""

from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
from marked import DOCS, replace_part
from matplotlib.figure import Figure

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation import LIMITED, RELAXED
from hsp_control.visualization.palette import INK, SERIES
from hsp_control.visualization.plots import new_figure, styled

NAME = "whole_body/talos_weak_arm"
IDEAL = (
    "plant={type: rigid_contacts, contacts: {left_sole_link: {}, right_sole_link: {}}}"
)
NO_POSTURE, NO_SPEED = "limits.static_effort=null", "limits.null_space_speed=null"
RUNS = {
    "both bounds, MuJoCo": (),
    "both bounds, ideal contacts": (IDEAL,),
    "`static_effort` alone, MuJoCo": (NO_SPEED,),
    "`null_space_speed` alone, MuJoCo": (NO_POSTURE,),
    "neither, MuJoCo": (NO_POSTURE, NO_SPEED),
}
BOTH, NEITHER = "both bounds, MuJoCo", "neither, MuJoCo"


class Seen(NamedTuple):
    """What a run showed.

    Attributes:
        t: Time [s].
        part: Effort of every motor of the arm, of its limit, shape (k, 7).
        worst: Greatest effort of any motor, of its limit.
        hand: Distance of the hand from its path [mm].
        mass: Distance of the centre of mass from its path [mm].
        trunk: Tilt of the trunk [mrad].
        fastest: Greatest speed of a joint [rad/s].
        status: What of the law was delivered.
        ended: How it ended.
    """

    t: Array
    part: Array
    worst: float
    hand: Array
    mass: Array
    trunk: Array
    fastest: Array
    status: Array
    ended: str


def run(*overrides: str) -> Seen:
    """Return what a run of the configuration shows."""
    experiment = hsp.load_experiment(NAME, *overrides)
    rollout = experiment.run()
    limits = experiment.controller.limits
    assert limits is not None
    names = experiment.robot.dof_names
    arm = [i for i, name in enumerate(names) if name.startswith("arm_right")]
    off = {
        task: 1e3 * np.linalg.norm(rollout[f"task.{task}.error"], axis=1)
        for task in rollout.meta["tasks"]
    }
    used = np.abs(rollout["tau"]) / limits.effort
    return Seen(
        t=rollout.t,
        part=used[:, arm],
        worst=float(used.max()),
        hand=off["hand"],
        mass=off["center_of_mass"],
        trunk=off["trunk"],
        fastest=np.abs(rollout["v"][:, 6:]).max(axis=1),
        status=rollout["status"],
        ended=str(rollout.meta["status"]),
    )


def run_all(overrides: tuple[str, ...]) -> Seen:
    """Return what a run shows: `run` for a pool, which maps one argument."""
    return run(*overrides)


def table(found: dict[str, Seen]) -> str:
    """Return a line a run."""
    lines = (
        "| | greatest effort, of its limit | centre of mass, rms / max [mm] | trunk, "
        "max [mrad] | hand, rms / max [mm] | fastest joint [rad/s] | limited, relaxed "
        "steps | |\n|---|--:|--:|--:|--:|--:|--:|---|\n"
    )
    for label, seen in found.items():
        limited, relaxed = (100 * (seen.status == k).mean() for k in (LIMITED, RELAXED))
        lines += (
            f"| {label} | {100 * seen.worst:.1f} % | "
            f"{np.sqrt((seen.mass**2).mean()):.2g} / {seen.mass.max():.2g} | "
            f"{seen.trunk.max():.2g} | "
            f"{np.sqrt((seen.hand**2).mean()):.2g} / {seen.hand.max():.3g} | "
            f"{seen.fastest.max():.2g} | {limited:.0f} %, {relaxed:.1f} % | "
            f"{seen.ended} |\n"
        )
    return lines


def figure(found: dict[str, Seen]) -> Figure:
    """Return efforts of the arm, hand, centre of mass, speeds and status."""
    drawn = new_figure(9.0, 9.0)
    efforts, hand, mass, speed, status = drawn.subplots(5, 1, sharex=True)
    ours = found[BOTH]
    for color, joint in zip(SERIES, (1, 3, 4), strict=False):
        efforts.plot(
            ours.t,
            100 * ours.part[:, joint],
            color=color,
            lw=1.2,
            label=f"arm_right_{joint + 1}",
        )
    efforts.axhline(100, color=INK, lw=1.0, ls="--")
    efforts.set_ylabel("effort\n[% of its limit]")
    efforts.set_ylim(0.0, 108.0)
    efforts.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, ncols=3)
    for color, label in zip(SERIES, (BOTH, NEITHER), strict=False):
        seen = found[label]
        style = {"color": color, "lw": 1.2, "label": label}
        hand.semilogy(seen.t, seen.hand + 1e-3, **style)
        mass.semilogy(seen.t, seen.mass + 1e-3, **style)
        speed.plot(seen.t, seen.fastest, **style)
    hand.set_ylabel("hand off\nits path [mm]")
    mass.set_ylabel("centre of mass\noff its path [mm]")
    speed.set_ylabel("fastest joint\n[rad/s]")
    hand.legend(loc="lower right", fontsize=8, ncols=2)
    status.step(ours.t, ours.status, color=SERIES[0], lw=0.8)
    status.set_yticks([0, 1, 2, 3], ["law", "other forces", "limited", "relaxed"])
    status.set_ylim(-0.4, 3.4)
    status.set_xlabel("t [s]")
    return drawn


def main() -> None:
    """Run, write the table, draw."""
    with ProcessPoolExecutor(2) as pool:
        found = dict(zip(RUNS, pool.map(run_all, RUNS.values()), strict=True))
    text = table(found)
    print(text)
    replace_part(DOCS / "whole_body.md", "weak_arm", "\n" + text + "\n")
    with styled():
        figure(found).savefig(DOCS / "figures" / "weak_arm.png", dpi=110)


if __name__ == "__main__":
    main()
