r"""Talos walks on MuJoCo: far, fast, turning, pushed, with other masses and friction.

    python hsp_control/companions/walking/benchmark/walking.py \
        [--estimated] [--robot g1] [WORD ...]

Prints one line per case: whether it stood at the end, how far it came, and how
well the plan was followed; with words only those whose names contain one. Each case is
``walking/talos_walk`` (or ``g1_walk``) with other values; ``--estimated`` with an
estimated base, from a noisy inertial measurement unit and noisy encoders.
"""

import argparse
from collections.abc import Iterator
from math import cos, pi, sin
from typing import Any

import numpy as np
from trotting import ramp

from hsp_control import Rollout, load_experiment
from hsp_control.common.errors import SimulationError

WALKS = {"talos": "walking/talos_walk", "g1": "walking/g1_walk"}
PUSH = 200.0
"""Force of a push [N], for a tenth of a second."""
ESTIMATED = {
    "estimators": "{base: true}",
    "plant.sensors.position_noise": 1e-4,
    "plant.sensors.velocity_noise": 0.01,
}
"""An ADIS16448's noise, and that of encoders: 0.1 mrad, 0.01 rad/s."""
SLIPPERY = {"plant.ground.friction": 0.35}
"""A ground of which the plan does not know."""


def cases() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the values of each case."""
    yield "5 m at 0.35 m/s, stands 2 s", {"plan.steps": 20, "simulation.duration": 19}
    yield (
        "3 m at 0.55 m/s, stands 2 s",
        {"plan.speed": 0.55, "plan.steps": 8, "simulation.duration": 11.5},
    )
    turn = {"plan.speed": 0.2, "plan.turn": 0.3, "simulation.duration": 10}
    yield "turns left", turn | {"plan.steps": 9}
    yield "turns right", turn | {"plan.steps": 9, "plan.turn": -0.3}
    left = {"plan.speed": 0, "plan.sideways": 0.1}
    yield "sideways", left | {"plan.steps": 7, "simulation.duration": 9}
    yield "friction 0.35", {"plan.steps": 8, "simulation.duration": 10} | SLIPPERY
    down = {"plan.steps": 8, "simulation.duration": 10, "plant.ground.height": -3}
    for edge in (0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5):
        yield f"down 5° from {edge} m on", down | {"plant.solids": ramp(5.0, edge)}
        slope = down | {"plant.solids": ramp(5.0, edge, 0.35)}
        yield f"down 5° from {edge} m on, friction 0.35", slope
    for seed in range(3):
        yield (
            f"masses +5 % ± 10 %, seed {seed}",
            {
                "plan.steps": 8,
                "simulation.duration": 10,
            }
            | other_masses(seed),
        )
    for phase, start in (("swing", 2.7), ("on two feet", 3.15)):
        for k in range(8):
            force = [PUSH * cos(k * pi / 4), PUSH * sin(k * pi / 4), 0.0]
            push = f"frame: torso_2_link, force: {force}, start: {start}, duration: 0.1"
            values = {"plan.steps": 6, "simulation.duration": 12}
            values |= {"plant.pushes": f"[{{{push}}}]"}
            yield f"push {phase}, {45 * k}°", values
            other = values | other_masses(0) | SLIPPERY
            yield f"push {phase}, {45 * k}°, other masses, friction 0.35", other


def other_masses(seed: int) -> dict[str, Any]:
    """Return a robot of other masses, of which the controller does not know."""
    draw = "{mass_factor: 1.05, random_mass: 0.1}"
    return {"plant.inertias": draw, "plant.seed": seed}


def summary(run: Rollout) -> str:
    """Return how a walk went."""
    estimated = "estimate.velocity_error" in run.columns
    error = run["plan.dcm"] - run["plan.dcm_reference"]
    rms = 1e3 * np.sqrt((error**2).sum(axis=1).mean())
    came = np.hypot(*(run.q[-1, :2] - run.q[0, :2]))
    stands = run["plan.phase"][-1] == 0 and np.abs(run.v[-1, :6]).max() < 0.1
    ends = "stands" if stands and run.status == "completed" else run.meta["message"]
    # The law of the log is that at the true state, away from estimated references.
    status = run["estimate.status" if estimated else "status"]
    limited, relaxed = ((status == s).mean() for s in (2, 3))
    estimate = ""
    if estimated:
        away = [
            np.linalg.norm(run[f"estimate.{what}_error"], axis=1)
            for what in ("position", "velocity")
        ]
        estimate = (
            f" | estimate {1e3 * away[0].max():.0f} mm, "
            f"{1e3 * np.sqrt((away[1] ** 2).mean()):.0f} mm/s rms"
        )
    return (
        f"{ends or 'still walks'} | {came:.2f} m, {run['plan.steps'][-1]:.0f} steps | "
        f"DCM {rms:.1f} mm rms | limited {100 * limited:.0f} %, relaxed "
        f"{100 * relaxed:.1f} %{estimate}"
    )


def main() -> None:
    """Run the cases whose names contain one of the words, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("words", nargs="*", help="parts of names of cases")
    parser.add_argument("--estimated", action="store_true", help="estimate the base")
    parser.add_argument("--robot", choices=WALKS, default="talos", help="who walks")
    options = parser.parse_args()
    for name, values in cases():
        if options.words and not any(word in name for word in options.words):
            continue
        if options.estimated:
            values = values | ESTIMATED
        overrides = [f"{key}={value}" for key, value in values.items()]
        try:
            said = summary(load_experiment(WALKS[options.robot], *overrides).run())
        except SimulationError as error:
            said = str(error)
        print(f"{name:32} | {said}", flush=True)


if __name__ == "__main__":
    main()
