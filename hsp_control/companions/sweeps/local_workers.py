"""Run tasks in processes on this machine.

Each worker is a new interpreter that reads and writes lines of JSON. So the user's
script needs no ``if __name__ == "__main__"``, and nothing is pickled. If a worker dies,
its task is known; a process pool does not report it.
"""

import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Self, TypeAlias

from hsp_control.common.exceptions import SweepError
from hsp_control.companions.sweeps.run_task import crashed
from hsp_control.companions.sweeps.worker import READY, main

_ATTEMPTS = 2
"""How often a task may kill its worker before it is given up."""

_ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)
"""The matrices are small: more threads would only slow down the other workers."""


_MAIN = f"from {main.__module__} import main; main()"

_Results: TypeAlias = "queue.SimpleQueue[tuple[int, str] | BaseException | None]"
"""Runs and results from the threads that serve workers; None: a thread has ended."""


class LocalWorkers:
    """Processes that run tasks, used in a ``with`` block.

    Attributes:
        count: The number of processes.
    """

    def __init__(self, count: int) -> None:
        """Set the number of processes; they start with the first task."""
        if count < 1:
            raise SweepError(f"{count} workers; needs at least 1")
        self.count = count
        self._closed = threading.Event()
        self._processes: dict[int, subprocess.Popen[str]] = {}
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop all workers at once; unfinished runs are lost."""
        self._closed.set()
        with self._lock:
            for process in self._processes.values():
                process.kill()

    def map(self, tasks: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """Yield every task's result as soon as it is available."""
        source = _Shared(iter(tasks))
        done: _Results = queue.SimpleQueue()
        for _ in range(self.count):
            serve = threading.Thread(
                target=self._serve, args=(source, done), daemon=True
            )
            serve.start()
        serving = self.count
        while serving:
            result = done.get()
            if result is None:
                serving -= 1
            elif isinstance(result, BaseException):
                raise result
            else:
                yield result

    def _serve(self, source: "_Shared", done: "_Results") -> None:
        """Give tasks to one worker until there are no more; replace it if it dies."""
        process: subprocess.Popen[str] | None = None
        try:
            while not self._closed.is_set() and (next_one := source.take()):
                run, task = next_one
                result, reason = None, ""
                for _ in range(_ATTEMPTS):
                    process = process or self._start()
                    result = _ask(process, task)
                    if result is not None or self._closed.is_set():
                        break
                    reason, process = _end(process), None
                done.put((run, crashed(reason) if result is None else result))
        except BaseException as error:
            done.put(error)
        finally:
            if process is not None:
                _end(process)
            done.put(None)

    def _start(self) -> subprocess.Popen[str]:
        root = str(Path(__file__).resolve().parents[2])
        inherited = os.environ.get("PYTHONPATH")
        path = os.pathsep.join([root, inherited] if inherited else [root])
        with self._lock:
            if self._closed.is_set():
                raise SweepError("the workers are closed")
            process = subprocess.Popen(
                # -P: import this package, not one in the working folder.
                [sys.executable, "-P", "-c", _MAIN],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                env={**os.environ, **_ONE_THREAD, "PYTHONPATH": path},
            )
            self._processes[process.pid] = process
        assert process.stdout is not None
        if process.stdout.readline().strip() != READY:
            raise SweepError(f"a worker cannot start: {_end(process)}")
        return process


class _Shared:
    """An iterator that several threads share."""

    def __init__(self, tasks: Iterator[tuple[int, str]]) -> None:
        self._tasks = tasks
        self._lock = threading.Lock()

    def take(self) -> tuple[int, str] | None:
        with self._lock:
            return next(self._tasks, None)


def _ask(process: subprocess.Popen[str], task: str) -> str | None:
    """Return a worker's result; None if the worker died."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(task + "\n")
        process.stdin.flush()
        answer = process.stdout.readline()
    except OSError:  # the worker has closed its end of the pipe
        return None
    return answer if answer.endswith("\n") else None


def _end(process: subprocess.Popen[str]) -> str:
    """Stop a worker if it is still running, and return how it ended."""
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        with suppress(OSError):  # data left for a dead worker
            pipe.close()
    code = process.wait()
    if code >= 0:
        return f"the worker exited with status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = " (out of memory?)" if name == "SIGKILL" else ""
    return f"the worker was ended by {name}{hint}"
