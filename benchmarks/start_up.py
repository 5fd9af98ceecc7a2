"""Measure the time of a start with an empty and with a filled kernel cache.

    .venv/bin/python benchmarks/start_up.py [CONFIG ...] [--rounds N]

A CONFIG may be followed by changes, as in "panda_obstacle limits=none".

Each start is a new interpreter that imports the package, builds a configuration and
computes its first effort. Cold: the cache of compiled code is an empty folder. Cached:
it is the folder that the cold start has filled. The two alternate. Times are processor
times, which equal wall time on an idle machine: everything runs in one thread.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile

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


def start(config: str, cache: str) -> float:
    """Return the time of a start, to the first effort [s]."""
    done = subprocess.run(
        [sys.executable, "-c", START, *config.split()],
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configs", nargs="*", metavar="CONFIG")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    configs = options.configs or [*CONFIGS]
    print("| configuration | start | to the first effort |")
    print("|---|---|--:|")
    for config in configs:
        times: dict[str, list[float]] = {"cold": [], "cached": []}
        for _ in range(options.rounds):
            with tempfile.TemporaryDirectory() as cache:
                for kind in times:
                    times[kind].append(start(config, cache))
        for kind, rounds in times.items():
            median, least, most = statistics.median(rounds), min(rounds), max(rounds)
            cell = f"{median:.1f} s ({least:.1f} to {most:.1f})"
            print(f"| `{config}` | {kind} | {cell} |")


if __name__ == "__main__":
    main()
