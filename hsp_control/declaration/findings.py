"""Find the mistakes that the user made in pydantic's list of errors.

Pydantic reports a wrong value once for every alternative of a union, under a path that
contains the alternatives' names. It reports a misspelt key twice, as unknown and as
missing. This module follows errors and schema together, from the top, and returns one
finding for one mistake, under the key path that the user wrote.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

from pydantic_core import ErrorDetails

from hsp_control.common.suggestions import nearest
from hsp_control.declaration.keys import KeyPath
from hsp_control.declaration.schema import Shape, entry, keys, shape, tagged

Pending: TypeAlias = tuple[KeyPath, ErrorDetails]
"""The remaining part of an error's path, and the error."""


_KINDS = {
    "unexpected_keyword_argument": "extra_forbidden",  # of a part
    "missing_argument": "missing",
}


class Source(Protocol):
    """Where the checked data come from."""

    def __contains__(self, path: KeyPath) -> bool:
        """Say whether there is a value at the key path."""

    def mark(self, path: KeyPath) -> tuple[int, ...] | None:
        """Return the place of a key path in the text, None if there is no text."""


class Finding(NamedTuple):
    """One mistake."""

    # the key path that the user wrote; for a missing key, that of the mapping without
    # it
    path: KeyPath
    # ``mismatch`` for a wrong type, ``misspelt_tag`` for a misspelt discriminator key,
    # otherwise pydantic's name for the error
    kind: str
    value: Any  # the wrong value or key; for missing keys, their list
    expected: Shape  # the allowed types there; for keys, those of their mapping
    error: ErrorDetails  # pydantic's own error


def findings(
    document: Source, expected: Shape, errors: Sequence[Pending], path: KeyPath = ()
) -> list[Finding]:
    """Return one finding for each mistake at ``path`` or below it."""
    found = [_here(path, expected, error) for ahead, error in errors if not ahead]
    below: dict[str | int, list[Pending]] = defaultdict(list)
    for ahead, error in errors:
        if ahead:
            below[ahead[0]].append((ahead[1:], error))
    if expected.discriminator is not None:
        choices = tagged(expected.options, expected.discriminator)
        for tag, inner in below.items():
            chosen = shape(choices.get(tag, Any))._replace(tag=expected.discriminator)
            found += findings(document, chosen, inner, path)
        return found
    if len(expected.options) == 1:
        for key, inner in below.items():
            found += _at_key(document, expected, inner, path, key)
        return _gathered(found, path)
    # Below a union, pydantic labels the alternatives with its own names. All of them
    # failed, so all of them are in the list, in their order.
    known = len(below) == len(expected.options)
    options = expected.options if known else [Any] * len(below)
    tries = [
        findings(document, shape(option), inner, path)
        for option, inner in zip(options, below.values(), strict=True)
    ]
    return found + (_most_likely(document, tries, path) if tries else [])


def _here(path: KeyPath, expected: Shape, error: ErrorDetails) -> Finding:
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
    return Finding(path, kind, value, expected, error)


def _not_a_list(error: ErrorDetails) -> bool:
    if error["type"] == "is_instance_of":
        return bool(error["ctx"]["class"] == "Sequence")
    return error["type"] == "sequence_str"


def _at_key(
    document: Source,
    holder: Shape,
    errors: Sequence[Pending],
    path: KeyPath,
    key: str | int,
) -> list[Finding]:
    """Return the findings at one key of the value at ``path``, which is not a union."""
    found: list[Finding] = []
    deeper: list[Pending] = []
    for ahead, error in errors:
        kind = _KINDS.get(error["type"], error["type"])
        if ahead == ("[key]",):
            found.append(Finding((*path, key), "key", key, shape(Any), error))
        elif ahead or kind not in ("extra_forbidden", "missing"):
            deeper.append((ahead, error))
        elif kind == "extra_forbidden":
            found.append(Finding((*path, key), kind, key, holder, error))
        elif isinstance(key, int):  # a tuple without its last entries
            found.append(Finding(path, "too_short", error["input"], holder, error))
        else:
            found.append(Finding(path, kind, [key], holder, error))
    if path and getattr(holder.options[0], "yaml_key", None) == key:  # the key itself
        return found + [Finding(path, "key", path[-1], holder, e) for _, e in deeper]
    within = entry(holder.options[0], key)
    if within is None and (*path, key) not in document:  # a label of pydantic
        return found + findings(document, shape(Any), deeper, path)
    return found + findings(document, within or shape(Any), deeper, (*path, key))


def _gathered(found: list[Finding], path: KeyPath) -> list[Finding]:
    """Join the keys missing at ``path`` in one finding, without misspelt ones."""
    missing = [f for f in found if f.kind == "missing" and f.path == path]
    others = [f for f in found if f.kind != "missing" or f.path != path]
    unknown = [f for f in found if f.kind == "extra_forbidden" and f.path[:-1] == path]
    misspelt = {nearest(f.value, keys(f.expected)) for f in unknown}
    names = [name for f in missing for name in f.value if name not in misspelt]
    return [*others, missing[0]._replace(value=names)] if names else others


def _most_likely(
    document: Source, tries: list[list[Finding]], path: KeyPath
) -> list[Finding]:
    """Return the findings of the alternative that the user most likely meant.

    It is the alternative whose outer type is right, with the fewest mistakes inside. If
    several are equally likely, it is the one whose first mistake is furthest down in
    the text. If all of them fail at the same value, that value has none of the expected
    types; if at the same key, none of them has it.
    """

    def unlikeliness(found: list[Finding]) -> tuple[bool, int]:
        return any(f.path == path and _misfit(f) for f in found), len(found)

    lowest = min(map(unlikeliness, tries))
    likely = [found for found in tries if unlikeliness(found) == lowest]
    first = likely[0][0]
    options = tuple(o for found in likely for o in found[0].expected.options)
    if len(likely) > 1 and all(found[0].path == first.path for found in likely):
        if all(found[0].kind == "extra_forbidden" for found in likely):
            return [first._replace(expected=Shape(options))]
        if all(len(found) == 1 and _misfit(found[0]) for found in likely):
            return [first._replace(kind="mismatch", expected=Shape(options))]
    return max(likely, key=lambda found: document.mark(found[0].path) or (0, 0))


def _misfit(finding: Finding) -> bool:
    return finding.kind in ("mismatch", "literal_error", "enum")
