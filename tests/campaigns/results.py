"""What the campaigns have counted, kept in files that the next stage reads."""

import json
import platform
from pathlib import Path
from typing import Any

FOLDER = Path("out/fuzz")
"""Where counts are kept until the document is written."""


def keep(name: str, counts: dict[str, Any]) -> None:
    """Write the counts of one campaign, whole or so far."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**counts, "interpreter": platform.python_version()}, indent=1)
    part = FOLDER / f".{name}.part"
    part.write_text(text, encoding="utf-8")
    part.replace(FOLDER / f"{name}.json")


def kept() -> dict[str, dict[str, Any]]:
    """Return all counts that are there, by campaign."""
    files = sorted(FOLDER.glob("*.json"))
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in files}
