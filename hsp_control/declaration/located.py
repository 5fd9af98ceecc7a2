"""Key paths, and errors with a place: ``panda.yaml:9: tasks.hand.gains.kp: ...``."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeAlias

from hsp_control.common.errors import ConfigError, HspControlError
from hsp_control.declaration.language import shortened, spoken

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


@contextmanager
def within(*path: str | int) -> Iterator[None]:
    """Prefix errors that are raised inside the block with a key path.

    Blocks may be nested; the outer path comes first::

        with within("tasks", "hand"), within("frame"):
            robot.frame_id("panda_hnad")  # FrameNotFoundError: tasks.hand.frame: ...

    Raises:
        HspControlError: The error that was raised inside, with the path in its message.
    """
    try:
        yield
    except HspControlError as error:
        place(error, path)
        raise


def place(error: HspControlError, path: KeyPath) -> None:
    """Put a key path before the one that the error has; the error itself changes."""
    if error.location is None:
        _rewrite(error, (*path, *error.path), None)


def locate(error: HspControlError, where: str, path: KeyPath | None = None) -> None:
    """Add file and line to the error's message, unless it has them already."""
    if error.location is None:
        _rewrite(error, error.path if path is None else path, where)


def located(where: str, message: str, path: KeyPath = ()) -> ConfigError:
    """Return an error about the value at the key path ``path``, given at ``where``."""
    error = ConfigError(message)
    locate(error, where, path)
    return error


_ARGUMENTS: dict[KeyPath, str] = {
    ("null_space", "gain"): "null_space_gain",
    ("null_space", "metric"): "metric",
    ("null_space", "fields"): "field",
}
"""The arguments of a controller in Python, by their keys in a configuration."""


def place_of(path: KeyPath) -> str:
    """Return a place in the user's language: keys, or in Python arguments."""
    argument = _ARGUMENTS.get(path[:2])
    in_python = path if argument is None else (argument, *path[2:])
    return spoken(written(path), written(in_python))


def _rewrite(error: HspControlError, path: KeyPath, where: str | None) -> None:
    bare = error.bare_message
    error.path, error.location = path, where
    # A configuration in Python, a dictionary, has keys, too.
    place = place_of(path) if where is None else written(path)
    if where is None and bare.startswith((f"{place} is ", f"{place} has ")):
        place = ""  # which the message names already
    whole = ": ".join(part for part in (where, place, bare) if part)
    error.args = (whole, *error.args[1:])
