"""A payload, a delay and elastic joints together: a table of results/robustness.md.

    .venv/bin/python benchmarks/elastic_joints.py

The rate of the slowest motion of the sampled loop is computed, not simulated;
tests/unit/control/test_elastic_joint.py compares it with simulations.
"""

import numpy as np
from marked_sections import RESULTS, replace_section

from hsp_control.control.compensation.linear_loop import ElasticJoint, LinearLoop

PERIOD, OMEGA, RATE = 0.001, 20.0, 5.0
LINK, MOTOR, DAMPING = 1.0, 0.5, 0.02  # kg·m², kg·m²; of the critical damping
STIFFNESSES = (1e3, 1e4, 1e5, 1e6)  # N·m/rad


def rate(stiffness: float, heavier: float, delay: int, measured: str) -> float:
    """Return the rate of the slowest motion [1/s]; it grows if that is positive."""
    model = LINK + MOTOR
    critical = 2.0 * np.sqrt(stiffness * LINK * MOTOR / model)
    joint = ElasticJoint(
        (heavier * model - MOTOR) / model,
        MOTOR / model,
        stiffness / model,
        DAMPING * critical / model,
        measured,  # type: ignore[arg-type]
    )
    one = np.eye(1)
    loop = LinearLoop(
        OMEGA**2 * one,
        2.0 * OMEGA * one,
        RATE * OMEGA**2 * one,
        PERIOD,
        0,
        delay,
        joint=joint,
    )
    return float(np.log(loop.radius()) / PERIOD)


def main() -> None:
    """Write the table."""
    columns = [(heavier, delay) for heavier in (1.0, 3.0) for delay in (0, 2)]
    heads = [f"{h:g} times as heavy, {d} late" for h, d in columns]
    rows = [
        "| measured | stiffness [N·m/rad] | " + " | ".join(heads) + " |",
        "|---|--:|" + "--:|" * len(columns),
    ]
    for measured in ("motor", "link"):
        for stiffness in STIFFNESSES:
            cells = [f"{rate(stiffness, *each, measured):.1f}" for each in columns]
            rows.append(f"| {measured} | {stiffness:.0e} | " + " | ".join(cells) + " |")
    replace_section(RESULTS / "robustness.md", "elastic", "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
