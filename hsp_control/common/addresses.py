"""Addresses ``NAME?KEY=VALUE&KEY=VALUE``, as a command line takes them."""

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
