"""Run tasks on an existing Dask cluster.

Only text and the name of `run_task` are sent; no code of the user is pickled. The
workers need this package, the same versions of the packages that its results depend on,
and the robot's files under the same paths.
"""

from collections.abc import Iterable, Iterator
from importlib import import_module
from itertools import islice
from typing import Any, Self

from hsp_control.common.exceptions import SweepError
from hsp_control.companions.sweeps.running import crashed, run_task

PATIENCE = 10.0
"""Time in which a scheduler must answer [s]."""

_WINDOW = 1000
"""Tasks that the scheduler has at a time; it keeps them all in memory."""


class DaskWorkers:
    """The workers of a Dask scheduler, used in a ``with`` block.

    If a worker dies, the scheduler gives its tasks to other workers. A task is given up
    after several workers have died during it.
    """

    def __init__(self, address: str) -> None:
        """Connect to a scheduler."""
        try:
            self._dask: Any = import_module("distributed")
        except ImportError:
            raise SweepError(
                "a scheduler needs Dask: pip install 'hsp_control[dask]'"
            ) from None
        try:
            self._client: Any = self._dask.Client(
                address, timeout=PATIENCE, set_as_default=False
            )
        except (OSError, ValueError, TimeoutError) as error:
            raise SweepError(
                f"no Dask scheduler answers at {address!r} ({_brief(error)}); "
                "`dask scheduler` prints its address, for example tcp://host:8786"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """Cancel unfinished tasks and disconnect; the cluster keeps running."""
        self._client.close()

    def map(self, tasks: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """Yield each task's result as soon as it is there; see `LocalWorkers.map`."""
        try:
            yield from self._map(iter(tasks))
        except Exception as error:  # connections fail with many kinds of errors
            raise SweepError(
                f"lost the connection to the Dask cluster ({_brief(error)}); finished "
                "runs are kept, and the same command continues the sweep"
            ) from error

    def _map(self, pending: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        runs: dict[str, int] = {}

        def submit(run: int, task: str) -> Any:
            # Not pure: otherwise results of an earlier sweep could be returned.
            future = self._client.submit(run_task, task, pure=False)
            runs[future.key] = run
            return future

        first = [submit(*task) for task in islice(pending, _WINDOW)]
        running = self._dask.as_completed(first, loop=self._client.loop)
        for future in running:
            run = runs.pop(future.key)
            # Set if the task's workers died too often; raises if it was cancelled.
            error = future.exception()
            yield run, crashed(_brief(error)) if error else future.result()
            for task in islice(pending, 1):
                running.add(submit(*task))


def _brief(error: BaseException) -> str:
    text = str(error).strip()
    return text.splitlines()[0] if text else type(error).__name__
