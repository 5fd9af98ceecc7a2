"""Runs cases in another process, so that a crash or a hang is a result, too.

A case is a function of (seed, index): the parent sends both, the process makes the case
and answers with one line. A process that dies is replaced.
"""

import faulthandler
import importlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, Self

MEMORY = 12_000_000_000
"""Address space of a worker [bytes]: larger allocations fail."""


class Answer(NamedTuple):
    """The outcome of a case.

    Attributes:
        index: The case's number.
        kind: ``fine``, ``refused`` (one clear error), or a failure:
            ``traceback``, ``unclear``, ``crash``, ``hang``.
        text: The error, or the failure.
        seconds: Its duration [s].
    """

    index: int
    kind: str
    text: str
    seconds: float

    @property
    def good(self) -> bool:
        """Whether the outcome is acceptable."""
        return self.kind in ("fine", "refused")


class Worker:
    """A process that runs cases one by one."""

    def __init__(self, function: str, timeout: float) -> None:
        """Name the function, ``package.module:function``, and the time of a case [s].

        The first case of a process gets a minute more: it imports and compiles.
        """
        self._function, self._timeout = function, timeout
        self._process: subprocess.Popen[bytes] | None = None
        self._first = True
        self._trace = tempfile.TemporaryFile()  # noqa: SIM115

    def ask(self, seed: int, index: int) -> Answer:
        """Return the outcome of a case."""
        process = self._process or self._start()
        assert process.stdin is not None
        start = time.monotonic()
        process.stdin.write(json.dumps([seed, index]).encode() + b"\n")
        process.stdin.flush()
        line = self._line(process, start + self._timeout + 60.0 * self._first)
        self._first = False
        seconds = time.monotonic() - start
        if line is None:
            process.send_signal(signal.SIGUSR1)  # reports its stack
            time.sleep(0.5)
            self.close()
            self._trace.seek(0)
            where = self._trace.read().decode(errors="replace")[-3000:]
            text = f"not over after {seconds:.0f} s:\n{where}"
            return Answer(index, "hang", text, seconds)
        if not line:
            code = process.wait()
            self.close()
            name = signal.Signals(-code).name if code < 0 else f"status {code}"
            self._trace.seek(0)
            where = self._trace.read().decode(errors="replace")[-3000:]
            return Answer(index, "crash", f"{where}{name}", seconds)
        kind, text = json.loads(line)
        return Answer(index, kind, text, seconds)

    def answers(self, seed: int, indices: range) -> Iterator[Answer]:
        """Yield the answers to many cases."""
        for index in indices:
            yield self.ask(seed, index)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
            self._process = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        self._trace.close()

    def _start(self) -> subprocess.Popen[bytes]:
        root = Path(__file__).resolve().parents[2]
        paths = [str(root), str(root / "tests"), os.environ.get("PYTHONPATH", "")]
        self._first = True
        self._trace.truncate(0)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "campaigns.worker", self._function],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._trace,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        )
        return self._process

    @staticmethod
    def _line(process: subprocess.Popen[bytes], until: float) -> bytes | None:
        """Return a line, nothing at the end of the stream, None when time is up."""
        assert process.stdout is not None
        descriptor, received = process.stdout.fileno(), b""
        while not received.endswith(b"\n"):
            left = until - time.monotonic()
            if left <= 0.0 or not select.select([descriptor], [], [], left)[0]:
                return None
            part = os.read(descriptor, 1 << 16)
            if not part:
                return b""
            received += part
        return received


def serve(name: str) -> None:
    """Answer cases on standard input until it ends."""
    module, _, function = name.partition(":")
    case: Any = getattr(importlib.import_module(module), function)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # output of native code is no answer
    faulthandler.register(signal.SIGUSR1)
    faulthandler.enable()
    for line in sys.stdin.buffer:
        seed, index = json.loads(line)
        answers.write(json.dumps(case(seed, index)).encode() + b"\n")


if __name__ == "__main__":
    serve(sys.argv[1])
