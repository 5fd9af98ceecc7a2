"""Compensators and nothing besides: no momentum observer by default."""

from typing import Any

from hsp_control.control.compensation import Compensation


def only(**parts: Any) -> Compensation:
    """Return compensation of these parts; without a momentum observer if none is."""
    return Compensation(**{"momentum_observer": None, **parts})


ALONE = only()
"""The law alone, whatever the plant."""
