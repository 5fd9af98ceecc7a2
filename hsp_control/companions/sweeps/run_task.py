"""Run one task, in any process: text in, text out."""

import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from hsp_control.common.exceptions import HspControlError, SimulationError
from hsp_control.companions.sweeps.plan import document
from hsp_control.companions.sweeps.row import CRASHED, TIMED_OUT, SweepRow
from hsp_control.config.experiment import build
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import Measure, measures


def run_task(task: str) -> str:
    """Run a task and return its result; no error is raised.

    Both are JSON: a worker needs and executes only the code of this package.
    """
    start = perf_counter()
    found: dict[str, Measure] = {}
    try:
        status, message, rollout = _run(task)
        if rollout is not None:
            found = measures(rollout)
    except BaseException as error:  # one failed run must not end the sweep
        status, message = "failed", _described(error)
    return json.dumps(
        {
            "status": status,
            "message": message,
            "measures": {name: list(measure) for name, measure in found.items()},
            "wall_time": perf_counter() - start,
        }
    )


def _described(error: BaseException) -> str:
    name = type(error).__name__
    try:
        return f"{name}: {error}"
    except BaseException:
        return name


def crashed(reason: str) -> str:
    """Return the result of a task whose worker died."""
    return json.dumps({"status": CRASHED, "message": reason})


def read_result(run: int, text: str) -> tuple[SweepRow, dict[str, Measure]]:
    """Return a result's row and its measures."""
    result = json.loads(text)
    found = {k: Measure(*measure) for k, measure in result.get("measures", {}).items()}
    metrics = {name: measure.value for name, measure in found.items()}
    row = SweepRow(
        run, result["status"], result["message"], metrics, result.get("wall_time", 0.0)
    )
    return row, found


def _run(task: str) -> tuple[str, str, Rollout | None]:
    limit = json.loads(task).get("time_limit")
    try:
        with _at_most(limit):
            rollout = build(document(task)).run()
    except _TooLongError:
        return TIMED_OUT, f"took longer than {limit:g} s", None
    except SimulationError as error:
        if isinstance(error.rollout, Rollout):
            return "diverged", str(error.__cause__ or error), error.rollout
        return "refused", str(error), None
    except HspControlError as error:
        return "refused", str(error), None
    return rollout.status, str(rollout.meta["message"]), rollout


class _TooLongError(BaseException):
    """A run took too long; no handler of other errors may keep it from ending."""


@contextmanager
def _at_most(seconds: float | None) -> Iterator[None]:
    """Raise where the block takes longer, in a process's main thread."""

    def stop(signal_number: int, frame: object) -> None:
        raise _TooLongError

    if seconds is None:
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
