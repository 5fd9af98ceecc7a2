"""The read-only active stack for users and modifiers."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from inspect import ismethod
from types import MappingProxyType
from typing import Any, NoReturn, TypeVar, cast

import numpy as np

from hsp_control.common.arrays import read_only_view
from hsp_control.common.errors import ImmutableError
from hsp_control.control.actuation.support import Support
from hsp_control.control.evolution import Evolution, Transition
from hsp_control.control.planned import PlannedTask
from hsp_control.edge import BoundLaw
from hsp_control.law import Problem

Stack = TypeVar("Stack")  # `ActiveStack`, which makes its read-only view

_READS = {"flow", "diagnose", "field_value", "points_of", "in_world"}
"""Methods of a stack and its parts without an effect on a step."""

_BOUND = {"calls", "layout", "permits"}
"""Attributes that have bound calls."""

_PARTS = BoundLaw, Problem, Support, PlannedTask, Evolution, Transition


class Shown:
    """The public attributes of an object of a step, read-only.

    Arrays are read-only views, so that they are always those of the present step.
    """

    __slots__ = ("_name", "_own")

    def __init__(self, own: object, name: str) -> None:
        """Show an object; its name is for messages."""
        object.__setattr__(self, "_own", own)
        object.__setattr__(self, "_name", name)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"{self._name} has no {name!r} to read")
        value = getattr(self._own, name)
        called = ismethod(value) and not is_dataclass(self._own)
        if name in _BOUND or (called and name not in _READS):
            raise ImmutableError(
                f"{self._name}.{name} would change the step of its controller; take a "
                "copy, controller.stack_at(state)"
            )
        return _shown(value, f"{self._name}.{name}")

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise ImmutableError(
            f"{self._name}.{name} cannot be assigned: it is its controller's; a "
            "modifier returns another acceleration, or an effort"
        )

    def __reduce__(self) -> NoReturn:
        raise ImmutableError(
            f"{self._name} cannot be copied or pickled: it is its controller's; take a "
            "copy, controller.stack_at(state)"
        )


def shown_stack(stack: Stack) -> Stack:
    """Return a stack whose arrays cannot be written, and which cannot be resolved."""
    return cast("Stack", Shown(stack, "active"))


def _shown(value: Any, name: str) -> Any:
    if isinstance(value, np.ndarray):
        return read_only_view(value)
    if isinstance(value, _PARTS):
        return Shown(value, name)
    if isinstance(value, Mapping):
        own = {key: _shown(each, name) for key, each in value.items()}
        return MappingProxyType(own)
    if isinstance(value, tuple | list):
        every = [_shown(each, name) for each in value]
        return type(value)(*every) if hasattr(value, "_fields") else tuple(every)
    return value
