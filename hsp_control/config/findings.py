"""From pydantic's list of errors to the mistakes that the user made.

Pydantic reports a wrong value once for every alternative of a union, under a path that
names the alternatives; and a misspelt key twice, as unknown and as missing. Walking
errors and schema together, from the top, undoes both: one finding for one mistake,
under the key path that the user wrote.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

from pydantic_core import ErrorDetails

from hsp_control.common.suggestions import nearest
from hsp_control.config.document import Document
from hsp_control.config.keys import KeyPath
from hsp_control.config.schema import Shape, entry, keys, shape, tagged

Pending: TypeAlias = tuple[KeyPath, ErrorDetails]
"""An error, and the part of its path that is still ahead."""


class Finding(NamedTuple):
    """One mistake.

    Attributes:
        path: The key path that the user wrote; for a missing key, of what lacks it.
        kind: ``mismatch`` for a wrong type, ``misspelt_tag`` for a wrong key in the
            place of a discriminator, or else pydantic's name for the error.
        value: The value or the key at fault; the list of missing keys.
        expected: What is allowed there; for keys, what holds them.
        error: Pydantic's own words and numbers.
    """

    path: KeyPath
    kind: str
    value: Any
    expected: Shape
    error: ErrorDetails


def findings(
    document: Document, expected: Shape, errors: Sequence[Pending], path: KeyPath = ()
) -> list[Finding]:
    """Return one finding for each mistake at ``path`` or below it.

    Args:
        document: What was validated.
        expected: What is allowed at ``path``.
        errors: The errors there and below.
        path: Where we stand.
    """
    found = [_here(path, expected, error) for ahead, error in errors if not ahead]
    below: dict[str | int, list[Pending]] = defaultdict(list)
    for ahead, error in errors:
        if ahead:
            below[ahead[0]].append((ahead[1:], error))
    if len(expected.options) == 1:
        for key, inner in below.items():
            found += _at_key(document, expected, inner, path, key)
        return _gathered(found, path)
    if expected.discriminator is not None:
        choices = tagged(expected.options, expected.discriminator)
        for tag, inner in below.items():
            found += findings(document, shape(choices.get(tag, Any)), inner, path)
        return found
    # Below a union, pydantic names the alternatives by labels of its own; all failed,
    # so all are there, in their order.
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
    if kind.endswith(("_type", "_parsing", "_from_float")):
        kind = "mismatch"
    if kind in ("extra_forbidden", "missing"):  # of a key that we lost sight of
        kind = "other"
    tag = expected.discriminator
    if tag is not None and isinstance(value, dict):
        unknown = [name for name in value if name not in keys(expected)]
        if kind == "union_tag_invalid":
            path, value = (*path, tag), value[tag]
        elif kind == "union_tag_not_found" and (misspelt := nearest(tag, unknown)):
            path, kind, value = (*path, misspelt), "misspelt_tag", misspelt
    return Finding(path, kind, value, expected, error)


def _at_key(
    document: Document,
    holder: Shape,
    errors: Sequence[Pending],
    path: KeyPath,
    key: str | int,
) -> list[Finding]:
    """Return the findings at one key of the value at ``path``, which is no union."""
    found: list[Finding] = []
    deeper: list[Pending] = []
    for ahead, error in errors:
        kind = error["type"]
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
    within = entry(holder.options[0], key)
    if within is None and (*path, key) not in document:  # a label of pydantic's own
        return found + findings(document, shape(Any), deeper, path)
    return found + findings(document, within or shape(Any), deeper, (*path, key))


def _gathered(found: list[Finding], path: KeyPath) -> list[Finding]:
    """Gather the keys missing at ``path``, without those that are only misspelt."""
    missing = [f for f in found if f.kind == "missing" and f.path == path]
    others = [f for f in found if f.kind != "missing" or f.path != path]
    unknown = [f for f in found if f.kind == "extra_forbidden" and f.path[:-1] == path]
    meant = {nearest(f.value, keys(f.expected)) for f in unknown}
    names = [name for f in missing for name in f.value if name not in meant]
    return [*others, missing[0]._replace(value=names)] if names else others


def _most_likely(
    document: Document, tries: list[list[Finding]], path: KeyPath
) -> list[Finding]:
    """Return what is wrong with the alternative that the user most likely meant.

    That is one whose outer form fits, with the fewest mistakes inside. Of several as
    likely it is the one that got furthest in the text; and if all stumble over the same
    value, that has none of the expected forms.
    """

    def unlikeliness(found: list[Finding]) -> tuple[bool, int]:
        return any(f.path == path and _misfit(f) for f in found), len(found)

    least = min(map(unlikeliness, tries))
    likely = [found for found in tries if unlikeliness(found) == least]
    first = likely[0][0]
    if len(likely) == 1 or not all(
        len(found) == 1 and found[0].path == first.path and _misfit(found[0])
        for found in likely
    ):
        return max(likely, key=lambda found: document.mark(found[0].path) or (0, 0))
    options = tuple(o for found in likely for o in found[0].expected.options)
    return [first._replace(kind="mismatch", expected=Shape(options))]


def _misfit(finding: Finding) -> bool:
    return finding.kind in ("mismatch", "literal_error", "enum")
