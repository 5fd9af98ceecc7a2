"""Key paths: the place of a value in a configuration, as the user writes it."""

import re
from typing import TypeAlias

from hsp_control.declaration.language import shortened

KeyPath: TypeAlias = tuple[str | int, ...]

_QUOTED = r"'[^']*'|\"[^\"]*\""
_PART = rf"(?:{_QUOTED}|[^.='\"]+)"
_ASSIGNMENT = re.compile(rf"({_PART}(?:\.{_PART})*)=(.*)", re.DOTALL)
_NEEDS_QUOTES = re.compile(r"[\s.=:'\"]")


def written(path: KeyPath) -> str:
    """Return the path with dots between its parts: ``tasks.0.gains.kp``.

    Parts that are empty or contain a dot or a space are quoted. Long parts are cut.
    """
    return ".".join(_written_part(part) for part in path)


def split_assignment(assignment: str) -> tuple[list[str], str]:
    """Split ``tasks.0.gain=5`` into its keys and the text of its value."""
    match = _ASSIGNMENT.fullmatch(assignment)
    if match is None:
        raise ValueError("needs the form key=value, for example tasks.0.gains.kp=100")
    keys, value = match.groups()
    parts = [part.strip() for part in re.findall(_PART, keys)]
    return [part[1:-1] if part[:1] in ("'", '"') else part for part in parts], value


def _written_part(part: str | int) -> str:
    if isinstance(part, int):
        return str(part)
    if part and part.isprintable() and not _NEEDS_QUOTES.search(part):
        return shortened(part)
    return repr(shortened(part))
