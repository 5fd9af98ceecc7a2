"""How much of the second core a sweep uses.

    .venv/bin/python benchmarks/sweep_efficiency.py [--rounds N] [--samples N]

The same sweep with one worker and with two, in turns, workers' start included. By the
clock the efficiency is T1/(2 T2), which means nothing on a machine that others
use: two processes do not get twice as much there as one. What does not depend on others
is what the efficiency is made of: how much processor time the work takes, C1/C2, and
which share of their time workers spend in runs rather than starting and waiting,
B2/B1. Their product is the efficiency on a machine of one's own.
"""

import argparse
import resource
import statistics
from time import perf_counter
from typing import NamedTuple

from hsp_control import sweep


class Cost(NamedTuple):
    """What a sweep took: by the clock, of processors; the workers' share in runs."""

    clock: float
    processor: float
    busy: float


def cost(samples: int, workers: int) -> Cost:
    """Return what a sweep takes."""
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
    cost(2, 1)  # compiles
    print(
        "| round | T1 | T2 | T1/(2 T2) | C1/C2 | B1 | B2 | on a machine of one's own |"
    )
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
