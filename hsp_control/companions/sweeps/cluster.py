"""The workers: on this computer by default, or of any Dask scheduler."""

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import TYPE_CHECKING, Any

from hsp_control.common.errors import SweepError

if TYPE_CHECKING:
    from distributed import Client

PATIENCE = 60.0
"""Maximum time for a scheduler to answer, and for the first worker to start [s]."""
SILENCE = 60
"""Time without an answer after which a worker of this computer is given up [s]."""
KILLS = 3
"""Number of workers of this computer that a run may kill before it is abandoned."""

_log = logging.getLogger(__name__)

# Dask's command, in a process group that ends when this process does: the pipe to it
# closes then, for any reason. Not Dask's own processes, which import the user's script
# again, which would need `if __name__ == "__main__"`.
_WORKERS = """
import os, sys, threading
def end():
    sys.stdin.read()
    os.killpg(0, 9)
threading.Thread(target=end, daemon=True).start()
from distributed.cli.dask_worker import main
main()
"""

_VARIABLES = {"DASK_LOGGING__DISTRIBUTED": "critical"}


@contextmanager
def connected(
    scheduler: "str | Client | None", workers: int | None
) -> "Iterator[Client]":
    """Yield a client of a scheduler, or of one with its own workers on this computer.

    Raises:
        SweepError: If the scheduler does not answer, or no worker can be started.
    """
    from distributed import Client

    if isinstance(scheduler, Client):
        yield scheduler
        return
    with _quiet():
        if scheduler is None:
            with _own_workers(workers) as client:
                yield client
            return
        try:
            _check_address(scheduler)
            client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:  # also a time-out
            raise SweepError(f"no scheduler answers at {scheduler}: {error}") from None
        with _closing(client):
            if not client.nthreads():
                _log.warning("%s has no workers yet: the runs wait for them", scheduler)
            yield client


def _check_address(scheduler: str) -> None:
    """Raise a ValueError for what is no address: Dask's client would hang."""
    from distributed.comm import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    scheme, place = parse_address(scheduler)
    get_backend(scheme)
    if scheme in ("tcp", "tls"):
        parse_host_port(place)


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress Dask's reports of dead workers and schedulers: the sweep has its own."""
    loggers = list(map(logging.getLogger, ("distributed", "distributed.client")))
    before = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


@contextmanager
def _own_workers(workers: int | None) -> "Iterator[Client]":
    import dask
    from distributed import Client, LocalCluster

    settings: dict[str, Any] = {
        "distributed.scheduler.allowed-failures": KILLS - 1,
        # A worker has one run, so that its death is caused by that run.
        "distributed.scheduler.worker-saturation": 1.0,
        # One that is stopped does not answer; its run is another's after twice that.
        "distributed.scheduler.worker-ttl": f"{SILENCE} s",
    }
    with dask.config.set(settings):
        cluster = LocalCluster(
            n_workers=0,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=False,
        )
    process = None
    try:
        process = subprocess.Popen(
            # -P: import this package, not one in the working folder.
            [
                sys.executable, "-P", "-c", _WORKERS, cluster.scheduler_address,
                "--nworkers", str(workers or _processors()), "--nthreads", "1",
                "--no-dashboard",
            ],
            stdin=subprocess.PIPE,
            env={
                **os.environ,
                **_VARIABLES,
                "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
            },
            start_new_session=True,  # Ctrl-C is for this process
        )  # fmt: skip
        with _closing(Client(cluster, set_as_default=False)) as client:
            _wait_for_one(client, process)
            yield client
    finally:
        if process is not None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, 9)
            process.communicate()
        with suppress(Exception):
            cluster.close(timeout=5)


def _wait_for_one(client: "Client", process: "subprocess.Popen[bytes]") -> None:
    end = monotonic() + PATIENCE
    while not client.nthreads():
        with suppress(subprocess.TimeoutExpired):
            status = process.wait(0.05)
            raise SweepError(f"no worker can be started: exit status {status}")
        if monotonic() > end:
            raise SweepError(f"no worker has started within {PATIENCE:g} s")


@contextmanager
def _closing(client: "Client") -> "Iterator[Client]":
    try:
        yield client
    finally:
        with suppress(Exception):  # of a lost scheduler
            client.close(timeout=2)


def _processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # macOS
