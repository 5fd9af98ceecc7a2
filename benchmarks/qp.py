"""Solve random QPs with the package's solver, DAQP and quadprog, and compare.

    .venv/bin/python benchmarks/qp.py [count]

Twelve kinds, count of them in all (100,000). Prints one line per kind. Where a solver
differs, exact rational arithmetic decides: ``wrong`` are answers that it refutes.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

from qp_cases import KINDS, Answer, Case, answer, by_daqp, cost, defect
from qp_oracles import by_quadprog, exact_cost

from hsp_control.control.actuation.dual_active_set import (
    EXHAUSTED,
    SOLVED,
    Workspace,
)

TOLERANCE = 1e-8


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    print(
        f"{'kind':14}{'QPs':>7}{'solved':>8}{'wrong':>6}{'exhausted':>10}"
        f"{'defect':>9}{'warm':>9}{'iterations':>11}{'per row':>8}"
        f"   DAQP: differs, cost   quadprog: differs, cost"
    )
    for number, (kind, make) in enumerate(KINDS.items()):
        line(kind, make, number, count // len(KINDS))


def line(
    kind: str, make: Callable[[np.random.Generator], Case], number: int, count: int
) -> None:
    """Solve the QPs of one kind and print their line."""
    solved = wrong = exhausted = most = 0
    worst = warm = ratio = 0.0
    differs, error = [0, 0], [0.0, 0.0]
    for seed in range(count):
        case = make(np.random.default_rng([number, seed]))
        found = answer(case)
        optimal = found.code == SOLVED
        solved += optimal
        exhausted += found.code == EXHAUSTED
        most = max(most, found.iterations)
        ratio = max(ratio, found.iterations / len(case.rows))
        if optimal:
            fault = defect(case, found)
            worst = max(worst, fault)
            warm = max(warm, warm_difference(case, found, np.random.default_rng(seed)))
            refuted = fault > TOLERANCE and exact_cost(case, found) is None
        else:
            refuted = case.feasible
        wrong += refuted or optimal > case.feasible
        least = cost(case, found.x) if optimal else np.nan
        for which, oracle in enumerate((by_daqp, by_quadprog)):
            x = oracle(case)
            if (x is not None) != optimal:
                differs[which] += 1
            elif x is not None:
                gap = abs(cost(case, x) - least) / max(1.0, least)
                differs[which] += gap > TOLERANCE
                error[which] = max(error[which], gap)
    print(
        f"{kind:14}{count:7d}{solved:8d}{wrong:6d}{exhausted:10d}{worst:9.0e}{warm:9.0e}"
        f"{most:11d}{ratio:8.1f}   {differs[0]:13d}{error[0]:7.0e}   "
        f"{differs[1]:16d}{error[1]:7.0e}",
        flush=True,
    )


def warm_difference(case: Case, found: Answer, rng: np.random.Generator) -> float:
    """Return how much a warm start from a random active set changes x, relatively."""
    work = Workspace.of(len(case.x0), len(case.A))
    work.held[:] = rng.integers(-1, 2, len(work.held))
    work.held[found.active] = found.sides
    again = answer(case, work=work)
    if again.code != SOLVED:
        return np.inf
    return float(np.abs(again.x - found.x).max() / (1.0 + np.abs(found.x).max()))


if __name__ == "__main__":
    main()
