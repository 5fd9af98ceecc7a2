"""One run, on a worker: plain data in, plain data out."""

from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any, NamedTuple

from hsp_control.common.errors import HspControlError, SimulationError, SweepError
from hsp_control.companions.sweeps.plan import Changes
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import Measure, measures

CRASHED, TIMED_OUT = "crashed", "timed out"
"""Status if the workers died, and if the run lasted too long. Neither is a result: such
runs are repeated when the sweep resumes."""


class Row(NamedTuple):
    """The outcome of a run.

    Attributes:
        run: Its number in the plan.
        status: ``completed``; ``diverged``: the metrics are those until then;
            ``refused``: the configuration is wrong; ``failed``: an unexpected error;
            ``crashed``: the workers died; ``timed out``: the run lasted too long.
        message: The reason, if the status is not ``completed``.
        metrics: The metrics by name.
        wall_time: Computation time [s]; the only entry that depends on the machine and
            the number of workers.
    """

    run: int
    status: str
    message: str = ""
    metrics: dict[str, Measure] = {}  # noqa: RUF012 - it is never changed
    wall_time: float = 0.0


def one_run(luggage: str, run: int, changes: Changes, time_limit: float | None) -> Row:
    """Compute a run with the luggage of this worker.

    Raises:
        SweepError: If the computer is not suitable for the sweep. Nothing else is
            raised: one failed run must not end the sweep.
    """
    from distributed import get_worker

    plugins, end = get_worker().plugins, perf_counter() + 60.0
    while luggage not in plugins and perf_counter() < end:
        sleep(0.05)  # sent separately, possibly after the run
    return computed(plugins[luggage].experiment, run, changes, time_limit)


def computed(
    experiment: Callable[[Changes], Any],
    run: int,
    changes: Changes,
    time_limit: float | None,
) -> Row:
    """Return the row of a run that is built by a function of its changes."""
    start = perf_counter()

    def check_time(_: object) -> None:
        if time_limit is not None and perf_counter() - start > time_limit:
            raise _TooLongError

    found: dict[str, Measure] = {}
    try:
        status, message, rollout = _outcome(lambda: experiment(changes), check_time)
        if rollout is not None:
            found = measures(rollout)
    except SweepError:
        raise
    except _TooLongError:
        status, message = TIMED_OUT, f"lasted longer than {time_limit:g} s"
    except BaseException as error:
        status, message = "failed", _described(error)
    return Row(run, status, message, found, perf_counter() - start)


class _TooLongError(BaseException):
    """A run lasted too long; not an `Exception`, so that no handler catches it."""


def _outcome(
    build: Callable[[], Any], on_row: Callable[[object], None]
) -> tuple[str, str, Rollout | None]:
    try:
        rollout = build().run(on_row=on_row)
    except SimulationError as error:
        if isinstance(error.rollout, Rollout):
            return "diverged", str(error.__cause__ or error), error.rollout
        return "refused", str(error), None
    except SweepError:
        raise
    except HspControlError as error:
        return "refused", str(error), None
    return rollout.status, str(rollout.meta["message"]), rollout


def _described(error: BaseException) -> str:
    name = type(error).__name__
    try:
        return f"{name}: {error}"
    except BaseException:
        return name
