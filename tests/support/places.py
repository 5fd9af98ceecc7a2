"""Where the checkout is, and how thoroughly it is to be tested."""

import os
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

THOROUGH = os.environ.get("HSP_THOROUGH") == "1"
"""Whether more seeds are tried, and all pages drawn: `make thorough`."""

ON_MUJOCO = pytest.mark.skipif(
    find_spec("hsp_control.companions.mujoco") is None, reason="of another companion"
)
"""Of a test that also needs MuJoCo's companion."""
