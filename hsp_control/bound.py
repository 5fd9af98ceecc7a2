"""What a step does, decided once: calls that know where they read and write."""

from collections.abc import Callable
from typing import NamedTuple


class Bound(NamedTuple):
    """An evaluation at whatever a state then is, taken apart into its calls.

    Asking at every step what is to be called costs as much as the small kernels do.

    Attributes:
        follow: Bring references up to a time [s].
        write: Read the state, and write.
    """

    follow: tuple[Callable[[float], object], ...] = ()
    write: tuple[Callable[[], object], ...] = ()
