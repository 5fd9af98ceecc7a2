"""Check a document against its schema, and report all mistakes in one error."""

from functools import reduce
from operator import getitem
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from hsp_control.common.exceptions import HspControlError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.config.document import Document
from hsp_control.declaration import Part
from hsp_control.declaration.located import locate
from hsp_control.declaration.mistakes import (
    Mistake,
    domain_error,
    explained,
    findings,
)
from hsp_control.declaration.schema import shape

Value = TypeVar("Value", bound=Part)

_OTHERS = 5


def validate(document: Document, part: type[Value]) -> Value:
    """Return the document as a part; an error names up to six mistakes in order."""
    with document.reading():
        try:
            return TypeAdapter(part).validate_python(document.to_dict())
        except ValidationError as error:
            pending = [(each["loc"], each) for each in error.errors(include_url=False)]
            found = findings(document, shape(part), pending)
        raise _summary(document, sorted(found, key=lambda f: _order(document, f)))


def _order(document: Document, finding: Mistake) -> tuple[bool, tuple[int, ...]]:
    """Return the sort key of a finding: its place in the file, overrides last."""
    mark = document.mark(finding.path)
    return mark is None, tuple(mark or ())


def _error(document: Document, finding: Mistake) -> HspControlError:
    """Return the error of a finding; one that a part raised keeps its class."""
    own = domain_error(finding.error)
    if own is None:
        message, (*holder, key) = explained(finding), finding.path or ("",)
        if finding.kind == "union_tag_not_found" and isinstance(key, str):
            beside = reduce(getitem, holder, document.to_dict())  # type: ignore[arg-type]
            message += did_you_mean(key, [name for name in beside if name != key])
        return document.error(finding.path, message)
    path = (*finding.path, *own.path)
    error = type(own)(own.bare_message)
    locate(error, document.location(path), path)
    return error


def _summary(document: Document, found: list[Mistake]) -> HspControlError:
    errors = [_error(document, finding) for finding in found]
    messages = list(dict.fromkeys(str(error) for error in errors))
    first, others = errors[0], messages[1:]
    if others:
        lines = [f"{first}\nand {len(others)} more:", *others[:_OTHERS]]
        if len(others) > _OTHERS:
            lines.append(f"... ({len(others) - _OTHERS} not shown)")
        first.args = ("\n  ".join(lines),)
    return first
