"""``hsp bench --latency``: a real-time loop, compared with an empty loop."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from hsp_control.cli.consoles import errors, out
from hsp_control.cli.loading import load
from hsp_control.cli.startup import INTERRUPTED
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.config import Scenario
from hsp_control.live.latency import (
    ControlLoop,
    Latency,
    Quantiles,
    measure,
)


def bench(options: argparse.Namespace) -> int:
    """Run the loop, and print its latencies."""
    if not 0.0 < options.rate <= 1e5:
        raise SimulationError(
            f"--rate {options.rate:g}; must be positive and at most 100000 Hz"
        )
    experiment = load(options)
    scenario = experiment.scenario
    loop = ControlLoop(
        experiment.controller,
        experiment.q0,
        experiment.v0,
        1.0 / options.rate,
        experiment.plant,
        scenario.plan,
        scenario.estimators,
    )
    found = _measure(loop, options)
    if options.json:
        print(json.dumps(_numbers(found), indent=2))
    else:
        _print(found, options, scenario)
    if options.plot is not None:
        title = f"{experiment.name}: a loop at {options.rate:g} Hz"
        _draw(found, options.plot, title, errors if options.json else out)
    if len(found.step) < round(options.seconds * options.rate):
        print("hsp: stopped by the user", file=sys.stderr)
        return INTERRUPTED
    return 0


def _numbers(found: Latency) -> dict[str, Any]:
    """Return the quantiles of all times [s], and the counts."""
    names = ("step", "back_to_back", "wake", "empty", "response")
    times = {name: Quantiles.of(getattr(found, name))._asdict() for name in names}
    counts = ("missed", "empty_missed", "compilations")
    return {
        "periods": len(found.step),
        **{name: getattr(found, name) for name in counts},
        **times,
    }


def _print(found: Latency, options: argparse.Namespace, scenario: Scenario) -> None:
    out.print(
        f"{options.config} at {options.rate:g} Hz: {len(found.step)} periods, "
        "alternating with as many of an empty loop; times in microseconds"
    )
    parts = [
        *(["estimators"] if scenario.estimators else []),
        *(["plan"] if scenario.plan is not None else []),
        "state and law",
    ]
    out.print(_table(found, ", ".join(parts)))
    out.print(
        f"Missed periods: {found.missed} of {len(found.step)}; the empty loop "
        f"{found.empty_missed} of {len(found.empty)}"
    )
    if found.compilations:
        out.print(f"{found.compilations} kernels were compiled during the measurement")


def _measure(loop: ControlLoop, options: argparse.Namespace) -> Latency:
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeRemainingColumn(),
        console=errors,
        transient=True,
        auto_refresh=False,  # its thread would run between the loop's steps
        disable=not errors.is_terminal,
    ) as progress:
        bar = progress.add_task(escape(options.config), total=1.0)

        def show(done: float) -> None:
            progress.update(bar, completed=done, refresh=True)

        return measure(
            loop, options.seconds, priority=options.priority, on_progress=show
        )


def _table(found: Latency, step: str) -> Table:
    """Return a table of all times; ``step`` says what the step consists of."""
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    for heading in ("median", "p99", "p99.9", "worst"):
        table.add_column(heading, justify="right")

    def row(name: str, times: Array) -> None:
        table.add_row(name, *(f"{1e6 * x:.0f}" for x in Quantiles.of(times)))

    row(f"step: {step}", found.step)
    row("the same back to back, without waiting", found.back_to_back)
    row("wake-up", found.wake)
    row("wake-up of the empty loop", found.empty)
    row("from the start of the period to the effort", found.response)
    return table


def _draw(found: Latency, file: Path, title: str, said: Console) -> None:
    from hsp_control.visualization.plots import latency_figure, save_figure

    save_figure(latency_figure(found, title), file, file.suffix.lstrip(".") or "png")
    said.print(f"Figure: {file}")
