"""How much of the second core a sweep uses.

    .venv/bin/python benchmarks/sweep_efficiency.py [--rounds N] [--samples N]

The same sweep with one worker and with two, in turns; the efficiency is T1/(2 T2), the
start of the workers included. A machine that others use too does not give two processes
twice as much as one: a plain arithmetic loop, as much of it in one process and halved
between two, says what it gives at that moment. Both are printed, and their ratio.
"""

import argparse
import statistics
import subprocess
import sys
from time import perf_counter

from hsp_control import sweep

WORK = "total = 0.0\nfor k in range({}):\n    total += k * k % 7\n"


def sweeping(samples: int, workers: int) -> float:
    """Return how long a sweep takes [s]."""
    begin = perf_counter()
    found = sweep(
        "panda_limits",
        {"null_space.gain": "loguniform:2:50", "null_space.fields.0.weight": "0.5:2"},
        samples=samples,
        overrides=["simulation.duration=5"],
        workers=workers,
    )
    assert found.completed.all()
    return perf_counter() - begin


def plain(work: int, processes: int) -> float:
    """Return how long plain work takes, divided between processes [s]."""
    begin = perf_counter()
    code = WORK.format(work // processes)
    started = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(processes)]
    for process in started:
        process.wait()
    return perf_counter() - begin


def main() -> None:
    """Print each round, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--samples", type=int, default=60)
    options = parser.parse_args()
    sweeping(2, 1)  # compiles
    work = 10_000_000
    work = int(work * max(1.0, 10.0 / plain(work, 1)))
    print("| round | 1 worker | 2 workers | efficiency | the machine's | ratio |")
    print("|--:|--:|--:|--:|--:|--:|")
    found = []
    for k in range(options.rounds):
        one, plain_one = sweeping(options.samples, 1), plain(work, 1)
        two, plain_two = sweeping(options.samples, 2), plain(work, 2)
        own, machine = one / two / 2, plain_one / plain_two / 2
        found.append((own, machine, own / machine))
        print(
            f"| {k + 1} | {one:.1f} s | {two:.1f} s | {own:.2f} | {machine:.2f} | "
            f"{own / machine:.2f} |",
            flush=True,
        )
    own, machine, ratio = (
        statistics.median(column) for column in zip(*found, strict=True)
    )
    print(f"| median | | | {own:.2f} | {machine:.2f} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
