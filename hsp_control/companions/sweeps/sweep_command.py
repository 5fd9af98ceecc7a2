"""``hsp sweep``, and ``hsp plot`` of its file."""

import argparse
import re
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from hsp_control.cli.consoles import errors, out
from hsp_control.cli.interrupts import INTERRUPTED
from hsp_control.cli.loading import load
from hsp_control.common.errors import SweepError
from hsp_control.companions.sweeps import Sensitivity, Sweep, sensitivity
from hsp_control.companions.sweeps import sweep as run_sweep

if TYPE_CHECKING:
    from distributed import Client

_REASONS = 3  # maximum number of reasons printed for runs that did not complete
_NUMBER = re.compile(r"-?[0-9][0-9.]*(e[-+]?[0-9]+)?")


def sweep(options: argparse.Namespace) -> int:
    """Run a configuration many times and save it; return 2 if a run fails."""
    if options.strict or options.allow:
        load(options)  # the runs use the same files
    file = options.out or Path("out") / f"{Path(options.config).stem}-sweep.parquet"
    start = perf_counter()
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failures]}"),
        console=errors,
        transient=True,
        disable=not errors.is_terminal,
    ) as progress:
        bar = progress.add_task(escape(options.config), total=None, failures="")

        def show(done: int, total: int, failures: int) -> None:
            text = f"{failures} not completed" if failures else ""
            progress.update(bar, completed=done, total=total, failures=text)

        swept = run_sweep(
            options.config,
            options.over,
            samples=options.samples,
            design=options.design,
            seed=options.seed,
            out=file,
            overrides=options.overrides,
            imports=options.imports,
            scheduler=options.scheduler,
            workers=options.workers,
            fresh=options.fresh,
            time_limit=options.time_limit,
            on_start=_tell_dashboard,
            on_progress=show,
        )
    _print_summary(swept, perf_counter() - start)
    out.print(f"Sweep: {file}")
    if not swept.complete:
        left = swept.meta["runs"] - len(swept)
        print(
            f"hsp: stopped by the user, {left} runs are left; the same command resumes",
            file=sys.stderr,
        )
        return INTERRUPTED
    if options.plot:
        _draw(swept, file.parent, file.stem, ["png"])
    failed = len(swept) - int(swept.completed.sum())
    if failed:
        print(f"hsp: {failed} of {len(swept)} runs did not complete", file=sys.stderr)
    return 2 if failed else 0


def _tell_dashboard(client: "Client") -> None:
    errors.print(f"Dashboard: {client.dashboard_link}", highlight=False)


def plot(options: argparse.Namespace) -> int:
    """Print and draw the contents of a sweep's folder."""
    for file in options.logs:
        swept = Sweep.load(file)
        _print_summary(swept, None)
        folder = options.out or file.parent
        _draw(swept, folder, file.stem, options.formats or ["png"])
    return 0


def _draw(swept: Sweep, folder: Path, stem: str, formats: list[str]) -> None:
    from hsp_control.companions.sweeps.figure import save_sweep_figure

    for file in save_sweep_figure(swept, folder, stem, formats):
        out.print(f"Figure: {file}")


def _print_summary(swept: Sweep, took: float | None) -> None:
    counts = Counter(map(str, swept["status"]))
    states = ", ".join(f"{count} {status}" for status, count in counts.most_common())
    work = float(swept["wall_time"].sum())
    pace = "" if took is None else f"; {work:.1f} s of runs, {took:.1f} s now"
    out.print(f"{len(swept)} of {swept.meta['runs']} runs: {states or 'none'}{pace}")
    _print_failures(swept)
    try:
        found = sensitivity(swept)
    except SweepError as error:
        out.print(f"No sensitivities: {error}")
        return
    out.print(_spread(swept, found))
    if found.parameters:
        out.print(_influences(found))
        out.print(
            "Rank correlation, and the share of the variance of ranks that the "
            f"parameter explains alone; a correlation below {found.noise:.2f} may be "
            "chance (.)."
        )


def _print_failures(swept: Sweep) -> None:
    """Print why runs did not complete; reasons that differ only in numbers once."""
    reasons: dict[str, list[str]] = {}
    failed = ~swept.completed
    for status, message in zip(
        swept["status"][failed], swept["message"][failed], strict=True
    ):
        first = f"{status}: {message}".splitlines()[0]
        reasons.setdefault(_NUMBER.sub("#", first), []).append(first)
    usual = sorted(reasons.values(), key=len, reverse=True)
    for alike in usual[:_REASONS]:
        out.print(f"  {len(alike)} x {escape(alike[0])}")
    if len(usual) > _REASONS:
        out.print(f"  ... and {len(usual) - _REASONS} other reasons")


def _spread(swept: Sweep, found: Sensitivity) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    for heading in ("min", "median", "max", "worst run"):
        table.add_column(heading, justify="right")
    done = swept.completed
    for name in found.outcomes:
        unit = swept.meta["metrics"][name]["unit"]
        values = np.where(done, swept[name], np.nan)
        # Of manipulability and distances, the smallest value is the worst.
        worst = np.nanargmin(values) if name.endswith(".min") else np.nanargmax(values)
        figures = (np.nanmin(values), np.nanmedian(values), np.nanmax(values))
        unit = "" if unit == "–" else f" [{unit}]"
        table.add_row(
            escape(f"{name}{unit}"),
            *(f"{value:.3g}" for value in figures),
            str(swept["run"][worst]),
        )
    return table


def _influences(found: Sensitivity) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("", no_wrap=True)
    for name in found.outcomes:
        # Line breaks after dots: six complete names are too wide for a terminal.
        table.add_column(escape(name.replace(".", ".\n")), justify="right")
    for i, parameter in enumerate(found.parameters):
        table.add_row(
            escape(parameter), *(_cell(found, i, j) for j in range(len(found.outcomes)))
        )
    return table


def _cell(found: Sensitivity, i: int, j: int) -> str:
    correlation, share = found.correlation[i, j], found.share[i, j]
    if np.isnan(correlation):
        sign = "-"
    else:
        sign = "." if abs(correlation) < found.noise else f"{correlation:+.2f}"
    return f"{sign} {'-' if np.isnan(share) else f'{share:4.0%}'}"
