"""The scalars of YAML 1.2: how they are recognised, and what they become.

PyYAML speaks YAML 1.1, where ``1e-3`` is a text, ``on`` is true, ``010`` is eight and
``1:30`` is ninety; here they are what they look like.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

TAG = "tag:yaml.org,2002:"


class Scalar(NamedTuple):
    """One kind of scalar.

    Attributes:
        name: What it is called in messages.
        convert: From its text to its value; a ValueError if that is impossible.
        pattern: What it looks like without quotes, if it can be told from a text.
        first: The characters that it can begin with; an empty one: it can be empty.
    """

    name: str
    convert: Callable[[str], Any]
    pattern: str | None = None
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
    text.encode()  # refuses half a character, as in "\ud800"
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
        "an integer of 64 bits",
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
"""Every scalar that a file may hold, by tag."""
