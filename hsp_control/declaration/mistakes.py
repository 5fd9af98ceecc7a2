"""The user's mistakes, found in pydantic's list of errors, in the package's words.

Pydantic reports a wrong value once for every alternative of a union, under a path that
contains the alternatives' names. It reports a misspelt key twice, as unknown and as
missing. This module follows errors and schema together, from the top, and finds one
mistake per value, under the key path that the user wrote.
"""

import dataclasses
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias, get_args, get_origin

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hsp_control.common.errors import HspControlError
from hsp_control.common.suggestions import did_you_mean, listing, nearest
from hsp_control.declaration.families import Declared
from hsp_control.declaration.language import joined, kind, misfit, shown, spoken
from hsp_control.declaration.located import KeyPath, written
from hsp_control.declaration.misplaced import home_of, relatives_with
from hsp_control.declaration.plain_data import plain_data
from hsp_control.declaration.schema import (
    ValueTypes,
    entry,
    is_model,
    keys,
    literals,
    shape,
    tagged,
)

Pending: TypeAlias = tuple[KeyPath, ErrorDetails]
"""The remaining part of an error's path, and the error."""


_KINDS = {
    "unexpected_keyword_argument": "extra_forbidden",  # of a part
    "missing_argument": "missing",
}


class CheckedSource(Protocol):
    """The source of the checked data."""

    def __contains__(self, path: KeyPath) -> bool:
        """Return whether there is a value at the key path."""

    def mark(self, path: KeyPath) -> tuple[int, ...] | None:
        """Return the place of a key path in the text, None if there is no text."""


class Mistake(NamedTuple):
    """One mistake."""

    # the key path that the user wrote; for a missing key, that of the mapping without
    # it
    path: KeyPath
    # ``mismatch`` for a wrong type, ``misspelt_tag`` for a misspelt discriminator key,
    # otherwise pydantic's name for the error
    kind: str
    value: Any  # the wrong value or key; for missing keys, their list
    expected: ValueTypes  # the allowed types there; for keys, those of their mapping
    error: ErrorDetails  # pydantic's own error
    # for an unknown key: of each mapping around its own one, from the root on
    above: tuple[ValueTypes, ...] = ()


def findings(
    document: CheckedSource,
    expected: ValueTypes,
    errors: Sequence[Pending],
    path: KeyPath = (),
    above: tuple[ValueTypes, ...] = (),
) -> list[Mistake]:
    """Return one finding per mistake at ``path`` or below it.

    ``above`` has what each mapping around the value is.
    """
    found = [_here(path, expected, error) for ahead, error in errors if not ahead]
    below: dict[str | int, list[Pending]] = defaultdict(list)
    for ahead, error in errors:
        if ahead:
            below[ahead[0]].append((ahead[1:], error))
    if expected.discriminator is not None:
        choices = tagged(expected.options, expected.discriminator)
        for tag, inner in below.items():
            chosen = shape(choices.get(tag, Any))._replace(tag=expected.discriminator)
            found += findings(document, chosen, inner, path, above)
        return found
    if len(expected.options) == 1:
        for key, inner in below.items():
            found += _at_key(document, expected, inner, path, key, above)
        return _gathered(found, path)
    # Below a union, pydantic labels the alternatives with its own names. All of them
    # failed, so all of them are in the list, in their order.
    known = len(below) == len(expected.options)
    options = expected.options if known else [Any] * len(below)
    tries = [
        findings(document, shape(option), inner, path, above)
        for option, inner in zip(options, below.values(), strict=True)
    ]
    return found + (_most_likely(document, tries, path) if tries else [])


def _here(path: KeyPath, expected: ValueTypes, error: ErrorDetails) -> Mistake:
    """Return the finding for an error of the value at ``path`` itself."""
    kind, value = error["type"], error["input"]
    if kind.endswith(("_type", "_parsing", "_from_float")) or _not_a_list(error):
        kind = "mismatch"
    if kind in ("extra_forbidden", "missing"):  # its key is not known
        kind = "other"
    tag = expected.discriminator
    if tag is not None and isinstance(value, dict):
        unknown = [name for name in value if name not in keys(expected)]
        if kind == "union_tag_invalid":
            path, value = (*path, tag), value[tag]
        elif kind == "union_tag_not_found" and (misspelt := nearest(tag, unknown)):
            path, kind, value = (*path, misspelt), "misspelt_tag", misspelt
    return Mistake(path, kind, value, expected, error)


def _not_a_list(error: ErrorDetails) -> bool:
    if error["type"] == "is_instance_of":
        return bool(error["ctx"]["class"] == "Sequence")
    return error["type"] == "sequence_str"


def _at_key(
    document: CheckedSource,
    holder: ValueTypes,
    errors: Sequence[Pending],
    path: KeyPath,
    key: str | int,
    above: tuple[ValueTypes, ...],
) -> list[Mistake]:
    """Return the findings at one key of the value at ``path``, which is not a union."""
    found: list[Mistake] = []
    deeper: list[Pending] = []
    for ahead, error in errors:
        kind = _KINDS.get(error["type"], error["type"])
        if ahead == ("[key]",):
            found.append(Mistake((*path, key), "key", key, shape(Any), error))
        elif ahead or kind not in ("extra_forbidden", "missing"):
            deeper.append((ahead, error))
        elif kind == "extra_forbidden":
            found.append(Mistake((*path, key), kind, key, holder, error, above))
        elif isinstance(key, int):  # a tuple without its last entries
            found.append(Mistake(path, "too_short", error["input"], holder, error))
        else:
            found.append(Mistake(path, kind, [key], holder, error))
    if path and getattr(holder.options[0], "yaml_key", None) == key:  # the key itself
        return found + [Mistake(path, "key", path[-1], holder, e) for _, e in deeper]
    within = entry(holder.options[0], key)
    if within is None and (*path, key) not in document:  # a label of pydantic
        return found + findings(document, shape(Any), deeper, path, above)
    inside = (*above, holder)
    return found + findings(
        document, within or shape(Any), deeper, (*path, key), inside
    )


def _gathered(found: list[Mistake], path: KeyPath) -> list[Mistake]:
    """Join the keys missing at ``path`` in one finding, without misspelt ones."""
    missing = [f for f in found if f.kind == "missing" and f.path == path]
    others = [f for f in found if f.kind != "missing" or f.path != path]
    unknown = [f for f in found if f.kind == "extra_forbidden" and f.path[:-1] == path]
    misspelt = {nearest(f.value, keys(f.expected)) for f in unknown}
    names = [name for f in missing for name in f.value if name not in misspelt]
    return [*others, missing[0]._replace(value=names)] if names else others


def _most_likely(
    document: CheckedSource, tries: list[list[Mistake]], path: KeyPath
) -> list[Mistake]:
    """Return the findings of the alternative that the user most likely meant.

    It is the alternative whose outer type is right, with the fewest mistakes inside. If
    several are equally likely, it is the one whose first mistake is furthest down in
    the text. If all of them fail at the same value, that value has none of the expected
    types; if at the same key, none of them has it.
    """

    def unlikeliness(found: list[Mistake]) -> tuple[bool, int]:
        return any(f.path == path and _misfit(f) for f in found), len(found)

    lowest = min(map(unlikeliness, tries))
    likely = [found for found in tries if unlikeliness(found) == lowest]
    first = likely[0][0]
    options = tuple(o for found in likely for o in found[0].expected.options)
    if len(likely) > 1 and all(found[0].path == first.path for found in likely):
        if all(found[0].kind == "extra_forbidden" for found in likely):
            return [first._replace(expected=ValueTypes(options))]
        if all(len(found) == 1 and _misfit(found[0]) for found in likely):
            return [first._replace(kind="mismatch", expected=ValueTypes(options))]
    return max(likely, key=lambda found: document.mark(found[0].path) or (0, 0))


def _misfit(finding: Mistake) -> bool:
    return finding.kind in ("mismatch", "literal_error", "enum")


_SIMPLE = {  # in YAML, of several, in Python
    float: ("a number", "numbers", "a number"),
    int: ("an integer", "integers", "an int"),
    bool: ("true or false", "booleans", "True or False"),
    str: ("text", "texts", "a str"),
    Path: ("a path", "paths", "a path"),
}
_COMPARISONS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_ENTRIES = ("entry", "entries")
_LONG_LIST = 40


def explained(finding: Mistake, key: str = "key") -> str:
    """Return the message for a finding, without its location.

    A missing or unknown name is called ``key``.
    """
    value, expected = finding.value, finding.expected
    match finding.kind:
        case "mismatch" if words := joined(_words(expected)):
            return _mismatch(value, words, expected)
        case "extra_forbidden":
            home = relatives_with(str(value), expected)
            home = home or home_of(finding.path, [*finding.above, expected])
            return f"unknown {key} {_unknown(value, keys(expected), home)}"
        case "missing":
            return _missing(key, value, keys(expected, required=True))
        case "union_tag_invalid" if tag := expected.discriminator:
            types = list(map(str, tagged(expected.options, tag)))
            own = "; --import FILE.py imports a type of your own"
            advice = "" if _near(value, types) else spoken(own, "")
            return f"unknown {tag} {_unknown(value, types)}{advice}"
        case "union_tag_not_found" if tag := expected.discriminator:
            return f"missing key {tag!r}; {_tags(expected, tag)}"
        case "misspelt_tag" if tag := expected.discriminator:
            hint = _near(value, [tag])
            return f"unknown key {value!r}{hint} ({_tags(expected, tag)})"
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


def _unknown(value: Any, options: Iterable[Any], home: str = "") -> str:
    allowed = [str(option) for option in options]
    near = home or _near(value, allowed)
    among = f" (allowed: {listing(allowed, _LONG_LIST)})" if allowed else ""
    return f"{shown(value)}{near}{among}"


def _missing(key: str, names: list[str], required: list[str]) -> str:
    plural = "s" if len(names) > 1 else ""
    among = f"; required here: {listing(required, _LONG_LIST)}" if required else ""
    return f"missing {key}{plural} {listing(map(repr, names), _LONG_LIST)}{among}"


def _tags(expected: ValueTypes, key: str) -> str:
    tags = map(str, tagged(expected.options, key))
    return f"{key} is one of: {listing(tags, _LONG_LIST)}"


def _near(value: Any, options: Iterable[Any]) -> str:
    if not isinstance(value, str):
        return ""
    if ":" in value:
        return "; write a space after the colon"
    return did_you_mean(value, map(str, options))


def _mismatch(value: Any, words: str, expected: ValueTypes) -> str:
    if value is None:
        given = spoken("nothing given", "None")
    else:
        given = f"{shown(value)} is {kind(value)}"
    return f"{given}; expected {words}{_inside(expected)}{_meant(value, expected)}"


def _inside(expected: ValueTypes) -> str:
    """Return which keys the mapping has that is expected, if it is one part's."""
    (option, *others) = expected.options
    if others or not is_model(option) or expected.discriminator:
        return ""
    return f" of {listing(keys(expected), 6)}"


def _meant(value: Any, expected: ValueTypes) -> str:
    """Return the mapping that the user meant by a type's name, or by a bare value."""
    choices = literals(expected.options)
    if (tag := expected.discriminator) is None:
        if isinstance(value, str) and not choices and "name" in keys(expected):
            return f"; did you mean {{name: {value}}}?"
        return _near(value, choices)
    types = tagged(expected.options, tag)
    if isinstance(value, str):
        near = nearest(value, map(str, types))
        return f"; did you mean {{{tag}: {near}}}?" if near else ""
    for member in expected.options:
        try:
            part = member.of_value(value)
        except HspControlError:
            continue
        if part is not None:
            return f"; did you mean {shown(plain_data(part))}?"
    return ""


def _wrong_length(finding: Mistake) -> str:
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


def _out_of_bounds(finding: Mistake) -> str:
    symbol, words = _COMPARISONS[finding.kind]
    bound = finding.error["ctx"][symbol]
    low = symbol in ("gt", "ge")
    wrong = "too small" if low else "too large"
    minus = shown(finding.value).startswith("-") and finding.value != 0  # -0.0 is not
    if low and bound == 0 and minus:
        wrong = "negative"
    limit = f"{bound:g}" if isinstance(bound, float) else f"{bound}"
    return f"{shown(finding.value)} is {wrong}; must be {words} {limit}"


def _message_of_pydantic(finding: Mistake) -> str:
    """Return pydantic's message, with the value instead of its word "Input"."""
    value, message = shown(finding.value), finding.error["msg"]
    sentence = re.sub(r"^\w+ (?=should )", f"{value} ".replace("\\", r"\\"), message)
    return sentence if sentence != message else f"{value}: {message}"


def _words(expected: ValueTypes, *, many: bool = False) -> list[str]:
    """Return the types in plain words; an empty list if a type has no plain word."""
    found: list[str] = []
    for option in expected.options:
        inner = shape(option)
        choices = [spoken(shown(each), repr(each)) for each in literals([option])]
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
        one, several, in_python = _SIMPLE[option]
        return several if many else spoken(one, in_python)
    container = get_origin(option) or option
    if not isinstance(container, type):
        return ""
    named = [each for each in get_args(option)[1:] if hasattr(each, "family")]
    if named and issubclass(container, Mapping) and not many:  # parts by their names
        part = named[0].__name__
        return spoken("a mapping", f"several, such as [{part}(...)]")
    if is_model(container) or issubclass(container, Mapping):
        one, several = spoken("a mapping", "a dict"), spoken("mappings", "dicts")
        return several if many else one
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


def argument_error(cls: type[Declared], error: ValidationError) -> HspControlError:
    """Return the part's own error for pydantic's errors of its arguments."""
    fields = dataclasses.fields(cls)  # type: ignore[arg-type]
    names = [field.name for field in fields if not field.kw_only]
    pending = []
    for each in error.errors(include_url=False):
        path = each["loc"]
        if not path and (own := domain_error(each)):
            return type(own)(f"{cls.__name__}: {own}")
        if path and isinstance(path[0], int):  # the position of an argument
            if path[0] >= len(names):
                plural = "" if len(names) == 1 else "s"
                taken = f"{len(names)} positional argument{plural} ({', '.join(names)})"
                return cls.error(
                    f"{cls.__name__}: takes {taken if names else 'none by position'}; "
                    f"{'the others' if names else 'arguments'} are given by name"
                )
            path = (names[path[0]], *path[1:])
        pending.append((path, each))
    found = findings(_Arguments(), shape(cls), pending)
    return as_error(found[0], cls)


def as_error(finding: Mistake, cls: type[Declared]) -> HspControlError:
    """Return the error of a finding about an argument of a part."""
    where = ": ".join(part for part in (cls.__name__, written(finding.path)) if part)
    own = domain_error(finding.error)
    kind = cls.error if own is None else type(own)
    own_argument = finding.kind == "missing" and not finding.path
    if own_argument or (finding.kind == "extra_forbidden" and len(finding.path) == 1):
        return kind(f"{where}: {explained(finding, 'argument')}")
    return kind(f"{where}: {_in_python(finding) or explained(finding)}")


def _in_python(finding: Mistake) -> str:
    """Return the message where Python gave something that is no part; or nothing."""
    options = finding.expected.options
    parts = [o for o in options if isinstance(o, type) and issubclass(o, Declared)]
    nothing = literals(options) == ["none"]  # which is None in Python
    known = finding.kind in ("mismatch", "union_tag_not_found")
    if not (known and parts and len(parts) + nothing == len(options)):
        return ""
    bases = [each.family.base if each.family else each for each in parts]
    return misfit(finding.value, [*dict.fromkeys(bases), *[type(None)] * nothing])


class Carrier(ValueError):
    """Carries an error that is no `ValueError` through pydantic."""

    def __init__(self, error: HspControlError) -> None:
        super().__init__(str(error))
        self.error = error


def domain_error(error: Mapping[str, Any]) -> HspControlError | None:
    """Return the package's own error that a check raised, if it did."""
    raised = error.get("ctx", {}).get("error")
    if isinstance(raised, Carrier):
        return raised.error
    return raised if isinstance(raised, HspControlError) else None


class _Arguments:
    """The interface of a text for `findings`, for arguments that are from no text."""

    def __contains__(self, path: KeyPath) -> bool:
        return True

    def mark(self, path: KeyPath) -> None:
        """Return no line."""
