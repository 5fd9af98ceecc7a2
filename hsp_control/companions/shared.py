"""Code that several companions share, and the core does not need."""

from collections.abc import Callable, Mapping
from importlib import import_module
from math import inf
from typing import Any
from urllib.parse import unquote


def at_first_use(
    package: str, names: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return a package's ``__getattr__`` and ``__dir__``: names are imported when used.

    Args:
        package: Its ``__name__``.
        names: Its modules with their public names, between spaces.
    """
    homes = {name: module for module, there in names.items() for name in there.split()}

    def attribute(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return attribute, lambda: sorted(homes)


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
