"""Where commands print: results to standard output, progress to standard error."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from hsp_control.control.first_state import StartWarning
from hsp_control.simulation.simulate import RunWarning

_LONGEST = 1500


def message_of(error: Exception) -> str:
    """Return an error's message, cut if it contains very long data."""
    text = str(error)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


# A pipe or a file has no width: tables are then printed in full width.
out = Console(
    highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160
)
errors = Console(stderr=True, highlight=False)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show the present activity and its duration on a terminal."""
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(
        *columns,
        console=errors,
        transient=True,
        disable=not errors.is_terminal,
        redirect_stdout=False,
    ) as progress:
        progress.add_task(f"{escape(what)} ...", total=None)
        yield


@contextmanager
def warnings_printed() -> Iterator[None]:
    """Print warnings of this package as lines on standard error, each one once."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", StartWarning)
        warnings.simplefilter("always", RunWarning)
        show_other, printed = warnings.showwarning, set[str]()

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if not issubclass(category, StartWarning | RunWarning):
                show_other(message, category, filename, lineno, file, line)
            elif str(message) not in printed:
                printed.add(str(message))
                print(f"hsp: {message}", file=sys.stderr)

        warnings.showwarning = show
        yield
