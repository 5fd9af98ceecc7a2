"""Measure the parallel efficiency of a sweep on two cores.

    python benchmarks/companions/sweep_efficiency.py [--rounds N] [--samples N]

Runs the same sweep with one worker and with two, in turns, start of the workers
included. By wall time the efficiency is T1/(2 T2). On a machine with other load this is
meaningless: two processes do not get twice the processor time of one. B1 and B2 are the
fractions of time that workers spend in runs, not starting or waiting.
"""

import argparse
import statistics
from time import perf_counter
from typing import NamedTuple

from hsp_control.companions.sweeps import sweep


class Cost(NamedTuple):
    """Wall time [s] of a sweep; fraction of it in runs."""

    clock: float
    busy: float


def cost(samples: int, workers: int) -> Cost:
    """Run a sweep, and return its cost."""
    begin = perf_counter()
    found = sweep(
        "panda_limits",
        {"null_space.gain": "loguniform:2:50", "null_space.fields.0.weight": "0.5:2"},
        samples=samples,
        overrides=["simulation.duration=5"],
        workers=workers,
    )
    clock = perf_counter() - begin
    assert found.completed.all()
    return Cost(clock, float(found["wall_time"].sum()) / workers / clock)


def main() -> None:
    """Print each round, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--samples", type=int, default=100)
    options = parser.parse_args()
    print("| round | T1 | T2 | T1/(2 T2) | B1 | B2 |")
    print("|--:|--:|--:|--:|--:|--:|")
    found = []
    for k in range(options.rounds):
        one, two = cost(options.samples, 1), cost(options.samples, 2)
        found.append(one.clock / two.clock / 2)
        print(
            f"| {k + 1} | {one.clock:.1f} s | {two.clock:.1f} s | {found[-1]:.2f} | "
            f"{one.busy:.3f} | {two.busy:.3f} |",
            flush=True,
        )
    print(f"| median | | | {statistics.median(found):.2f} | | |")


if __name__ == "__main__":
    main()
