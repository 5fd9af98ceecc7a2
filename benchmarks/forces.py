"""Commanded contact forces on MuJoCo: wiping, pushing, carrying, and why hands chatter.

    .venv/bin/python benchmarks/forces.py

Runs the configurations forces/* with other forces, speeds, masses and friction
coefficients, and a ball without any controller. Writes the tables of
benchmarks/results/forces.md.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation import Status

NO_FEEDBACK = "compensation.force_feedback=null"
ESTIMATED = (
    "compensation.force_feedback.force=estimated",
    "compensation.momentum_observer={bandwidth: 50, cancel: false}",
)
HEAVIER = "plant.inertias={mass_factor: 1.1}"
OWN_SURFACE = (
    "plant.solids.table.slip_damping=null",
    "plant.solids.table.impedance=null",
)


def force(contact: str, newtons: float) -> str:
    """Return the override of the force that a configuration ramps to."""
    return (
        f"changes=[{{type: force, contact: {contact}, at: 0, ramp: 0.5, "
        f"force: {{value: {newtons}}}}}]"
    )


def speed(metres_per_second: float) -> str:
    """Return the override of the speed on the circle."""
    return f"tasks.path.trajectory.angular_rate={metres_per_second / 0.08}"


WIPING = {
    "20 N, 0.1 m/s": (),
    "without feedback": (NO_FEEDBACK,),
    "with the observer's estimate": ESTIMATED,
    "at 500 Hz": ("simulation.control_period=0.002",),
    "0.03 m/s": (speed(0.03),),
    "0.2 m/s": (speed(0.2),),
    "10 N": (force("wiper", 10.0),),
    "50 N": (force("wiper", 50.0),),
    "all masses +10 %": (HEAVIER,),
    "all masses +10 %, without feedback": (HEAVIER, NO_FEEDBACK),
    "all masses +10 %, with the estimate": (HEAVIER, *ESTIMATED),
    "all masses +10 %, integral action on the path": (
        HEAVIER,
        "compensation.integral_action={rate: 5, tasks: [path]}",
    ),
    "controller believes μ = 0.2": ("contacts.wiper.friction=0.2",),
    "controller believes μ = 0.4": ("contacts.wiper.friction=0.4",),
    "controller expects no friction": ("contacts.wiper.friction=0.001",),
    "MuJoCo's own surface": OWN_SURFACE,
    "MuJoCo's own surface, steps of 0.2 ms": (*OWN_SURFACE, "plant.timestep=0.0002"),
    "MuJoCo's own surface, μ = 0.01": (
        *OWN_SURFACE,
        "plant.solids.table.friction=0.01",
        "contacts.wiper.friction=0.01",
    ),
}
WALL = {
    "`talos_wall`, 40 ± 20 N": ("talos_wall", ()),
    "without feedback": ("talos_wall", (NO_FEEDBACK,)),
    "all masses +10 %": ("talos_wall", (HEAVIER,)),
    "all masses +10 %, without feedback": ("talos_wall", (HEAVIER, NO_FEEDBACK)),
    "`talos_lean`, 120 N, all masses +10 %": ("talos_lean", ()),
    "the same without feedback": ("talos_lean", (NO_FEEDBACK,)),
    "the same with the right masses": ("talos_lean", ("plant.inertias={}",)),
}
CARRYING = {
    "as configured": (),
    "without feedback": (NO_FEEDBACK,),
    "a box of 4 kg, commanded as 5": ("plant.solids.box.mass=4",),
    "a box of 6 kg, commanded as 5": ("plant.solids.box.mass=6",),
    "the arms' masses +10 %": (HEAVIER,),
    "μ = 0.6": ("plant.solids.box.friction=0.6",),
    "μ = 0.35, too little for 24.5 of 60 N": ("plant.solids.box.friction=0.35",),
}


class Pressing(NamedTuple):
    """The figures of a run once the command is reached.

    Attributes:
        error: Difference of the normal force from the command, shape (N,) [N].
        lost: The share of the rows in which nothing is touched.
        away: Distance of the first task from its reference, shape (N,) [mm].
        null_space: ‖e_N‖, shape (N,) [rad/s].
        status: Shape (N,).
        gave_way: The largest difference of the planned from the commanded force [N].
        ended: How the run ended.
    """

    error: Array
    lost: float
    away: Array
    null_space: Array
    status: Array
    gave_way: float
    ended: str


def run(name: str, overrides: tuple[str, ...], task: str, begin: float) -> Pressing:
    """Run a configuration, and return its figures from a time on [s]."""
    experiment = hsp.load_experiment(f"forces/{name}", *overrides)
    contact = next(c for c in experiment.controller.contacts if c.force is not None)
    log = experiment.run()
    rows = log.t > begin
    normal = contact.axes[:, 2]
    felt = log[f"plant.contact.{contact.frame}.force"][rows] @ normal
    planned = log[f"contact.{contact.name}.force"][rows] @ normal
    commanded = log[f"contact.{contact.name}.commanded"][rows] @ normal
    wanted = commanded
    if f"contact.{contact.name}.integral" in log.columns:
        wanted = commanded - log[f"contact.{contact.name}.integral"][rows]
    return Pressing(
        felt - wanted,
        float((felt <= 0.0).mean()),
        1e3 * np.linalg.norm(log[f"task.{task}.error"][rows], axis=1),
        log["null_space_norm"][rows],
        log["status"][rows],
        float(np.abs(planned - commanded).max()),
        log.meta["status"],
    )


def row(label: str, found: Pressing) -> str:
    """Return a row of the tables."""

    def rms(x: Array) -> float:
        return float(np.sqrt((x**2).mean()))

    limited = 100 * (found.status >= Status.LIMITED).mean()
    return (
        f"| {label} | {rms(found.error):.2g} / {np.abs(found.error).max():.2g} | "
        f"{100 * found.lost:.0f} % | {rms(found.away):.2g} / {found.away.max():.2g} | "
        f"{rms(found.null_space):.2g} | {found.gave_way:.2g} | {limited:.0f} % | "
        f"{found.ended} |\n"
    )


def head(task: str) -> str:
    """Return the head of a table."""
    return (
        "| case | force, rms / max error [N] | contact lost | "
        f"{task}, rms / max [mm] | ‖e_N‖, rms [rad/s] | "
        "planned off the command, max [N] | limited steps | outcome |\n"
        "|---|--:|--:|--:|--:|--:|--:|---|\n"
    )


def carried(overrides: tuple[str, ...]) -> str:
    """Return the cells of a run with the box, while it is in the air."""
    log = hsp.load_experiment("forces/pandas_box", *overrides).run()
    rows = (log.t > 1.2) & (log.t < 5.4)
    sides = {"left": 1.0, "right": -1.0}
    error = np.concatenate(
        [
            sign * log[f"plant.contact.{side}_panda_tcp.force"][rows, 1] - 60.0
            for side, sign in sides.items()
        ]
    )
    hands = 0.5 * sum(log[f"task.{side}.actual"] for side in sides)
    box = log["plant.solid.box.position"]
    slip = (box[:, [0, 2]] - hands)[rows]
    slip = 1e3 * np.linalg.norm(slip - slip[0], axis=1)
    away = 1e3 * np.linalg.norm(log["task.left.error"][rows], axis=1)
    return (
        f"{np.sqrt((error**2).mean()):.2g} / {np.abs(error).max():.2g} | "
        f"{slip.max():.2g} | {1e3 * np.abs(box[rows, 1]).max():.2g} | "
        f"{np.sqrt((away**2).mean()):.2g} / {away.max():.2g} | "
        f"{log['null_space_norm'][rows].max():.2g} | {log.meta['status']}"
    )


def pulled_ball(impedance: float, slip_damping: float) -> float:
    """Return the share of time in which a ball that is pulled does not touch.

    No controller: 3 kg, pressed with 20 N and pulled at 0.1 m/s on a plane of μ = 0.3.
    """
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="0.001" cone="elliptic" impratio="10" gravity="0 0 0"/>
    <worldbody><geom name="plane" type="plane" size="9 9 1"/>
    <body pos="0 0 0.0199"><joint type="slide" axis="1 0 0" damping="3000"/>
    <joint type="slide" axis="0 0 1"/>
    <geom name="ball" type="sphere" size="0.02" mass="3"/></body></worldbody>
    <contact><pair geom1="plane" geom2="ball" condim="3" friction="0.3 0.3 0 0 0"
    solimp="{impedance} {impedance} 0.001 0.5 2"
    solreffriction="-1 {-slip_damping * impedance}"/></contact></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[0] = 0.1
    data.qfrc_applied[:] = [3000 * 0.1, -20.0]
    touching = []
    for _ in range(2000):
        mujoco.mj_step(model, data)
        touching.append(data.ncon > 0)
    return 1.0 - float(np.mean(touching[500:]))


def balls() -> str:
    """Return the table of pulled balls, with the bound on b."""
    damping = (10.0, 40.0, 80.0, 160.0, 400.0)
    lines = "| d | bound on b [1/s] | " + " | ".join(f"b = {b:g}" for b in damping)
    lines += " |\n|--:|--:|" + "--:|" * len(damping) + "\n"
    for d in (0.3, 0.5, 0.7, 0.9):
        bound = (1.0 - d) / d * 20.0 / (3.0 * 0.3 * 0.1)
        lost = [f"{100 * pulled_ball(d, b):.0f} %" for b in damping]
        lines += f"| {d:g} | {bound:.0f} | {' | '.join(lost)} |\n"
    return lines


def main() -> None:
    """Run all, and write the tables."""
    page = RESULTS / "forces.md"
    text = balls()
    print(text)
    replace_section(page, "balls", "\n" + text + "\n")
    text = head("path")
    for label, overrides in WIPING.items():
        text += row(label, run("panda_wipe", overrides, "path", 1.5))
    print(text)
    replace_section(page, "wiping", "\n" + text + "\n")
    text = head("centre of mass")
    for label, (name, overrides) in WALL.items():
        text += row(label, run(name, overrides, "center_of_mass", 4.0))
    print(text)
    replace_section(page, "wall", "\n" + text + "\n")
    text = (
        "| case | internal force, rms / max error [N] | slip in the hands, max [mm] | "
        "box off the middle, max [mm] | hand, rms / max error [mm] | "
        "‖e_N‖, max [rad/s] | outcome |\n|---|--:|--:|--:|--:|--:|---|\n"
    )
    for label, overrides in CARRYING.items():
        text += f"| {label} | {carried(overrides)} |\n"
    print(text)
    replace_section(page, "box", "\n" + text + "\n")


if __name__ == "__main__":
    main()
