"""Run tasks on an existing Dask cluster.

Only texts and the name of `run_task` travel: no code of the user's is pickled. The
workers need this package, the same versions of what its numbers depend on, and the
robot's files under the same paths.
"""

from collections.abc import Iterable, Iterator
from importlib import import_module
from itertools import islice
from typing import Any, Self

from hsp_control.common.exceptions import SweepError
from hsp_control.sweeps.running import crashed, run_task

PATIENCE = 10.0
"""How long [s] a scheduler may take to answer."""

_WINDOW = 1000
"""Tasks that the scheduler knows of at a time: it holds them all in memory."""


class DaskWorkers:
    """The workers of a Dask scheduler, used within a ``with`` block.

    A worker that dies loses nothing: the scheduler gives its tasks to others. Only a
    task over which several workers die is given up.
    """

    def __init__(self, address: str) -> None:
        """Connect to a scheduler.

        Args:
            address: Such as ``tcp://192.168.0.10:8786``; ``tls://`` takes its
                certificates from Dask's configuration.

        Raises:
            SweepError: If no scheduler answers there, or Dask is not installed.
        """
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
                "its address is printed by `dask scheduler`, such as tcp://host:8786"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """Forget what is not done, and leave the cluster as it was."""
        self._client.close()

    def map(self, tasks: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """Yield every task's result as soon as it is there; see `LocalWorkers.map`.

        Raises:
            SweepError: If the scheduler is lost.
        """
        try:
            yield from self._map(iter(tasks))
        except Exception as error:  # connections end in many ways
            raise SweepError(
                f"the Dask cluster is gone ({_brief(error)}); what is done is kept, "
                "and the same command does the rest"
            ) from error

    def _map(self, pending: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        runs: dict[str, int] = {}

        def submit(run: int, task: str) -> Any:
            # Not pure: a result that an earlier sweep left there would be taken.
            future = self._client.submit(run_task, task, pure=False)
            runs[future.key] = run
            return future

        first = [submit(*task) for task in islice(pending, _WINDOW)]
        running = self._dask.as_completed(first, loop=self._client.loop)
        for future in running:
            run = runs.pop(future.key)
            # What a future has whose worker died too often; a cancelled one raises.
            error = future.exception()
            yield run, crashed(_brief(error)) if error else future.result()
            for task in islice(pending, 1):
                running.add(submit(*task))


def _brief(error: BaseException) -> str:
    text = str(error).strip()
    return text.splitlines()[0] if text else type(error).__name__
