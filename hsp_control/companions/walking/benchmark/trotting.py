r"""Eight quadrupeds trot and crawl on MuJoCo, with one set of parameters.

    python hsp_control/companions/walking/benchmark/trotting.py \
        [--estimated] [--case WORD] [robot ...]

Prints one line per robot and case: whether it stood at the end, how far it came,
its mean speed while it trotted at full speed, the share of steps that a limit changed,
and the CPU time of a period as a share of real time, median: of the whole loop, with
plan, estimator, controller, MuJoCo and log. ``--estimated``: with an estimated base,
from a noisy inertial measurement unit and noisy encoders.
"""

import argparse
from math import cos, radians, sin
from time import process_time
from typing import Any

import numpy as np

from hsp_control import Rollout, load_experiment
from hsp_control.common.errors import SimulationError

FEET = {
    "solo12": ("FL_FOOT FR_FOOT HL_FOOT HR_FOOT", 0.0165, "base_link"),
    "go2": ("FL_foot FR_foot RL_foot RR_foot", 0.022, "base"),
    "a1": ("FL_foot FR_foot RL_foot RR_foot", 0.02, "trunk"),
    "anymal": ("LF_FOOT RF_FOOT LH_FOOT RH_FOOT", 0.03, "base"),
    "b1": ("FL_foot FR_foot RL_foot RR_foot", 0.035, "trunk"),
    "hyq": ("lf_foot rf_foot lh_foot rh_foot", 0.021, "trunk"),
    "go1": ("FL_foot FR_foot RL_foot RR_foot", 0.02, "trunk"),
    "anymal_c": ("LF_FOOT RF_FOOT LH_FOOT RH_FOOT", 0.03, "base"),
}
"""The frames of the feet, their radius [m], and the frame of the unit."""
STEPS = {
    "shape": {"type": "box", "size": [0.4, 2.0, 0.04]},
    "position": [0.6, 0.0, 0.0],
    "copies": 2,
    "spacing": [0.8, 0.0, 0.0],
}
"""Plates of 2 cm, up and down again."""


def ramp(degrees: float, edge: float, friction: float = 0.7) -> dict[str, Any]:
    """Return a platform up to an edge [m], and a ramp beyond it that goes down."""
    slope = radians(degrees)
    box = {"shape": {"type": "box", "size": [6.0, 4.0, 0.2]}, "friction": friction}
    x = edge + 3.0 * cos(slope) - 0.1 * sin(slope)
    middle = [x, 0.0, -3.0 * sin(slope) - 0.1 * cos(slope)]
    return {
        "flat": box | {"position": [edge - 3.0, 0.0, -0.1]},
        "ramp": box | {"position": middle, "rotation": [0.0, slope, 0.0]},
    }


CASES: dict[str, dict[str, Any]] = {
    "0.3 m/s": {"plan": {"speed": 0.3}},
    "0.6 m/s": {"plan": {"speed": 0.6}},
    "0.2 m/s, 0.4 rad/s": {"plan": {"speed": 0.2, "turn": 0.4}},
    "0.2 m/s sideways": {"plan": {"sideways": 0.2}},
    "0.3 m/s, friction 0.35": {"plan": {"speed": 0.3}, "friction": 0.35},
    "0.3 m/s, steps of 2 cm": {"plan": {"speed": 0.3}, "solids": {"steps": STEPS}},
    "0.3 m/s, down 5°": {"plan": {"speed": 0.3}, "solids": ramp(5.0, 0.5)},
    "0.3 m/s, down 10°": {"plan": {"speed": 0.3}, "solids": ramp(10.0, 0.5)},
    "down 10°, friction 0.35": {
        "plan": {"speed": 0.3},
        "solids": ramp(10.0, 0.5, 0.35),
        "friction": 0.35,
    },
    "crawl, 0.06 m/s": {"plan": {"type": "crawl", "speed": 0.06}, "duration": 9.0},
}
"""The difference of each case. The friction is unknown to all plans."""
NOISE = {"position_noise": 1e-4, "velocity_noise": 0.01}
"""Noise of the encoders [rad, rad/s]; that of the unit is an ADIS16448's."""
UNTIL, DURATION = 4.0, 6.0
"""When they slow down, and when the run ends [s]."""


def configuration(
    robot: str, case: dict[str, Any], *, estimated: bool
) -> dict[str, Any]:
    """Return the configuration of a robot in a case."""
    feet, radius, trunk = FEET[robot]
    frames, shape = feet.split(), {"type": "sphere", "radius": radius}
    return {
        "robot": {"name": robot},
        "start": {"ground": 0},
        "contacts": {f: {"type": "ball", "frame": f, "radius": radius} for f in frames},
        "plan": {"type": "trot", "until": UNTIL, **case["plan"]},
        "null_space": {"fields": [{"type": "target_posture", "target": "start"}]},
        "simulation": {
            "duration": case.get("duration", DURATION),
            "control_period": 0.001,
        },
        "plant": {
            "type": "mujoco",
            "contacts": {f: {"shape": shape} for f in frames},
            "ground": {"friction": case.get("friction", 0.7)} | _below(case),
            "solids": case.get("solids", {}),
            "sensors": {"imu": trunk, **(NOISE if estimated else {})},
        },
        **({"estimators": {"base": True}} if estimated else {}),
    }


def _below(case: dict[str, Any]) -> dict[str, float]:
    """Return where the ground is, under a ramp."""
    return {"height": -3.0} if "ramp" in case.get("solids", {}) else {}


def said(robot: str, case: dict[str, Any], *, estimated: bool) -> str:
    """Return how a run went."""
    given = configuration(robot, case, estimated=estimated)
    clock: list[float] = []
    try:
        run = load_experiment(given).run(on_row=lambda _: clock.append(process_time()))
    except SimulationError as error:
        return str(error)
    if run.status != "completed":
        return str(run.meta["message"])
    fast = (run.t > 2.0) & (run.t < UNTIL)
    points = run.q[fast][::30, :2]  # of whole cycles, so that swaying averages out
    ways = np.diff(points if case["plan"].get("turn") else points[[0, -1]], axis=0)
    mean = np.hypot(*ways.T).sum() / (0.3 * (len(points) - 1))
    stands = run["plan.phase"][-1] == 0 and np.abs(run.v[-1]).max() < 0.3
    # The law of the log is that at the true state, away from estimated references.
    status = run["estimate.status" if estimated else "status"]
    period = np.median(np.diff(clock))
    limited, relaxed = ((status == s).mean() for s in (2, 3))
    return (
        f"{'stands' if stands else 'does not stand'} | {mean:.2f} m/s | "
        f"{run['plan.steps'][-1]:.0f} swings | limited {100 * limited:.0f} %, relaxed "
        f"{100 * relaxed:.1f} % | {period / (run.t[1] - run.t[0]):.2f} of real time"
        + (_errors(run) if estimated else "")
    )


def _errors(run: Rollout) -> str:
    away = [
        np.linalg.norm(run[f"estimate.{what}_error"], axis=1)
        for what in ("position", "velocity")
    ]
    return (
        f" | estimate {1e3 * away[0].max():.0f} mm, "
        f"{1e3 * np.sqrt((away[1] ** 2).mean()):.0f} mm/s rms"
    )


def main() -> None:
    """Run the cases of some robots, or of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("robots", nargs="*", help="names; all by default")
    parser.add_argument("--case", default="", help="part of the names of cases")
    parser.add_argument("--estimated", action="store_true", help="estimate the base")
    options = parser.parse_args()
    for robot in options.robots or FEET:
        for name, case in CASES.items():
            if options.case in name:
                result = said(robot, case, estimated=options.estimated)
                print(f"{robot:8} {name:24} | {result}", flush=True)


if __name__ == "__main__":
    main()
