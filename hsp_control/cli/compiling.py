"""Says that kernels are being compiled, which takes a while once."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from rich.console import Console
from rich.errors import LiveError

from hsp_control.common import kernels


@contextmanager
def compiling_shown(console: Console) -> Iterator[None]:
    """Show a line with the number of compiled kernels for as long as it takes.

    Args:
        console: Where to show it; only a terminal shows it.
    """
    status = console.status("")
    done = 0

    @contextmanager
    def shown() -> Iterator[None]:
        nonlocal done
        status.update(f"Compiling kernels (once, 10 to 20 s) ... {done} done")
        with suppress(LiveError):  # a progress bar is already there
            status.start()
        try:
            yield
        finally:
            status.stop()
            done += 1

    with kernels.watched(shown):
        yield
