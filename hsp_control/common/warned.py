"""Warnings with the user's line, at any depth of the call stack."""

import sys
import warnings


def warn(message: str, category: type[Warning]) -> None:
    """Issue a warning of the first line on the stack that is not this package's."""
    package = f"{__name__.partition('.')[0]}."
    frame, level = sys._getframe(1), 2
    while frame.f_globals.get("__name__", "").startswith(package) and frame.f_back:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)
