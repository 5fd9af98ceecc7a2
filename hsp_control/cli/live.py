"""``hsp live``: control a simulated robot in another process in real time."""

import argparse
import sys
from collections.abc import Callable
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import Any

from rich.table import Table

from hsp_control.cli.consoles import out, working
from hsp_control.cli.live_experiment import (
    begun_where_it_is,
    check_live,
    live_period,
    loaded_live,
    simulated_robot,
)
from hsp_control.cli.loading import read
from hsp_control.cli.robot_process import RobotProcess
from hsp_control.cli.true_run import with_tasks
from hsp_control.common.errors import LiveError, LogError
from hsp_control.config import Experiment, load_experiment
from hsp_control.control.compensation import CompensatedController
from hsp_control.live import (
    Faults,
    Hardware,
    InProcessRobot,
    LoopReport,
    OperatorRequests,
    Publisher,
    connect,
    publish,
    run_loop,
)
from hsp_control.live.hardware import AdaptingHardware, LocatedHardware, described
from hsp_control.live.operator_requests import stop_signals
from hsp_control.simulation import Rollout
from hsp_control.simulation.declared_run import with_duration
from hsp_control.simulation.run_summary import summary_rows

_DRY_RUN = 0.5  # duration of the dry run, in which every call is made once [s]
_DRY_RUN_OF_A_PLAN = 3.0  # the same with a plan, which must make its first steps [s]


def live(options: argparse.Namespace) -> int:
    """Run a loop in real time, print its response times and why it ended."""
    faults = Faults.parse(options.faults)
    loaded = loaded_live(read(options))
    simulation = loaded.scenario.simulation
    duration = simulation.duration if options.duration is None else options.duration
    if not duration > 0.0:
        raise LiveError(f"--duration {duration:g}; must be positive")
    until = None if duration == inf else duration
    simulated = options.faults or options.cameras or options.lockstep
    if options.robot is not None and simulated:
        raise LiveError(
            "--faults, --cameras and --lockstep are for the simulated robot: leave "
            "them out with --robot"
        )
    # The experiment
    name = Path(loaded.document.name).stem
    loop_log = options.out / f"{name}-live.journal"
    robot_log = options.out / f"{name}-robot.journal"
    requests = OperatorRequests()
    on_period: list[Callable[[float], object]] = []
    publisher: Publisher | None = None
    with ExitStack() as stack:
        page = stack.enter_context(options.open_page(options, loaded.scenario))
        experiment = Experiment.of(loaded)
        check_live(experiment)
        stack.enter_context(stop_signals(requests, takes_over=True))
        real = options.robot is not None
        compensated = _compensated(experiment, real=real)
        plan = experiment.scenario.plan
        options_of_loop: dict[str, Any] = {
            "plan": plan,
            "estimators": experiment.scenario.estimators,
            "settings": experiment.scenario.live,
            "requests": requests,
            "scene": experiment.scene,
            "log_period": simulation.log_period,
        }

        def run(hardware: Hardware) -> LoopReport:
            report = run_loop(
                compensated,
                hardware,
                duration=until,
                log=loop_log,
                meta={
                    "name": f"{experiment.name}, live",
                    "title": experiment.scenario.title,
                    "config": with_duration(experiment.config, until),
                    "momentum_observer": _on_observer(experiment, real=real),
                },
                priority=options.priority,
                on_period=lambda t: [each(t) for each in on_period],
                **options_of_loop,
            )
            if publisher is not None:
                _publish_end(publisher, report)
            return report

        # A dry run binds everything, before there is a clock
        dry_run_robot = InProcessRobot(simulated_robot(experiment))
        run_loop(
            compensated,
            dry_run_robot,
            duration=min(duration, _DRY_RUN if plan is None else _DRY_RUN_OF_A_PLAN),
            **options_of_loop,
        )
        observed = _on_observer(experiment, real=real)
        out.print(f"Momentum observer: {observed}", highlight=False)
        # A robot, and further listeners
        hardware: Hardware | None = None
        if options.robot is not None:
            hardware = connect(options.robot, experiment.robot, live_period(experiment))
            stack.callback(hardware.close)
        if isinstance(hardware, LocatedHardware):
            experiment = begun_where_it_is(experiment, options, hardware.q)
            options_of_loop["scene"] = experiment.scene
            compensated = _compensated(experiment, real=real)
        if isinstance(hardware, AdaptingHardware):
            options_of_loop["settings"] = hardware.adapted(experiment.scenario.live)
            for line in hardware.lines:
                out.print(line, highlight=False)
        if options.publish is not None:
            publisher = publish(options.publish, compensated)
            on_period.append(publisher)
        if page is not None:
            on_period.append(page.let_steer(experiment, requests, loop_log))
        if hardware is not None:
            report = run(hardware)
            out.print(_times(report, experiment))
            out.print(f"The loop: {report.reason}")
            kept = _convert(loop_log)
            fault = getattr(hardware, "fault", None)
            ends = {"completed", "operator"}
            if fault is None and report.ended in ends and not requests.fault:
                return 0 if kept else 2
            named = fault is None or fault in report.reason
            print(f"hsp: {report.reason if named else fault}", file=sys.stderr)
            return 2
        # Or a simulated one, in a separate process
        with RobotProcess(
            experiment,
            faults=faults,
            log=robot_log,
            log_period=simulation.log_period,
            cameras=options.cameras,
            lockstep=options.lockstep,
        ) as robot:
            report = run(robot.hardware)
            robot_report = robot.wait()
    # The result
    link = robot.hardware.link
    counts = {**link.counts, "lost": link.lost}
    out.print(_times(report, experiment))
    out.print(_packets(counts, link.injected, robot_report))
    _print_ends(report, robot_report)
    kept = _convert(loop_log, link=counts, injected=link.injected)
    # Without the loop's log there may be an earlier run's.
    followed = loop_log.with_suffix(".npz") if kept else None
    kept &= _convert(robot_log, followed=followed)
    asked = report.ended == "operator" and not requests.fault
    regular = report.ended == "completed" or (asked and duration == inf)
    if not regular:
        print(f"hsp: {report.reason}", file=sys.stderr)
    return 0 if regular and robot_report is not None and kept else 2


def _publish_end(publisher: Publisher, report: LoopReport) -> None:
    """Publish the end; what a publisher raises hides neither it nor the log."""
    try:
        publisher.ended(report.ended, report.reason)
    except BaseException as error:
        print(f"hsp: the end was not published: {described(error)}", file=sys.stderr)


def _compensated(experiment: Experiment, *, real: bool) -> CompensatedController:
    """Return the chain to the effort; ``auto`` depends on the kind of robot."""
    own = experiment.scenario.compensation if real else experiment.compensation
    return CompensatedController(experiment.controller, own)


def _on_observer(experiment: Experiment, *, real: bool) -> str:
    """Return a few words: whether there is a momentum observer, and why."""
    if not real:
        return experiment.on_observer
    own, period = experiment.scenario.compensation, live_period(experiment)
    return own.on_observer(experiment.controller, period, exact=False)


def _table(title: str, *headings: str) -> Table:
    table = Table(title, box=None, pad_edge=False)
    for heading in headings:
        table.add_column(heading, justify="right")
    return table


def _times(report: LoopReport, experiment: Experiment) -> Table:
    deadlines = report.deadlines
    title = f"{experiment.name} at {1.0 / deadlines.period:g} Hz, times in µs"
    table = _table(title, "median", "p99", "p99.9", "worst")

    for name, times in (
        ("response: from a state to its effort", deadlines.response),
        ("interval: from state to state", deadlines.interval),
    ):
        if times is not None:
            table.add_row(name, *(f"{1e6 * x:.0f}" for x in times))
    return table


def _summary(rollout: Rollout) -> Table:
    """Return the summary of a log, as ``hsp run`` prints it."""
    title = str(rollout.meta.get("name", ""))
    table = Table(title=title, box=None, pad_edge=False, show_header=False)
    for row in summary_rows(rollout):
        table.add_row(*row)
    return table


def _packets(
    counts: dict[str, int],
    injected: dict[str, int],
    robot_report: dict[str, Any] | None,
) -> Table:
    kinds = ("accepted", "lost", "stale", "duplicated", "corrupted", "foreign")
    table = _table("packets", "sent", *kinds)
    robot = None if robot_report is None else robot_report["link"]
    sent = "-" if robot is None else str(robot["sent"])
    table.add_row("states to the loop", sent, *(str(counts[kind]) for kind in kinds))
    received = ["-"] * len(kinds) if robot is None else [str(robot[k]) for k in kinds]
    table.add_row("efforts to the robot", str(counts["sent"]), *received)
    theirs = {} if robot_report is None else robot_report["injected"]
    if any([*injected.values(), *theirs.values()]):
        for packets, faults in {"states": theirs, "efforts": injected}.items():
            column = {"stale": "late"}
            cells = (str(faults.get(column.get(kind, kind), "")) for kind in kinds)
            table.add_row(f"  injected, {packets}", "", *cells)
    return table


def _print_ends(report: LoopReport, robot_report: dict[str, Any] | None) -> None:
    times = report.deadlines
    out.print(
        f"Periods: {times.periods} answered, {times.missed} deadline misses; "
        f"{times.without_state} without a new state, {times.skipped_states} states "
        "skipped"
    )
    held = "held the robot" if report.at_rest else "could not bring the robot to rest"
    end = "fell silent" if report.silent else held
    out.print(
        f"The loop: {report.reason}, at t = {report.t:.3f} s; {end}, the fastest "
        f"joint at {report.speed:.2g}"
    )
    if robot_report is None:
        out.print("The robot: its process was killed")
    else:
        out.print(
            f"The robot: {robot_report['reason']}; {robot_report['phase']} at "
            f"t = {robot_report['t']:.3f} s, the fastest joint at "
            f"{robot_report['speed']:.2g}"
        )


def _convert(journal: Path, followed: Path | None = None, **meta: Any) -> bool:
    """Convert a journal to an ``.npz`` log, or keep it; return its success.

    Args:
        journal: The journal of the loop, or of the robot.
        followed: For the robot's, the log of the loop, which knows what was followed.
        meta: JSON data to add to the log's.
    """
    unknown = ""
    try:
        rollout = Rollout.load(journal)
        rollout.meta.update(meta)
        if followed is not None:
            try:
                with working(f"The robot's errors in {len(rollout)} rows"):
                    rollout = with_tasks(
                        rollout, Rollout.load(followed), load_experiment(followed)
                    )
            except BaseException as error:  # of the user's own code, or Ctrl-C
                unknown = described(error)
        log = rollout.save(journal.with_suffix(".npz"))
    except LogError as error:
        print(f"hsp: {error}", file=sys.stderr)
        return False
    journal.unlink(missing_ok=True)
    out.print(_summary(rollout))
    if unknown:
        out.print(f"The robot's log has its states only: {unknown}", highlight=False)
    out.print(f"Log: {log}")
    return True
