"""Measure the time of a start with an empty and with a filled kernel cache.

    .venv/bin/python benchmarks/start_up.py [CONFIG ...] [--rounds N]

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

START = """
import sys
from time import process_time
begin = process_time()
import hsp_control as hsp
imported = process_time()
experiment = hsp.load_experiment(sys.argv[1])
experiment.controller.compute(0.0, experiment.q0, experiment.v0)
done = process_time()
print(imported - begin, done - imported, done)
"""


def start(config: str, cache: str) -> tuple[float, float, float]:
    """Return the times of import, first effort and the whole start [s]."""
    done = subprocess.run(
        [sys.executable, "-c", START, config],
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        capture_output=True,
        text=True,
        check=True,
    )
    imported, effort, whole = map(float, done.stdout.split())
    return imported, effort, whole


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configs", nargs="*", metavar="CONFIG")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    configs = options.configs or ["paper/4_moving_obstacle", "panda_obstacle"]
    print("| configuration | start | import | first effort | total |")
    print("|---|---|--:|--:|--:|")
    for config in configs:
        times: dict[str, list[tuple[float, float, float]]] = {"cold": [], "cached": []}
        for _ in range(options.rounds):
            with tempfile.TemporaryDirectory() as cache:
                for kind in times:
                    times[kind].append(start(config, cache))
        for kind, rounds in times.items():
            columns = list(zip(*rounds, strict=True))
            cells = " | ".join(
                f"{statistics.median(column):.1f} s ({min(column):.1f} to "
                f"{max(column):.1f})"
                for column in columns
            )
            print(f"| `{config}` | {kind} | {cells} |")


if __name__ == "__main__":
    main()
