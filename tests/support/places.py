"""Where the checkout is, and how thoroughly it is to be tested."""

import os
from importlib.util import find_spec
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


ON_MUJOCO = pytest.mark.skipif(
    find_spec("hsp_control.companions.mujoco") is None, reason="of another companion"
)
"""Of a test that also needs MuJoCo's companion."""
