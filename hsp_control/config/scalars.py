"""The scalars of YAML 1.2: how they are recognised and converted.

PyYAML reads YAML 1.1, where ``1e-3`` is text, ``on`` is true, ``010`` is eight and
``1:30`` is ninety. In YAML 1.2 they are a number, text, ten and text.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

TAG = "tag:yaml.org,2002:"


class Scalar(NamedTuple):
    """One kind of scalar."""

    name: str  # its name in messages
    # converts its text to its value; raises ValueError if it cannot
    convert: Callable[[str], Any]
    # regular expression of its text without quotes; None if only a tag selects it
    pattern: str | None = None
    # the characters that it can begin with; an empty string if the scalar can be empty
    first: tuple[str, ...] = ()


def _null(text: str) -> None:
    return None


def _boolean(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(text)
    return text.lower() == "true"


def _integer(text: str) -> int:
    value = int(text, 0 if text.startswith(("0o", "0x")) else 10)
    if not -(2**63) <= value < 2**64:
        raise ValueError(text)
    return value


def _number(text: str) -> float:
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


def _text(text: str) -> str:
    text.encode()  # raises for half of a surrogate pair, as in "\ud800"
    return text


SCALARS = {
    TAG + "null": Scalar(
        "null",
        _null,
        pattern=r"~|null|Null|NULL|",
        first=("~", "n", "N", ""),
    ),
    TAG + "bool": Scalar(
        "true or false",
        _boolean,
        pattern=r"true|True|TRUE|false|False|FALSE",
        first=tuple("tTfF"),
    ),
    TAG + "int": Scalar(
        "a 64-bit integer",
        _integer,
        pattern=r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+",
        first=tuple("-+0123456789"),
    ),
    TAG + "float": Scalar(
        "a number",
        _number,
        pattern=r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        first=tuple("-+.0123456789"),
    ),
    TAG + "str": Scalar("text", _text),
}
"""Every scalar that is allowed in a file, by tag."""
