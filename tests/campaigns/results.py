"""Results of the campaigns, kept in files."""

import json
import platform
from pathlib import Path
from typing import Any

FOLDER = Path("out/fuzz")


def keep(name: str, counts: dict[str, Any]) -> None:
    """Write the results of one campaign, complete or so far."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**counts, "interpreter": platform.python_version()}, indent=1)
    part = FOLDER / f".{name}.part"
    part.write_text(text, encoding="utf-8")
    part.replace(FOLDER / f"{name}.json")
