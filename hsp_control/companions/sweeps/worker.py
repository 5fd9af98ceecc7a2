"""A worker process: reads tasks and writes results, one line each."""

import os
import queue
import signal
import sys
import threading
import warnings

from hsp_control.companions.sweeps.run_task import run_task
from hsp_control.control.first_state import StartWarning

READY = "ready"
"""The first line that a worker writes, after all imports."""


def main() -> None:
    """Run tasks until the standard input ends, also because the parent died."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    # Other output must not be mixed with the results.
    results = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # A run that diverges overflows; its row contains that.
    warnings.simplefilter("ignore", RuntimeWarning)
    # The parent process has warned of this already.
    warnings.simplefilter("ignore", StartWarning)
    tasks: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    print(READY, file=results, flush=True)
    while True:
        print(run_task(tasks.get()), file=results, flush=True)


def _listen(tasks: "queue.SimpleQueue[str]") -> None:
    """Pass tasks on; end the process, even during a run, when the input ends."""
    for line in sys.stdin:
        tasks.put(line)
    os._exit(0)
