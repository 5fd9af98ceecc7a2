"""The options of ``hsp bench``."""

import argparse
from pathlib import Path

from hsp_control.cli.options.shared import add_overrides, add_strict


def add_bench(bench: argparse.ArgumentParser) -> None:
    """Add all options of `hsp bench`."""
    bench.add_argument(
        "--latency",
        action="store_true",
        required=True,
        help="a real-time loop, and an empty one to compare with",
    )
    bench.add_argument(
        "config",
        nargs="?",
        default="panda_obstacle",
        metavar="CONFIG",
        help="as for hsp run; default: panda_obstacle",
    )
    add_overrides(bench)
    add_strict(bench)
    bench.add_argument(
        "--seconds", type=float, default=60.0, metavar="S", help="default: 60"
    )
    bench.add_argument(
        "--rate", type=float, default=1000.0, metavar="HZ", help="default: 1000"
    )
    bench.add_argument(
        "--priority",
        type=int,
        metavar="LEVEL",
        help="real-time priority (SCHED_FIFO), 1 to 99; needs the right to it",
    )
    bench.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the distributions (.png, ...)"
    )
    bench.add_argument(
        "--json", action="store_true", help="print the times as JSON, in seconds"
    )
