"""Run the command line in this process, and classify its result."""

import io
import signal
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from types import FrameType
from typing import Any

from hsp_control.cli import commands, consoles, main
from hsp_control.cli.interrupts import DeferredInterrupt

LONGEST = 2000
"""Length of a message above which it is no clear error [characters]."""


def ask(arguments: Sequence[str], *, stop_after: float | None = None) -> list[str]:
    """Run ``hsp`` and return [kind, text], as `worker.Answer` has them.

    Args:
        arguments: The command line.
        stop_after: Press Ctrl-C after this many seconds, as a user would in a long run;
        it must then end by itself.
    """
    out, errors = io.StringIO(), io.StringIO()
    try:
        with _consoles(out, errors), _ctrl_c(stop_after):
            status = main(list(arguments))
    except SystemExit as error:
        return ["unclear", f"SystemExit({error.code}): {errors.getvalue()}"]
    except BaseException:
        return ["traceback", traceback.format_exc()]
    return judge(status, errors.getvalue())


def judge(status: int, errors: str) -> list[str]:
    """Return [kind, text] for an exit status and the output on stderr."""
    if "Traceback" in errors:
        return ["traceback", errors]
    if status == 0:
        return ["fine", ""]
    reported = [line for line in errors.splitlines() if line.startswith("hsp: ")]
    stopped = status == 130 and "hsp: stopped by the user" in errors
    refused = status == 2 or stopped
    if not refused or not reported or not errors.startswith("hsp: "):
        return ["unclear", f"status {status}: {errors}"]
    if len(errors) > LONGEST or len(reported) > 2:
        return ["unclear", f"{len(errors)} characters: {errors[:LONGEST]}"]
    return ["refused", reported[0].removeprefix("hsp: ")]


@contextmanager
def _consoles(out: io.StringIO, errors: io.StringIO) -> Iterator[None]:
    console: Any = consoles.out
    before = console.file
    with redirect_stdout(out), redirect_stderr(errors):
        console.file = out
        try:
            yield
        finally:
            console.file = before


@contextmanager
def _ctrl_c(after: float | None) -> Iterator[None]:
    if after is None:
        yield
        return

    def press(_: int, __: FrameType | None) -> None:
        # Before the run begins `hsp` would simply end; this process must not.
        if isinstance(
            getattr(signal.getsignal(signal.SIGINT), "__self__", None),
            DeferredInterrupt,
        ):
            signal.raise_signal(signal.SIGINT)

    kept = signal.signal(signal.SIGALRM, press)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, after, 0.1)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, kept)
        signal.signal(signal.SIGINT, handler)


assert commands  # imported now, so that the first case need not wait for it
