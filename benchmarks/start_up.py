"""Measure the time of a start beside that of an import of Pinocchio.

    .venv/bin/python benchmarks/start_up.py [CONFIG ...] [--rounds N]

A CONFIG may be followed by changes, as in "panda_obstacle limits=none".

Each start is a new interpreter that imports the package, builds a configuration and
computes its first effort; in turns with one that imports Pinocchio alone. Times are
processor times, which equal wall time on an idle machine: all runs in one thread.
"""

import argparse
import statistics
import subprocess
import sys

CONFIGS = (
    "paper/4_moving_obstacle",
    "panda_obstacle",
    "panda_obstacle limits=none",
    "limits/panda_half_strength",
)

START = """
import sys
from time import process_time
import hsp_control as hsp
experiment = hsp.load_experiment(*sys.argv[1:])
experiment.controller.compute(0.0, experiment.q0, experiment.v0)
print(process_time())
"""

IMPORT = """
from time import process_time
import pinocchio
print(process_time())
"""


def taken(code: str, *arguments: str) -> float:
    """Return the processor time of a program [s]."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configs", nargs="*", metavar="CONFIG")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    print("| configuration | to the first effort | imports of Pinocchio |")
    print("|---|--:|--:|")
    for config in options.configs or CONFIGS:
        pairs = [
            (taken(START, *config.split()), taken(IMPORT))
            for _ in range(options.rounds)
        ]
        first, imported = (
            statistics.median(times) for times in zip(*pairs, strict=True)
        )
        print(f"| `{config}` | {first:.2f} s | {first / imported:.1f} |")


if __name__ == "__main__":
    main()
