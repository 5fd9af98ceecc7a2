"""Only the given compensators: no momentum observer by default."""

from typing import Any

from hsp_control.control.compensation import Compensation


def only(**parts: Any) -> Compensation:
    """Return compensation of these parts, without a momentum observer unless given."""
    return Compensation(**{"momentum_observer": None, **parts})


ALONE = only()
"""The law alone, for any plant."""
