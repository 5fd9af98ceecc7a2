"""Run one experiment many times."""

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.exceptions import HspControlError, SweepError
from hsp_control.companions.sweeps.design import chosen_design, points
from hsp_control.companions.sweeps.factor import factors
from hsp_control.companions.sweeps.local_workers import LocalWorkers
from hsp_control.companions.sweeps.plan import SweepPlan, document, insert
from hsp_control.companions.sweeps.results import Sweep
from hsp_control.companions.sweeps.run_task import read_result
from hsp_control.companions.sweeps.store import Store
from hsp_control.config.document import read_document
from hsp_control.config.experiment import build


def sweep(
    source: str | PathLike[str] | dict[str, Any],
    over: Mapping[str, Any] | Iterable[str],
    *,
    samples: int | None = None,
    design: str | None = None,
    seed: int = 0,
    out: str | PathLike[str] | None = None,
    overrides: Iterable[str] = (),
    workers: int | None = None,
    fresh: bool = False,
    time_limit: float | None = None,
    on_progress: Callable[[int, int, int], None] | None = None,
) -> Sweep:
    """Run an experiment many times with different values, and return the results.

    The results depend only on the arguments before ``out`` and on ``overrides``: not on
    the number of workers, the order in which they finish, or interruptions.

    Args:
        source: A configuration; see `hsp_control.load_experiment`.
        over: The varied parameters: key paths of the configuration and their values, as
            a mapping ``{"null_space.gain": "1:20:5"}`` or as texts ``key=values``.
            Values are a text (see `value_syntax.values`), a sequence or
            a `Distribution`.
        samples: The number of runs; None: all combinations.
        design: ``grid``, ``random``, ``latin_hypercube`` or ``sobol``; None: the grid
            without ``samples``, Latin hypercube with them.
        seed: Seed of the design.
        out: A Parquet file. Runs of the same sweep that it or its journal contains are
            not computed again. None: nothing is written.
        overrides: Values to change in all runs, each ``key.path=value``.
        workers: The number of processes; None: one per core.
        fresh: Start again, and overwrite ``out``.
        time_limit: The longest computation of a run [s]; None: any. A run that takes
            longer has the status ``timed out``, and is repeated when the sweep resumes.
        on_progress: Called with the number of runs that are done, of all runs, and of
            runs that are done but not completed.

    Returns:
        The sweep. Ctrl-C ends it early; the sweep and its file then contain all rows
        computed so far, and `Sweep.complete` is False.

    Raises:
        SweepError: If the sweep is not well defined, its file belongs to another sweep
            or cannot be written, or no worker can be started.
        LogError: If its journal cannot be written, or is no journal.
        HspControlError: If the configuration cannot be built with any of the first
            values. Single runs that cannot be built, diverge or crash are rows.
    """
    if time_limit is not None and not 0.0 < time_limit < np.inf:
        raise SweepError(f"time_limit is {time_limit} s; must be positive")
    varied = factors(over)
    form = chosen_design(design, samples)
    base = read_document(source)
    for assignment in overrides:
        base.override(assignment)
    plan = SweepPlan(
        name=base.name,
        data=base.to_dict(),
        factors=varied,
        design=form,
        samples=samples,
        seed=seed,
        points=points(varied, form, samples, seed),
        time_limit=time_limit,
    )
    try:
        first = plan.first_run()
    except HspControlError:
        insert(base, plan.changes(0))
        build(base)  # raises the same error, with the line of the file
        raise
    experiment = plan.experiment(first)
    if experiment.live_sources:
        raise SweepError(
            f"a stream hears {experiment.live_sources[0]}, which only one run can; "
            "sweep the log of a run, or give the stream a recording as its source"
        )
    identity = plan.identity(experiment)
    path = None if out is None else Path(out)
    if path is not None and path.suffix != ".parquet":
        raise SweepError(f"{path}: the name of a sweep's file must end with .parquet")
    count = _processors() if workers is None else workers
    with LocalWorkers(count) as pool:
        store = Store(plan, identity, path, fresh=fresh)
        try:
            with suppress(KeyboardInterrupt):
                if store.pending:
                    _rehearse(plan, first)
                _run_pending(plan, store, pool, on_progress)
        except BaseException:
            store.close()
            raise
        return store.close()


def _processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # macOS


def _rehearse(plan: SweepPlan, run: int) -> None:
    """Simulate one log period of a run: a mistake is found before workers start."""
    period = plan.experiment(run).scenario.simulation.log_period
    short = document(plan.task(run))
    short.assign(["simulation", "duration"], period, "")
    with suppress(HspControlError):  # the row of that run will contain the error
        if build(short).run().status == "interrupted":
            raise KeyboardInterrupt


def _run_pending(
    plan: SweepPlan,
    store: Store,
    pool: LocalWorkers,
    on_progress: Callable[[int, int, int], None] | None,
) -> None:
    failures = sum(row.status != "completed" for row in store.rows.values())
    if on_progress is not None:
        on_progress(len(store.rows), len(plan), failures)
    for run, text in pool.map((run, plan.task(run)) for run in store.pending):
        row, found = read_result(run, text)
        store.add(row, found)
        failures += row.status != "completed"
        if on_progress is not None:
            on_progress(len(store.rows), len(plan), failures)
