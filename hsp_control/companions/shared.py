"""Code that several companions share, and the core does not need."""

from collections.abc import Mapping
from math import inf
from urllib.parse import unquote


def name_and_options(address: str) -> tuple[str, dict[str, str]]:
    """Return the name and the options of an address without its ``scheme://``.

    ``%26`` stands for ``&`` in a value, and so on; ``+`` is a plus.
    """
    name, _, query = address.partition("?")
    options: dict[str, str] = {}
    for part in filter(None, query.split("&")):
        key, separator, value = part.partition("=")
        key = unquote(key)
        if not (key and separator):
            raise ValueError("needs options KEY=VALUE&...")
        if key in options:
            raise ValueError(f"the option {key!r} is given twice")
        options[key] = unquote(value)
    return name, options


class Rate:
    """Reports when something is due that is sent at a rate, once a period of a loop.

    The mean rate is exact even if the loop's period does not divide its own.
    """

    def __init__(self, rate: float) -> None:
        """``rate`` is how often it is due [Hz]."""
        self._every, self._next, self._last = 1.0 / rate, -inf, -inf

    def due(self, t: float) -> bool:
        """Return whether it is due at a time [s]; an earlier one is a new run's."""
        if t < self._last:
            self._next = -inf
        self._last = t
        if t < self._next - 1e-9:
            return False
        following = self._next + self._every
        # Missed times are skipped.
        self._next = following if following > t else t + self._every
        return True


def rate_of(options: Mapping[str, str]) -> float:
    """Return the option ``rate``, how often something is sent [Hz]; 100 by default."""
    text = options.get("rate", "100")
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0.0 < rate <= 10_000.0:
        raise ValueError(
            f"the rate is {text!r}; needs a number above 0, at most 10000 Hz"
        )
    return rate
