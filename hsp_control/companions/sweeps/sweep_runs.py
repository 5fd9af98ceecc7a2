"""Run one experiment many times."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import islice
from os import PathLike
from pathlib import Path
from threading import Thread
from time import sleep
from typing import TYPE_CHECKING, Any

from hsp_control.common.errors import SweepError
from hsp_control.common.keywords import suggesting
from hsp_control.common.numbers import check_positive
from hsp_control.companions.sweeps.design import chosen_design, points
from hsp_control.companions.sweeps.factor import factors
from hsp_control.companions.sweeps.plan import SweepPlan
from hsp_control.companions.sweeps.results import Sweep
from hsp_control.config.document import read_document
from hsp_control.declaration.imported import import_code

if TYPE_CHECKING:
    from distributed import Client

    from hsp_control.companions.sweeps.luggage import Luggage
    from hsp_control.companions.sweeps.one_run import Row
    from hsp_control.companions.sweeps.row_files import RowFiles

_POLL = 0.02
"""Time between two looks for completed runs [s]."""
_LOST = "the scheduler does not answer any more; the same command resumes the sweep"
AT_ONCE = 1000
"""Runs submitted to the scheduler at a time: 10^5 would take a minute, and much
memory."""


@suggesting
def sweep(
    source: str | PathLike[str] | dict[str, Any],
    over: Mapping[str, Any] | Iterable[str],
    *,
    samples: int | None = None,
    design: str | None = None,
    seed: int = 0,
    out: str | PathLike[str] | None = None,
    overrides: Iterable[str] = (),
    imports: Iterable[str | PathLike[str]] = (),
    scheduler: "str | Client | None" = None,
    workers: int | None = None,
    fresh: bool = False,
    time_limit: float | None = None,
    on_start: "Callable[[Client], None] | None" = None,
    on_progress: Callable[[int, int, int], None] | None = None,
) -> Sweep:
    """Run an experiment many times with different values, and return the results.

    The results depend only on the arguments before ``out`` and on ``overrides``: not on
    the number of workers, the order in which they finish, or interruptions.

    Args:
        source: A configuration; see `hsp_control.load_experiment`.
        over: The varied parameters: key paths of the configuration and their values, as
            a mapping ``{"null_space.gain": "1:20:5"}`` or as texts ``key=values``.
            Values are a text (see `values.parsed`), a sequence or a distribution such
            as ``scipy.stats.norm(0.0, 0.1)``.
        samples: The number of runs; None: all combinations.
        design: ``grid``, ``random``, ``latin_hypercube`` or ``sobol``; None: the grid
            without ``samples``, Latin hypercube with them.
        seed: Seed of the design.
        out: A folder for Parquet files, whose name ends with ``.parquet``. Runs of the
            same sweep that are in it are not computed again. None: nothing is written.
        overrides: Values to change in all runs, each ``key.path=value``.
        imports: Python files or modules to import first, here and in every worker, for
            the functions and types that the configuration names. Those that declare
            types of the configuration in this process are sent automatically.
        scheduler: The address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``, or
            a client of one; None: workers on this computer.
        workers: The number of these; None: one per core.
        fresh: Start again, and remove the rows in ``out``.
        time_limit: The maximum computation time of a run [s], checked at every row of
            its log; None: none. A run that takes longer has the status ``timed out``,
            and is repeated when the sweep resumes.
        on_start: Called with Dask's client when there are workers.
        on_progress: Called with the number of runs that are done, of all runs, and of
            runs that are done but not completed.

    Returns:
        The sweep. Ctrl-C ends it early; the sweep and its folder then contain all rows
        computed so far, and `Sweep.complete` is False.

    Raises:
        SweepError: If the sweep is not well defined, its folder has another one or
        cannot be written, or there are no suitable workers. Rows that were computed are
        in the folder.
        HspControlError: If the configuration cannot be built with any of the first
            values. Single runs that cannot be built, diverge or crash are rows.
    """
    _check_installed()
    from hsp_control.companions.sweeps import luggage
    from hsp_control.companions.sweeps.cluster import connected
    from hsp_control.companions.sweeps.row_files import RowFiles

    if luggage.reading:
        raise luggage.SweepReachedError
    if time_limit is not None:
        check_positive("time_limit", time_limit, "s", SweepError)
    if workers is not None and workers < 1:
        raise SweepError(f"{workers} workers; needs at least 1")
    if workers is not None and scheduler is not None:
        raise SweepError("a scheduler starts its own workers: give one of the two")
    own = [str(each) for each in imports]
    for each in own:
        import_code(each)
    plan = _plan(source, over, overrides, design, samples, seed)
    first, experiment = plan.first_run()
    if experiment.live_sources:
        raise SweepError(
            f"a stream listens to {experiment.live_sources[0]}, which only one run "
            "can; sweep the log of a run, or give the stream a recording as its source"
        )
    identity = plan.identity(experiment.robot)
    path = None if out is None else Path(out)
    if path is not None and path.suffix != ".parquet":
        raise SweepError(f"{path}: the name of a sweep's folder must end with .parquet")
    packed = luggage.Luggage(plan, experiment.robot, identity, own)
    rows = RowFiles(plan, identity, path, fresh=fresh)
    tell = on_progress or (lambda *_: None)
    try:
        tell(len(rows.done), len(plan), rows.failures)
        with suppress(KeyboardInterrupt):
            if len(rows.done) < len(plan):
                _rehearse(plan, first)
                with connected(scheduler, workers) as client:
                    if on_start is not None:
                        on_start(client)
                    for row in _computed(plan, packed, rows, client, time_limit):
                        if row is None:
                            rows.write_if_due()
                            continue
                        rows.add(row)
                        tell(len(rows.done), len(plan), rows.failures)
    finally:
        rows.close()
    return Sweep.of_table(rows.table, rows.meta)


def _check_installed() -> None:
    try:
        import distributed  # noqa: F401
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise SweepError(
            f"a sweep needs {error.name}: pip install 'hsp_control[sweeps]'"
        ) from None


def _plan(
    source: str | PathLike[str] | dict[str, Any],
    over: Mapping[str, Any] | Iterable[str],
    overrides: Iterable[str],
    design: str | None,
    samples: int | None,
    seed: int,
) -> SweepPlan:
    varied = factors(over)
    form = chosen_design(design, samples)
    base = read_document(source)
    for assignment in overrides:
        base.override(assignment)
    return SweepPlan(
        base=base,
        factors=varied,
        design=form,
        samples=samples,
        seed=seed,
        points=points(varied, form, samples, seed),
    )


def _rehearse(plan: SweepPlan, run: int) -> None:
    """Simulate one log period of a run: a mistake is found before workers start."""
    from hsp_control.companions.sweeps.one_run import computed
    from hsp_control.config.experiment import build

    document = plan.document(run)
    period = build(document).scenario.simulation.log_period
    document.assign(["simulation", "duration"], period, "")
    row = computed(lambda _: build(document), run, (), None)
    if row.status == "interrupted":
        raise KeyboardInterrupt


def _computed(
    plan: SweepPlan,
    packed: "Luggage",
    rows: "RowFiles",
    client: "Client",
    time_limit: float | None,
) -> "Iterator[Row | None]":
    """Yield the rows of the remaining runs, as they end; None while none has ended."""
    from distributed import as_completed

    from hsp_control.companions.sweeps.one_run import one_run

    done = frozenset(rows.done)
    left = (run for run in range(len(plan)) if run not in done)

    def submitted(most: int) -> "list[Any]":
        """Submit some of the remaining runs."""
        return [
            client.submit(
                one_run, packed.name, run, plan.changes(run), time_limit,
                key=(packed.name, run), pure=False,
            )
            for run in islice(left, most)
        ]  # fmt: skip

    _give(client, packed)
    waiting = as_completed(
        submitted(AT_ONCE), loop=client.loop, with_results=True, raise_errors=False
    )
    try:
        while not waiting.is_empty():
            if not waiting.has_ready():
                sleep(_POLL)
                yield None
                continue
            yield _row(*next(waiting))
            waiting.update(submitted(1))
    finally:
        for future in list(waiting.futures):
            future.release()
        # A lost or stopped scheduler does not answer.
        tidy = Thread(target=_tidy, args=(client, packed.name), daemon=True)
        tidy.start()
        tidy.join(5.0)


def _give(client: "Client", packed: "Luggage") -> None:
    """Send the luggage to all workers; a stopped one receives it when it continues."""
    failed: list[Exception] = []

    def give() -> None:
        try:
            client.register_plugin(packed, name=packed.name)
        except Exception as error:
            failed.append(error)

    giving = Thread(target=give, daemon=True)
    giving.start()
    giving.join(10.0)
    if failed and isinstance(failed[0], OSError):  # also of Dask, for a lost scheduler
        raise SweepError(_LOST)
    if failed:
        raise SweepError(f"a worker cannot be prepared: {failed[0]}")


def _tidy(client: "Client", luggage: str) -> None:
    with suppress(Exception):
        if client.status == "running":
            client.unregister_worker_plugin(luggage)


def _row(future: Any, result: Any) -> "Row":
    from distributed import KilledWorker

    from hsp_control.companions.sweeps.one_run import CRASHED, Row

    if isinstance(result, Row):
        return result  # whatever has become of its worker since then
    if future.status in ("cancelled", "lost"):
        raise SweepError(_LOST)
    _, error, _ = result
    if isinstance(error, KilledWorker):
        died = error.allowed_failures + 1
        reason = f"{died} workers died while they computed it (out of memory?)"
        return Row(future.key[1], CRASHED, reason)
    if isinstance(error, SweepError):
        raise error
    raise SweepError(f"a worker cannot compute runs: {type(error).__name__}: {error}")
