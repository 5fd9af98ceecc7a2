"""The checkout's folder, and the extent of testing."""

import os
from collections.abc import Iterable
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

THOROUGH = os.environ.get("HSP_THOROUGH") == "1"
"""Whether to try more seeds and draw all pages: `make thorough`."""


def further(*cases: Any) -> tuple[Any, ...]:
    """Return redundant cases for `make thorough`; otherwise none.

    A test with no other cases is skipped.
    """
    return cases if THOROUGH else ()


def covering(*axes: Iterable[Any], times: int = 1) -> list[tuple[Any, ...]]:
    """Return tuples of one value of each axis: their product for `make thorough`.

    Otherwise as few as contain every value, with that many for the longest axis.
    """
    lists = [list(axis) for axis in axes]
    if THOROUGH:
        return list(product(*lists))
    # In every round through an axis its values are paired with the next ones of the
    # others.
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
"""Mark of a test that also needs the MuJoCo companion."""
