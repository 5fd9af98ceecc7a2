"""Addresses ``NAME?KEY=VALUE&KEY=VALUE``, as a command line takes them."""

from collections.abc import Mapping
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


def rate_of(options: Mapping[str, str]) -> float:
    """Return the option ``rate``, how often something is told [Hz]; 100 by default."""
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
