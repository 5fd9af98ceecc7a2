"""Where commands print: answers to standard output, progress to standard error."""

import sys

from rich.console import Console

_LONGEST = 1500


def told(error: Exception) -> str:
    """Return an error's message, cut where it shows very long data."""
    text = str(error)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


# A pipe or a file has no width of its own: tables then need not be squeezed.
out = Console(
    highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160
)
errors = Console(stderr=True, highlight=False)
