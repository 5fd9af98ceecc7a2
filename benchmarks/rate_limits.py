"""Check the stability limits of the sampled loop on the nonlinear robot.

    .venv/bin/python benchmarks/rate_limits.py

For each case the limit of one setting according to `check_rate` is found by bisection.
Then the nonlinear robot starts near its target with the setting 3 % below and 3 % above
this limit: it must converge and diverge. Writes the table of results/robustness.md.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from marked_sections import RESULTS, replace_section
from rich.progress import track

from hsp_control import Rollout, load_experiment
from hsp_control.common.exceptions import SimulationError, UnstableRateError

OFFSET = 0.03  # relative distance of a run from the limit
PERIODS = 600
STARTS = {
    "panda": ("panda_tcp", [0.0, -0.5, 0.1, -2.0, 0.2, 1.6, 0.7]),
    "iiwa14": ("iiwa_link_ee", [0.0, 0.6, 0.1, -1.4, 0.2, 0.9, 0.3]),
}


class Case(NamedTuple):
    """A loop with one setting whose limit is to be found.

    Attributes:
        name: Name in the table.
        robot: Name of the robot.
        frequency: Control frequency [Hz].
        settings: (setting x, period h) ↦ changes of the configuration.
        unit: (x, h) ↦ name and value of the number that theory gives.
        upper: Upper end of the search interval for x, over the frequency.
        below: Whether the loop is stable below its limit; else above it.
    """

    name: str
    robot: str
    frequency: float
    settings: Callable[[float, float], dict[str, Any]]
    unit: Callable[[float, float], tuple[str, float]]
    upper: float
    below: bool = True


def gain(x: float, h: float) -> dict[str, Any]:
    """Change the null-space gain."""
    return {"null_space.gain": x}


def frequency(x: float, h: float) -> dict[str, Any]:
    """Change the task's natural frequency."""
    return {"tasks.hand.gains.natural_frequency": x}


def stiff(x: float, h: float) -> dict[str, Any]:
    """Change gain and stiffness of the field, both to x."""
    return {"null_space.gain": x, "null_space.fields.0.weight": x}


def plus(
    settings: Callable[[float, float], dict[str, Any]], **more: Any
) -> Callable[[float, float], dict[str, Any]]:
    """Add constant settings to variable ones; ``__`` in a name is a dot."""
    others = {key.replace("__", "."): value for key, value in more.items()}
    return lambda x, h: {**settings(x, h), **others}


def K_N(x: float, h: float) -> tuple[str, float]:
    """Return K_N h."""
    return "K_N h", x * h


def omega(x: float, h: float) -> tuple[str, float]:
    """Return ω0 h."""
    return "ω0 h", x * h


def both(x: float, h: float) -> tuple[str, float]:
    """Return h times gain and stiffness."""
    return "(K_N + α) h", 2.0 * x * h


LATE = {"plant__drives__delay": 1}
CASES = [
    Case("null space", "panda", 1000, gain, K_N, 4.0),
    Case("null space", "panda", 100, gain, K_N, 4.0),
    Case("null space", "iiwa14", 500, gain, K_N, 4.0),
    Case("null space, one period late", "panda", 1000, plus(gain, **LATE), K_N, 4.0),
    Case("null space, measured one period late", "panda", 500,
         plus(gain, plant__sensors__delay=1), K_N, 4.0),
    Case("null space, field as stiff as K_N", "panda", 1000, stiff, both, 2.0),
    Case("the same, one period late", "panda", 1000, plus(stiff, **LATE), both, 2.0),
    Case("task", "panda", 1000, frequency, omega, 2.0),
    Case("task", "panda", 100, frequency, omega, 2.0),
    Case("task", "iiwa14", 1000, frequency, omega, 2.0),
    Case("task, one period late", "panda", 1000, plus(frequency, **LATE), omega, 2.0),
    Case("task, one period late", "panda", 100, plus(frequency, **LATE), omega, 2.0),
    Case("task, two periods late", "iiwa14", 500,
         plus(frequency, plant__drives__delay=2), omega, 2.0),
    Case("task, one period late, predicted", "panda", 1000,
         plus(frequency, **LATE, compensation__predictor={"effort_delay": 1}),
         omega, 2.0),
    Case("task, one each, predicted", "panda", 500,
         plus(frequency, **LATE, plant__sensors__delay=1,
              compensation__predictor={"effort_delay": 1, "sensor_delay": 1}),
         omega, 2.0),
    Case("task, velocity at 50 Hz", "panda", 1000,
         plus(frequency, compensation__velocity_filter={"cutoff": 50.0}), omega, 2.0),
    Case("task, velocity at 50 Hz, second order", "panda", 1000,
         plus(frequency, compensation__velocity_filter={"cutoff": 50.0, "order": 2}),
         omega, 2.0),
    Case("task, observer of 50 1/s, one period late", "panda", 1000,
         plus(frequency, **LATE, compensation__momentum_observer={"bandwidth": 50.0}),
         omega, 2.0),
    Case("observer of x, ω0 h = 0.1, one period late", "panda", 1000,
         lambda x, h: {"compensation.momentum_observer": {"bandwidth": x},
                       "tasks.hand.gains.natural_frequency": 0.1 / h,
                       "plant.drives.delay": 1},
         lambda x, h: ("K_O h", x * h), 4.0),
    Case("integral action, ω0 h = 0.05", "panda", 1000,
         lambda x, h: {"compensation.integral_action": {"rate": x},
                       "tasks.hand.gains.natural_frequency": 0.05 / h},
         lambda x, h: ("Ki / (Kv Kp)", x / (0.1 / h)), 0.099),
]  # fmt: skip


def configuration(case: Case, x: float, *, check: bool) -> dict[str, Any]:
    """Return a configuration with the robot at rest, slightly off its target."""
    hand, q0 = STARTS[case.robot]
    h = 1.0 / case.frequency
    target = [value + 1e-3 * (-1) ** k for k, value in enumerate(q0)]
    config: dict[str, Any] = {
        "robot": {"name": case.robot},
        "start": {"configuration": q0},
        "tasks": {
            "hand": {
                "type": "frame_position",
                "frame": hand,
                "trajectory": {
                    "type": "hold",
                    "origin": "start",
                    "point": [1e-4, -1e-4, 1e-4],
                },
                "gains": {"natural_frequency": 0.05 / h},
            }
        },
        "null_space": {
            "gain": 0.1 / h,
            "fields": [{"type": "target_posture", "target": target, "weight": 1.0}],
        },
        "limits": None,  # it is the law's own loop that grows or dies
        "plant": {"type": "rigid_body", "drives": {}, "sensors": {}},
        "compensation": {"momentum_observer": None},
        "simulation": {
            "duration": PERIODS * h,
            "control_period": h,
            "log_period": h,
            "check_rate": check,
            "integrator": {"type": "rk4", "step": h},
        },
    }
    for key, value in case.settings(x, h).items():
        *parents, last = key.split(".")
        place: Any = config
        for part in parents:
            place = place[int(part)] if part.isdigit() else place[part]
        place[last] = value
    return config


def limit(case: Case) -> float:
    """Return the setting above which `check_rate` reports an unstable loop."""
    low, high = 1e-3 * case.frequency, case.upper * case.frequency
    for _ in range(40):
        middle = 0.5 * (low + high)
        try:
            load_experiment(configuration(case, middle, check=True))
        except UnstableRateError:
            high = middle
        else:
            low = middle
        if high - low < 1e-5 * high:
            break
    return low


def growth(case: Case, x: float) -> float:
    """Return the ratio of the largest joint velocities, last to first third of the run.

    A stable loop converges, so that the ratio is below 1; inf if the run fails.
    """
    try:
        run = load_experiment(configuration(case, x, check=False)).run()
    except SimulationError as error:
        if not isinstance(error.rollout, Rollout):
            raise
        return np.inf
    speed = np.linalg.norm(run.v, axis=1)
    third = len(speed) // 3
    return float(speed[-third:].max() / speed[:third].max())


def main() -> None:
    """Write the table of results/robustness.md."""
    lines = [
        "| loop | robot | rate | limit | 3 % below | 3 % above |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for case in track(CASES, transient=True):
        x = limit(case)
        name, value = case.unit(x, 1.0 / case.frequency)
        below, above = (growth(case, (1.0 + s * OFFSET) * x) for s in (-1.0, 1.0))
        if not below < 1.0 < above:
            print(f"WRONG: {case.name}: {below:.3g}, {above:.3g}")
        grown = "∞" if np.isinf(above) else f"{above:.2g}"
        lines.append(
            f"| {case.name} | {case.robot} | {case.frequency:g} Hz | "
            f"{name} < {value:.3f} | {below:.2g} | {grown} |"
        )
    replace_section(RESULTS / "robustness.md", "rates", "\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
