"""Says that kernels are being compiled, which takes a while once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from rich.console import Console
from rich.errors import LiveError

from hsp_control.common import kernels


@contextmanager
def compiling_told(tell: Callable[[str], object]) -> Iterator[None]:
    """Tell how many kernels are compiled, at the beginning and the end of each."""
    done = 0

    def tell_it() -> None:
        tell(f"Compiling kernels (once, 10 to 20 s) ... {done} done")

    @contextmanager
    def told() -> Iterator[None]:
        nonlocal done
        tell_it()
        try:
            yield
        finally:
            done += 1
            tell_it()

    with kernels.watched(told):
        yield


@contextmanager
def compiling_shown(console: Console) -> Iterator[None]:
    """Show a line with the number of compiled kernels for as long as it takes."""
    status = console.status("")
    depth = 0

    @contextmanager
    def shown() -> Iterator[None]:  # a kernel is compiled within its caller
        nonlocal depth
        if not depth:
            with suppress(LiveError):  # a progress bar is already there
                status.start()
        depth += 1
        try:
            yield
        finally:
            depth -= 1
            if not depth:
                status.stop()

    with compiling_told(status.update), kernels.watched(shown):
        yield
