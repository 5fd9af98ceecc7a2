"""``hsp sweep`` and its options; slow modules are imported when it runs."""

import argparse
from pathlib import Path

from hsp_control.cli.options import AddedCommand, add_configuration, add_import


def _add_options(sweep: argparse.ArgumentParser) -> None:
    add_configuration(sweep)
    add_import(sweep)
    sweep.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="varied values: a,b,c or LOW:HIGH:COUNT or log:LOW:HIGH:COUNT, or (with "
        "--samples) uniform:LOW:HIGH, loguniform:LOW:HIGH, normal:MEAN:DEVIATION, "
        "integers:LOW:HIGH; may be repeated",
    )
    sweep.add_argument(
        "--samples", type=int, metavar="N", help="runs; default: every combination"
    )
    sweep.add_argument(
        "--design",
        metavar="DESIGN",
        help="grid, random, latin_hypercube or sobol; default: grid without --samples, "
        "latin_hypercube with them",
    )
    sweep.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    sweep.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="for Parquet files; runs that they contain are not repeated; "
        "default: out/NAME-sweep.parquet",
    )
    sweep.add_argument(
        "--fresh", action="store_true", help="remove the folder's present contents"
    )
    sweep.add_argument(
        "--time-limit",
        type=float,
        metavar="SECONDS",
        help="the longest computation of a run; default: any",
    )
    sweep.add_argument(
        "--workers", type=int, metavar="N", help="processes; default: one per core"
    )
    sweep.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask scheduler, such as tcp://10.0.0.1:8786, whose workers compute; "
        "default: workers on this computer",
    )
    sweep.add_argument(
        "--plot", action="store_true", help="draw the results, beside the folder"
    )


def _run(options: argparse.Namespace) -> int:
    from hsp_control.companions.sweeps.sweep_command import sweep

    return sweep(options)


SWEEP = AddedCommand(
    help="run a configuration many times",
    add_options=_add_options,
    run=_run,
    own_interrupts=True,  # it saves rows
)
