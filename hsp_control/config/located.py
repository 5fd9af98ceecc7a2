"""Errors with a location: ``panda.yaml:9: tasks.hand.gains.kp: what is wrong``."""

from hsp_control.common.exceptions import ConfigError, HspControlError
from hsp_control.config.keys import KeyPath, written


def located(where: str, message: str, path: KeyPath = ()) -> ConfigError:
    """Return an error about the value at the key path ``path``, given at ``where``."""
    error = ConfigError(_message(where, message, path))
    error.location = where
    return error


def locate(error: HspControlError, where: str, path: KeyPath) -> None:
    """Add the location to the error's message, unless it has a location already.

    The error itself is changed, so it keeps its class, attributes and traceback.
    """
    if error.location is None:
        error.args = (_message(where, str(error), path), *error.args[1:])
        error.location = where


def _message(where: str, message: str, path: KeyPath) -> str:
    return ": ".join(part for part in (where, written(path), message) if part)
