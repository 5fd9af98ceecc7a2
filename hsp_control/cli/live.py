"""``hsp live``: the controller here, a simulated robot in another process, 1 kHz."""

import argparse
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf, nan
from pathlib import Path
from typing import Any

from rich.table import Table

from hsp_control.cli.consoles import out
from hsp_control.cli.robot_process import RobotProcess
from hsp_control.common.exceptions import LiveError, LogError
from hsp_control.config import Experiment, load_experiment
from hsp_control.config.build_live import (
    interface_of,
    stop_of,
    tolerance_of,
    watched_robot,
)
from hsp_control.control.compensation import Command
from hsp_control.live import (
    Faults,
    InProcessRobot,
    LoopReport,
    Operator,
    run_loop,
)
from hsp_control.live.latency import Quantiles
from hsp_control.live.settings import check_fixed
from hsp_control.simulation import Rollout

_REHEARSED = 0.5
"""How much of the run is rehearsed off the clock [s]: kernels are compiled there."""


def live(options: argparse.Namespace) -> int:
    """Run a loop against the clock, and say how it was and why it ended."""
    faults, kill = Faults.parse(options.faults), _kill_of(options.kill)
    experiment = load_experiment(options.config, *options.overrides)
    check_fixed(experiment.robot)
    simulation = experiment.scenario.simulation
    duration = simulation.duration if options.duration is None else options.duration
    if not duration > 0.0:
        raise LiveError(f"--duration {duration:g}; must be positive")
    own = options.out / f"{experiment.name}-live.journal"
    robots = options.out / f"{experiment.name}-robot.journal"
    operator = Operator()
    settings: dict[str, Any] = {
        "interface": interface_of(experiment),
        "tolerance": tolerance_of(experiment),
        "stop": stop_of(experiment),
        "operator": operator,
        "scene": experiment.scene,
        "log_period": simulation.log_period,
    }
    command = Command(experiment.controller, experiment.compensation)
    with _signals(operator):
        rehearsal = InProcessRobot(watched_robot(experiment))
        run_loop(
            command,
            rehearsal,
            duration=min(duration, _REHEARSED),
            **settings,
        )
        with RobotProcess(
            experiment, faults=faults, log=robots, log_period=simulation.log_period
        ) as robot:
            report = run_loop(
                command,
                robot.hardware,
                duration=None if duration == inf else duration,
                log=own,
                meta=_meta(experiment),
                priority=options.priority,
                on_period=_killer(kill, robot),
                **settings,
            )
            told = robot.wait()
    link = robot.hardware.link
    counts = {**link.counts, "lost": link.lost}
    out.print(_times(report, experiment))
    out.print(_packets(counts, link.injected, told))
    _say_ends(report, told)
    _keep(own, link=counts, injected=link.injected)
    _keep(robots)
    asked = report.ended == "completed" or (
        report.ended == "operator" and duration == inf
    )
    if not asked:
        print(f"hsp: {report.reason}", file=sys.stderr)
    return 0 if asked and told is not None else 2


def _meta(experiment: Experiment) -> dict[str, Any]:
    return {
        "name": f"{experiment.name}, live",
        "title": experiment.scenario.title,
        "config": experiment.scenario.model_dump(mode="json"),
    }


@contextmanager
def _signals(operator: Operator) -> Iterator[None]:
    """Make Ctrl-C, and being told to end, the operator's stop; a second one is final.

    The second is Python's own: it ends the loop where it is, and the robot's watchdog
    does the rest.
    """
    kinds = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def stop(number: int, frame: object) -> None:
        operator.stop(f"stopped by the operator ({signal.Signals(number).name})")
        for kind in kinds:
            signal.signal(kind, signal.default_int_handler)

    before = {kind: signal.signal(kind, stop) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def _kill_of(text: str | None) -> tuple[str, float] | None:
    """Return who is killed, and when [s], from ``robot=1.5`` or ``controller=2``."""
    if text is None:
        return None
    who, _, when = text.partition("=")
    try:
        time = float(when)
    except ValueError:
        time = nan
    if who not in {"robot", "controller"} or not time >= 0.0:
        raise LiveError(f"--kill {text!r}; needs robot=SECONDS or controller=SECONDS")
    return who, time


def _killer(
    wanted: tuple[str, float] | None, robot: RobotProcess
) -> Callable[[float], None] | None:
    if wanted is None:
        return None
    who, time = wanted
    left = [True]

    def kill(t: float) -> None:
        if t >= time and left:
            left.clear()
            if who == "robot":
                robot.kill()
            else:
                os.kill(os.getpid(), signal.SIGKILL)

    return kill


def _times(report: LoopReport, experiment: Experiment) -> Table:
    deadlines = report.deadlines
    table = Table(box=None, pad_edge=False)
    table.add_column(f"{experiment.name} at {1.0 / deadlines.period:g} Hz, times in µs")
    for heading in ("median", "p99", "p99.9", "worst"):
        table.add_column(heading, justify="right")

    def row(name: str, times: Quantiles | None) -> None:
        if times is not None:
            table.add_row(name, *(f"{1e6 * x:.0f}" for x in times))

    row("from a state to its effort", deadlines.response)
    row("from state to state", deadlines.gap)
    return table


def _packets(
    counts: dict[str, int], injected: dict[str, int], told: dict[str, Any] | None
) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("packets")
    kinds = ("accepted", "lost", "stale", "duplicated", "corrupted", "foreign")
    for heading in ("sent", *kinds):
        table.add_column(heading, justify="right")
    theirs = None if told is None else told["link"]
    sent = "-" if theirs is None else str(theirs["sent"])
    table.add_row("states to the loop", sent, *(str(counts[kind]) for kind in kinds))
    got = ["-"] * len(kinds) if theirs is None else [str(theirs[k]) for k in kinds]
    table.add_row("efforts to the robot", str(counts["sent"]), *got)
    if told is not None and any([*injected.values(), *told["injected"].values()]):
        for what, done in (("states", told["injected"]), ("efforts", injected)):
            named = {"late": "stale"}
            shown = {named.get(kind, kind): str(n) for kind, n in done.items()}
            cells = (shown.get(kind, "") for kind in kinds)
            table.add_row(f"  injected, {what}", "", *cells)
    return table


def _say_ends(report: LoopReport, told: dict[str, Any] | None) -> None:
    deadlines = report.deadlines
    out.print(
        f"Periods: {deadlines.periods} answered, {deadlines.missed} of them late; "
        f"{deadlines.silent} without a new state, {deadlines.unseen} states not seen"
    )
    where = "fell silent" if report.silent else "held the robot"
    out.print(
        f"The loop: {report.reason}, at t = {report.t:.3f} s; {where}, the fastest "
        f"joint at {report.speed:.2g}"
    )
    if told is None:
        out.print("The robot: its process was killed")
    else:
        out.print(
            f"The robot: {told['reason']}; {told['phase']} at t = {told['t']:.3f} s, "
            f"the fastest joint at {told['speed']:.2g}"
        )


def _keep(journal: Path, **meta: Any) -> None:
    """Turn a journal into a log like all others; what cannot be stays a journal."""
    try:
        rollout = Rollout.load(journal)
        rollout.meta.update(meta)
        log = rollout.save(journal.with_suffix(".npz"))
    except LogError as error:
        print(f"hsp: {error}", file=sys.stderr)
        return
    journal.unlink()
    out.print(f"Log: {log}")
