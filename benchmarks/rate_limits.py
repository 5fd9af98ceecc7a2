"""The limits of the sampled loop, linear and real: a robot just below and just above.

    .venv/bin/python benchmarks/rate_limits.py

For each case the check's own limit of one setting is found by bisection. Then the
nonlinear robot is let go near its target with the setting 3 % below and 3 % above it.
Writes the table of docs/robustness.md.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from marked import DOCS, replace_part
from rich.progress import track

from hsp_control import Rollout, load_experiment
from hsp_control.common.exceptions import SimulationError, UnstableRateError

BESIDE = 0.03
PERIODS = 600
STARTS = {
    "panda": ("panda_tcp", [0.0, -0.5, 0.1, -2.0, 0.2, 1.6, 0.7]),
    "iiwa14": ("iiwa_link_ee", [0.0, 0.6, 0.1, -1.4, 0.2, 0.9, 0.3]),
}


class Case(NamedTuple):
    """A loop with one setting to be found.

    Attributes:
        name: What it is.
        robot: Whose.
        frequency: Of the loop [Hz].
        settings: (setting x, period h) ↦ what it changes in the configuration.
        unit: (x, h) ↦ the number that theory states, and its name.
        greatest: Where to look for it.
        below: Whether it is stable below its limit; above it otherwise.
    """

    name: str
    robot: str
    frequency: float
    settings: Callable[[float, float], dict[str, Any]]
    unit: Callable[[float, float], tuple[str, float]]
    greatest: float
    below: bool = True


def gain(x: float, h: float) -> dict[str, Any]:
    """Return a null-space gain."""
    return {"null_space.gain": x}


def frequency(x: float, h: float) -> dict[str, Any]:
    """Return a task's frequency."""
    return {"tasks.hand.gains.natural_frequency": x}


def stiff(x: float, h: float) -> dict[str, Any]:
    """Return a field as stiff as K_N."""
    return {"null_space.gain": x, "null_space.fields.0.weight": x}


def also(
    settings: Callable[[float, float], dict[str, Any]], **more: Any
) -> Callable[[float, float], dict[str, Any]]:
    """Return settings with others beside them, dots written as ``__``."""
    beside = {key.replace("__", "."): value for key, value in more.items()}
    return lambda x, h: {**settings(x, h), **beside}


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
    Case("null space, one period late", "panda", 1000, also(gain, **LATE), K_N, 4.0),
    Case("null space, measured one period late", "panda", 500,
         also(gain, plant__sensors__delay=1), K_N, 4.0),
    Case("null space, field as stiff as K_N", "panda", 1000, stiff, both, 2.0),
    Case("the same, one period late", "panda", 1000, also(stiff, **LATE), both, 2.0),
    Case("task", "panda", 1000, frequency, omega, 2.0),
    Case("task", "panda", 100, frequency, omega, 2.0),
    Case("task", "iiwa14", 1000, frequency, omega, 2.0),
    Case("task, one period late", "panda", 1000, also(frequency, **LATE), omega, 2.0),
    Case("task, one period late", "panda", 100, also(frequency, **LATE), omega, 2.0),
    Case("task, two periods late", "iiwa14", 500,
         also(frequency, plant__drives__delay=2), omega, 2.0),
    Case("task, one period late, predicted", "panda", 1000,
         also(frequency, **LATE, compensation__predictor={"effort_delay": 1}),
         omega, 2.0),
    Case("task, one each, predicted", "panda", 500,
         also(frequency, **LATE, plant__sensors__delay=1,
              compensation__predictor={"effort_delay": 1, "sensor_delay": 1}),
         omega, 2.0),
    Case("task, velocity at 50 Hz", "panda", 1000,
         also(frequency, compensation__velocity_filter={"cutoff": 50.0}), omega, 2.0),
    Case("task, velocity at 50 Hz, second order", "panda", 1000,
         also(frequency, compensation__velocity_filter={"cutoff": 50.0, "order": 2}),
         omega, 2.0),
    Case("task, observer of 50 1/s, one period late", "panda", 1000,
         also(frequency, **LATE, compensation__momentum_observer={"bandwidth": 50.0}),
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
    """Return a robot a little off its target, at rest."""
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
        "plant": {"type": "rigid_body", "drives": {}, "sensors": {}},
        "compensation": {},
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
    """Return the setting beyond which the check refuses the loop."""
    low, high = 1e-3 * case.frequency, case.greatest * case.frequency
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
    """Return how much larger what dies is at the end than at first, inf if all is lost.

    Measured by the joints' velocity: all of it should be gone.
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
    """Write the table of docs/robustness.md."""
    lines = [
        "| loop | robot | rate | limit | 3 % below | 3 % above |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for case in track(CASES, transient=True):
        x = limit(case)
        name, value = case.unit(x, 1.0 / case.frequency)
        below, above = (growth(case, (1.0 + s * BESIDE) * x) for s in (-1.0, 1.0))
        if not below < 1.0 < above:
            print(f"WRONG: {case.name}: {below:.3g}, {above:.3g}")
        grown = "∞" if np.isinf(above) else f"{above:.2g}"
        lines.append(
            f"| {case.name} | {case.robot} | {case.frequency:g} Hz | "
            f"{name} < {value:.3f} | {below:.2g} | {grown} |"
        )
    replace_part(DOCS / "robustness.md", "rates", "\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
