"""Where the checkout is, and how thoroughly it is to be tested."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

THOROUGH = os.environ.get("HSP_THOROUGH") == "1"
"""Whether more seeds are tried, and all pages drawn: `make thorough`."""
