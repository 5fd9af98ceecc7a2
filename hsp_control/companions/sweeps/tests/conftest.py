"""A scheduler with two workers, shared by the sweeps of these tests."""

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest
from sweep_runs import SCHEDULER, WORKER, open_port


@pytest.fixture(scope="session")
def scheduler() -> Iterator[str]:
    """The address of a scheduler, started by hand, with two workers."""
    quiet = {**os.environ, "DASK_LOGGING__DISTRIBUTED": "critical"}
    with open_port() as port:
        address = f"tcp://127.0.0.1:{port}"
    commands = [[*SCHEDULER, "--port", str(port)], *2 * [[*WORKER, address]]]
    started = [
        subprocess.Popen([sys.executable, "-P", "-m", *command], env=quiet)
        for command in commands
    ]
    yield address
    for process in reversed(started):
        process.terminate()
        process.wait(60)
