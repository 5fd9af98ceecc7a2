"""Where the checkout is, and how thoroughly it is to be tested."""

import os
from collections.abc import Iterable
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

THOROUGH = os.environ.get("HSP_THOROUGH") == "1"
"""Whether more seeds are tried, and all pages drawn: `make thorough`."""


def further(*cases: Any) -> tuple[Any, ...]:
    """Return cases that show what others do as well, for `make thorough`; else none.

    A test whose only cases these are is skipped.
    """
    return cases if THOROUGH else ()


def covering(*axes: Iterable[Any], times: int = 1) -> list[tuple[Any, ...]]:
    """Return tuples of one value of each axis: their product for `make thorough`.

    Else as few as have each value, those of the longest axis so many times.
    """
    lists = [list(axis) for axis in axes]
    if THOROUGH:
        return list(product(*lists))
    # In each round through an axis its values meet the next ones of the others.
    found = {
        tuple((k + k // len(axis)) % len(axis) for axis in lists): None
        for k in range(times * max(map(len, lists)))
    }
    return [
        tuple(axis[i] for axis, i in zip(lists, chosen, strict=True))
        for chosen in found
    ]


ON_MUJOCO = pytest.mark.skipif(
    find_spec("hsp_control.companions.mujoco") is None, reason="of another companion"
)
"""Of a test that also needs MuJoCo's companion."""
