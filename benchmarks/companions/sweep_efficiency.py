"""Measure the parallel efficiency of a sweep on two cores.

    python benchmarks/companions/sweep_efficiency.py [--rounds N] [--samples N]

Runs the same sweep with one worker and with two, in turns, start of the workers
included. By wall time the efficiency is T1/(2 T2). On a machine with other load this is
meaningless: two processes do not get twice the processor time of one. Two factors do
not depend on other load: the ratio of processor times, C1/C2, and the ratio B2/B1 of
the fractions of time that workers spend in runs (not starting or waiting). Their
product is the efficiency on an otherwise idle machine.
"""

import argparse
import resource
import statistics
from time import perf_counter
from typing import NamedTuple

from hsp_control.companions.sweeps import sweep


class Cost(NamedTuple):
    """Wall time [s] and processor time [s] of a sweep; fraction of time in runs."""

    clock: float
    processor: float
    busy: float


def cost(samples: int, workers: int) -> Cost:
    """Run a sweep, and return its cost."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = perf_counter()
    found = sweep(
        "panda_limits",
        {"null_space.gain": "loguniform:2:50", "null_space.fields.0.weight": "0.5:2"},
        samples=samples,
        overrides=["simulation.duration=5"],
        workers=workers,
    )
    clock = perf_counter() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert found.completed.all()
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(clock, processor, float(found["wall_time"].sum()) / workers / clock)


def main() -> None:
    """Print each round, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--samples", type=int, default=100)
    options = parser.parse_args()
    cost(2, 1)  # compiles the kernels
    print("| round | T1 | T2 | T1/(2 T2) | C1/C2 | B1 | B2 | idle machine |")
    print("|--:|--:|--:|--:|--:|--:|--:|--:|")
    found = []
    for k in range(options.rounds):
        one, two = cost(options.samples, 1), cost(options.samples, 2)
        clock, work = one.clock / two.clock / 2, one.processor / two.processor
        own = work * two.busy / one.busy
        found.append((clock, own))
        print(
            f"| {k + 1} | {one.clock:.1f} s | {two.clock:.1f} s | {clock:.2f} | "
            f"{work:.3f} | {one.busy:.3f} | {two.busy:.3f} | {own:.3f} |",
            flush=True,
        )
    clock, own = (statistics.median(column) for column in zip(*found, strict=True))
    print(f"| median | | | {clock:.2f} | | | | {own:.3f} |")


if __name__ == "__main__":
    main()
