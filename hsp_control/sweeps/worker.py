"""A worker process: reads tasks, a line each, and writes results, a line each."""

import os
import queue
import signal
import sys
import threading
import warnings

from hsp_control.sweeps.running import run_task

READY = "ready"
"""The first line that a worker writes: it has imported all that it needs."""


def main() -> None:
    """Serve until the standard input ends, which it does when the parent dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    # What anything prints must not come between the results.
    results = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # A run that diverges overflows on its way; its row says so.
    warnings.simplefilter("ignore", RuntimeWarning)
    tasks: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    print(READY, file=results, flush=True)
    while True:
        print(run_task(tasks.get()), file=results, flush=True)


def _listen(tasks: "queue.SimpleQueue[str]") -> None:
    """Pass tasks on; leave in the middle of a run when nobody waits for it any more."""
    for line in sys.stdin:
        tasks.put(line)
    os._exit(0)
