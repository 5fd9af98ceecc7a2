"""Where commands print: answers to standard output, progress to standard error."""

import sys

from rich.console import Console

# A pipe or a file has no width of its own: tables then need not be squeezed.
out = Console(
    highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160
)
errors = Console(stderr=True, highlight=False)
