"""The key that somebody must hold while a page steers a robot.

The page says every 50 ms that it is held. Whoever lets go, closes the page, hides it or
loses the network says nothing more, and the robot stops.
"""

from collections.abc import Callable
from time import monotonic

TIMEOUT = 0.5  # silence after which the key counts as released [s]


class DeadMansKey:
    """Whether the key is held."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        """Begin with a key that is not held."""
        self._clock = clock
        self._until = -float("inf")

    def hear(self, *, held: bool) -> None:
        """Note what the page says of it."""
        self._until = self._clock() + TIMEOUT if held else -float("inf")

    @property
    def held(self) -> bool:
        """Whether it is held now."""
        return self._clock() < self._until
