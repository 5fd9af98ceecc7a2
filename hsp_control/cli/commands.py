"""The commands of ``hsp`` without a separate file."""

import argparse
import json
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn, track
from rich.table import Table

from hsp_control.cli import check as checks
from hsp_control.cli import robot_table
from hsp_control.cli.consoles import errors as _errors
from hsp_control.cli.consoles import message_of
from hsp_control.cli.consoles import out as _out
from hsp_control.cli.interrupts import INTERRUPTED, DeferredInterrupt
from hsp_control.cli.loading import read
from hsp_control.cli.stopwatch import Stopwatch
from hsp_control.common.errors import LogError, SimulationError
from hsp_control.common.unicode_text import utf8
from hsp_control.config import Experiment, json_schema
from hsp_control.config.loaded_scenario import LoadedScenario, load_scenario
from hsp_control.robot import Robot
from hsp_control.robot.description.sources import example_robots
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.measures import measures
from hsp_control.simulation.run_summary import summary_rows


class _Shown(Protocol):
    """The display of a run by a companion."""

    def begin(self, experiment: Experiment) -> None:
        """Show the run's start."""

    def on_row(self, recorder: LogWriter) -> None:
        """Show the rows computed so far."""

    def finish(self, rollout: Rollout) -> int:
        """Show the whole run until its user closes it; return the exit status."""


def run(options: argparse.Namespace) -> int:
    """Simulate, save the log and print a summary; rows computed so far are kept."""
    loaded = load_scenario(read(options))
    options.out.mkdir(parents=True, exist_ok=True)  # raises before the work, not after
    log = _log_of(Path(loaded.document.name), options)
    tell = _tell_json if options.json else _tell
    with options.open_page(options, loaded) as page:
        experiment = _built(loaded)
        if page is not None:
            page.begin(experiment)
        return _run_and_save(experiment, log, tell, page)


_LONGEST = 120  # maximum length of a file's name, without its ending
_SHOWN = re.compile(r"\s*(title|description|view)\b")
"""Keys that change how a run is shown, not the run."""


def file_name(words: str) -> str:
    """Return words as the name of a file; a longer name is cut and ends in its hash."""
    name = re.sub(r"[\s/\\]+", "_", re.sub(r"[,;+]\s*", "-", words))
    if len(name) <= _LONGEST:
        return name
    return f"{name[: _LONGEST - 9]}-{sha256(utf8(words)).hexdigest()[:8]}"


def _log_of(source: Path, options: argparse.Namespace) -> Path:
    """Return the path of a run's log, whose name contains the settings.

    So it replaces neither the log of another run nor the repeated one.
    """
    changed = [each for each in options.overrides if not _SHOWN.match(each)]
    folder: Path = options.out
    log = folder / f"{file_name('-'.join([source.stem, *changed]))}.npz"
    if log.exists() and source.exists() and log.samefile(source):
        return log.with_stem(f"{log.stem}-again")
    return log


def _built(loaded: LoadedScenario) -> Experiment:
    experiment = Experiment.of(loaded)
    checks.warn_of_rates(experiment)
    checks.warn_of_reach(experiment)
    return experiment


def _run_and_save(
    experiment: Experiment,
    log: Path,
    tell: Callable[[Rollout, Path, Stopwatch], None],
    page: _Shown | None,
) -> int:
    status, journal = 0, log.with_suffix(".journal")  # readable if we are killed
    stopwatch = Stopwatch()
    on_row = page.on_row if page is not None else None
    with DeferredInterrupt() as interrupts:
        try:
            rollout = _run_with_progress(
                experiment, stopwatch, interrupts, journal, on_row
            )
        except SimulationError as error:
            if not isinstance(error.rollout, Rollout) or not len(error.rollout):
                journal.unlink(missing_ok=True)
                raise
            rollout, status = error.rollout, 2
            print(f"hsp: {message_of(error)}", file=sys.stderr)
        interrupts.ignore_first()
        if rollout.status == "interrupted":
            at = f" at t = {rollout.t[-1]:g} s" if len(rollout) else ""
            print(f"hsp: stopped by the user{at}", file=sys.stderr)
            status = INTERRUPTED
        elif rollout.status == "stopped" and not status:
            print(f"hsp: {rollout.meta['message']}", file=sys.stderr)
            status = 2
        if not len(rollout):
            journal.unlink(missing_ok=True)
            return status
        try:
            log = rollout.save(log)
        except LogError as error:
            log, status = _saved_elsewhere(rollout, log, error), 2
        journal.unlink(missing_ok=True)
    tell(rollout, log, stopwatch)
    for line in checks.advice_of_run(experiment, rollout):
        print(f"hsp: {line}", file=sys.stderr)
    if page is not None:
        status = max(status, page.finish(rollout))
    return status


def _tell(rollout: Rollout, log: Path, stopwatch: Stopwatch) -> None:
    """Print the summary of a run, as a table."""
    table = Table(show_header=False, box=None, pad_edge=False)
    for line in [*summary_rows(rollout), *stopwatch.table_rows(rollout)]:
        table.add_row(*line)
    _out.print(table)
    _out.print(f"Log: {log}")


def _tell_json(rollout: Rollout, log: Path, stopwatch: Stopwatch) -> None:
    """Print the measures of a run by their names; null where undefined."""
    found = {name: each.value for name, each in measures(rollout).items()}
    numbers = {name: x if np.isfinite(x) else None for name, x in found.items()}
    facts = {"log": str(log), "status": rollout.status, "rows": len(rollout)} | numbers
    print(json.dumps(facts, indent=2, ensure_ascii=False))


def _saved_elsewhere(rollout: Rollout, log: Path, error: LogError) -> Path:
    """Save a log in a temporary folder, so that hours of computation are not lost."""
    try:
        elsewhere = rollout.save(Path(tempfile.mkdtemp(prefix="hsp-")) / log.name)
    except (LogError, OSError):
        raise error from None
    print(f"hsp: {message_of(error)}; the log is saved elsewhere", file=sys.stderr)
    return elsewhere


def robots(options: argparse.Namespace) -> int:
    """List all robots, or describe one."""
    if options.name is not None:
        _describe(Robot.load(options.name))
        return 0
    found = list(
        track(
            robot_table.rows(),
            "robots",
            total=robot_table.count(),
            console=_errors,
            transient=True,
        )
    )
    if options.json:
        rows = [asdict(row) for row in found]
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return 0
    for line in robot_table.text(found):
        _out.print(line, markup=False)
    if not example_robots():
        _out.print("More with: pip install example-robot-data-loaders")
    return 0


def schema(options: argparse.Namespace) -> int:
    """Print the JSON Schema, one definition a line."""
    whole = json_schema()
    definitions = [f"{_compact(k)}:{_compact(v)}" for k, v in whole["$defs"].items()]
    rest = _compact({name: part for name, part in whole.items() if name != "$defs"})
    print(rest[:-1] + ',"$defs":{\n' + ",\n".join(definitions) + "\n}}")
    return 0


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _run_with_progress(
    experiment: Experiment,
    stopwatch: Stopwatch,
    interrupts: DeferredInterrupt,
    journal: Path,
    on_row: Callable[[LogWriter], None] | None = None,
) -> Rollout:
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=_errors,
        transient=True,
        disable=not _errors.is_terminal,
    ) as progress:
        bar = progress.add_task(experiment.name, total=1.0)

        def show(done: float) -> None:
            interrupts.check()
            stopwatch.lap()
            progress.update(bar, completed=done)

        return experiment.run(show, on_row, journal)


def _describe(robot: Robot) -> None:
    _out.print(f"{robot!r} from {_shown(robot.source.urdf)}")
    lower, upper = robot.position_limits()
    effort, speed = robot.model.upperEffortLimit, robot.model.upperVelocityLimit
    table = Table(box=None, pad_edge=False)
    table.add_column("dof")
    for heading in ("lower", "upper", "speed limit", "effort limit"):
        table.add_column(heading, justify="right")
    for i, name in enumerate(robot.dof_names):
        numbers = (lower[i], upper[i], speed[i], effort[i])
        table.add_row(name, *(f"{number:.4g}" for number in numbers))
    _out.print(table)
    _out.print(f"Frames: {', '.join(robot.frame_names)}")


def _shown(path: Path) -> str:
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
