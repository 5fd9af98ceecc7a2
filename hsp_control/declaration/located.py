"""Errors with a place: ``panda.yaml:9: tasks.hand.gains.kp: what is wrong``."""

from collections.abc import Iterator
from contextlib import contextmanager

from hsp_control.common.exceptions import ConfigError, HspControlError
from hsp_control.declaration.keys import KeyPath, written


@contextmanager
def within(*path: str | int) -> Iterator[None]:
    """Say at which key path an error inside the block belongs.

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


def _rewrite(error: HspControlError, path: KeyPath, where: str | None) -> None:
    bare = error.bare_message
    error.path, error.location = path, where
    whole = ": ".join(part for part in (where, written(path), bare) if part)
    error.args = (whole, *error.args[1:])
