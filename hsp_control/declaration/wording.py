"""Messages: in one line what is wrong, what is allowed, and what was likely meant."""

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration.findings import Finding
from hsp_control.declaration.plain import joined, kind, shown
from hsp_control.declaration.schema import (
    Shape,
    is_model,
    keys,
    literals,
    shape,
    tagged,
)

_SIMPLE = {
    float: ("a number", "numbers"),
    int: ("an integer", "integers"),
    bool: ("true or false", "booleans"),
    str: ("text", "texts"),
    Path: ("a path", "paths"),
}
_COMPARISONS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_ENTRIES = ("entry", "entries")
_LONG_LIST = 40


def explained(finding: Finding) -> str:
    """Return the message for a finding, without its location."""
    value, expected = finding.value, finding.expected
    match finding.kind:
        case "mismatch" if words := joined(_words(expected)):
            return _mismatch(value, words, literals(expected.options))
        case "extra_forbidden":
            return f"unknown key {_unknown(value, keys(expected))}"
        case "missing":
            return _missing(value, keys(expected, required=True))
        case "union_tag_invalid" if key := expected.discriminator:
            return f"unknown {key} {_unknown(value, tagged(expected.options, key))}"
        case "union_tag_not_found" if key := expected.discriminator:
            return f"missing key {key!r}; {_tags(expected, key)}"
        case "misspelt_tag" if key := expected.discriminator:
            hint = f"did you mean {key!r}? ({_tags(expected, key)})"
            return f"unknown key {value!r}; {hint}"
        case "literal_error" | "enum" if choices := literals(expected.options):
            return f"unknown value {_unknown(value, choices)}"
        case "too_short" | "too_long" | "string_too_short" | "string_too_long":
            return _wrong_length(finding)
        case "finite_number":
            return f"{shown(value)} is not a finite number"
        case comparison if comparison in _COMPARISONS:
            return _out_of_bounds(finding)
        case "value_error" | "assertion_error":
            return str(finding.error["ctx"]["error"])
        case "key":
            return f"the key {_message_of_pydantic(finding)}"
    return _message_of_pydantic(finding)


def _unknown(value: Any, options: Iterable[Any]) -> str:
    allowed = [str(option) for option in options]
    near = _near(value, allowed)
    among = f" (allowed: {listing(allowed, _LONG_LIST)})" if allowed else ""
    return f"{shown(value)}{near}{among}"


def _missing(names: list[str], required: list[str]) -> str:
    plural = "s" if len(names) > 1 else ""
    among = f"; required here: {listing(required, _LONG_LIST)}" if required else ""
    return f"missing key{plural} {listing(map(repr, names), _LONG_LIST)}{among}"


def _tags(expected: Shape, key: str) -> str:
    tags = map(str, tagged(expected.options, key))
    return f"{key} is one of: {listing(tags, _LONG_LIST)}"


def _near(value: Any, options: Iterable[Any]) -> str:
    return did_you_mean(value, map(str, options)) if isinstance(value, str) else ""


def _mismatch(value: Any, words: str, choices: list[Any]) -> str:
    given = "nothing given" if value is None else f"{shown(value)} is {kind(value)}"
    return f"{given}; expected {words}{_near(value, choices)}"


def _wrong_length(finding: Finding) -> str:
    value, (fewest, most) = finding.value, finding.expected.bounds()
    count = len(value)
    units = ("character", "characters") if isinstance(value, str) else _ENTRIES
    if fewest == most:
        needs = f"{fewest}"
    elif count < fewest:
        needs = f"at least {fewest}"
    elif most is not None:
        needs = f"at most {most}"
    else:
        return _message_of_pydantic(finding)
    return f"{shown(value)} has {count} {units[count != 1]}, needs {needs}"


def _out_of_bounds(finding: Finding) -> str:
    symbol, words = _COMPARISONS[finding.kind]
    bound = finding.error["ctx"][symbol]
    low = symbol in ("gt", "ge")
    wrong = "too small" if low else "too large"
    if low and bound == 0 and shown(finding.value).startswith("-"):
        wrong = "negative"
    limit = f"{bound:g}" if isinstance(bound, float) else f"{bound}"
    return f"{shown(finding.value)} is {wrong}; must be {words} {limit}"


def _message_of_pydantic(finding: Finding) -> str:
    """Return pydantic's message, with the value instead of its word "Input"."""
    value, message = shown(finding.value), finding.error["msg"]
    sentence = re.sub(r"^\w+ (?=should )", f"{value} ".replace("\\", r"\\"), message)
    return sentence if sentence != message else f"{value}: {message}"


def _words(expected: Shape, *, many: bool = False) -> list[str]:
    """Return the types in plain words; an empty list if a type has no plain word."""
    found: list[str] = []
    for option in expected.options:
        inner = shape(option)
        choices = [shown(choice) for choice in literals([option])]
        if inner.options != (option,):  # an alias, or ``Annotated``
            words = _words(inner, many=many)
        else:
            words = choices or [_word(option, expected.bounds(), many=many)]
        if not (words and all(words)):
            return []
        found += [word for word in words if word not in found]
    return found


def _word(option: Any, bounds: tuple[int, int | None], *, many: bool) -> str:
    if option in _SIMPLE:
        return _SIMPLE[option][many]
    container = get_origin(option) or option
    if not isinstance(container, type):
        return ""
    if is_model(container) or issubclass(container, Mapping):
        return "mappings" if many else "a mapping"
    if issubclass(container, Collection):
        return _list(option, bounds, many=many)
    return ""


def _list(option: Any, bounds: tuple[int, int | None], *, many: bool) -> str:
    items = [shape(item) for item in get_args(option) if item is not Ellipsis]
    words = joined(_words(items[0], many=True)) if items else ""
    if words in ("lists of numbers", "lists of integers"):
        return "matrices" if many else "a matrix"
    fewest, most = bounds
    number = f"{fewest} " if fewest == most else ""
    return f"{'lists' if many else 'a list'} of {number}{words or 'values'}"
