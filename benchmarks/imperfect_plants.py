"""Measure the effect of each imperfection of a plant: two arms, two engines.

    .venv/bin/python benchmarks/imperfect_plants.py

The controller without compensation, with the nominal model, at 1 kHz. Writes
benchmarks/results/plants.md.
"""

from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from hsp_control import Rollout, load_experiment

PAGE = Path(__file__).resolve().parent / "results" / "plants.md"
SETTLED = 1.5  # the transient of the start is over [s]

INTRODUCTION = """\
# The effect of each imperfection

Written by `.venv/bin/python benchmarks/imperfect_plants.py`; do not edit.

The hand follows a circle of 10 cm radius at 2 rad/s, with ω₀ = 20 1/s and
K_N = 10 1/s, at 1 kHz, from 1.5 s to 4 s. Root mean squares of the hand's error, of
‖e_N‖ and of the commanded effort's rate. The two engines agree on the effect of an
imperfection; on the exact model the difference is that of their integrators.
"""

CASES: dict[str, dict[str, Any]] = {
    "none": {},
    "masses +20 %": {"inertias": {"mass_factor": 1.2}},
    "masses -20 %": {"inertias": {"mass_factor": 0.8}},
    "random ±20 %, centres of mass 1 cm": {
        "inertias": {"random_mass": 0.2, "random_inertia": 0.2, "random_com": 0.01}
    },
    "payload of 2 kg": {"payload": {"mass": 2.0}},
    "motor inertia 0.1 kg·m²": {"motor_inertia": 0.1},
    "friction 0.8 to 0.2 N·m, 0.2 N·m·s/rad": {
        "friction": {"coulomb": [0.8, 0.8, 0.6, 0.6, 0.3, 0.3, 0.2], "viscous": 0.2}
    },
    "velocity noise 0.02 rad/s": {"sensors": {"velocity_noise": 0.02}},
    "19-bit encoder, differenced": {
        "sensors": {
            "encoder_resolution": 2.0 * np.pi / 2**19,
            "differenced_velocity": True,
        }
    },
    "effort one period late": {"drives": {"delay": 1}},
    "effort two periods late": {"drives": {"delay": 2}},
    "jitter up to half a period": {"drives": {"jitter": 0.0005}},
    "one effort in ten lost": {"drives": {"dropped": 0.1}},
    "effort noise 0.5 N·m": {"drives": {"noise": 0.5}},
}


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


def measured(run: Rollout) -> str:
    """Return the table cells of a run."""
    settled = run.t > SETTLED
    error = np.linalg.norm(run["task.hand.error"][settled], axis=1)
    rate = np.diff(run.tau[settled], axis=0) / 0.001
    rms = [
        float(np.sqrt(np.mean(x**2)))
        for x in (1e3 * error, run["null_space_norm"][settled], rate)
    ]
    return f"{rms[0]:.2g} | {rms[1]:.2g} | {rms[2]:.2g}"


def table(robot: str, hand: str) -> list[str]:
    """Return the lines of a robot's table."""
    lines = [
        "",
        f"## {robot}",
        "",
        "| imperfection | Pinocchio: error [mm] | ‖e_N‖ [rad/s] | rate [N·m/s] "
        "| MuJoCo: error [mm] | ‖e_N‖ [rad/s] | rate [N·m/s] |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for name, plant in track(CASES.items(), robot, transient=True):
        cells = [
            measured(
                load_experiment(
                    configuration(robot, hand, {"type": kind, **plant})
                ).run()
            )
            for kind in ("rigid_body", "mujoco")
        ]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Write the page."""
    lines = [*table("panda", "panda_tcp"), *table("iiwa14", "iiwa_link_ee")]
    PAGE.write_text(INTRODUCTION + "\n".join(lines) + "\n", encoding="utf-8")
    print(f"Wrote {PAGE}")


if __name__ == "__main__":
    main()
