"""Compare the lines of rooms, tests and pages with what pyproject.toml allows.

    make lint        or        .venv/bin/python tools/budget.py

The table ``[tool.budget]`` gives the most lines of each; whoever needs more raises the
number in the same commit and says why. Something without a number is an error, and so
is a number of something that is gone. Prints what is wrong, and ends with 1 if
anything is.
"""

import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_NOT_WRITTEN = {"__pycache__", "_build", "generated"}
_PARTS = {
    "tests": ("tests", "*.py"),
    "pages": ("docs", "*.md"),
    "scripts": ("hsp_control", "*.js"),
    "tools": ("tools", "*.py"),
    "benchmarks": ("benchmarks", "*.py"),
}


def counted(root: Path) -> dict[str, int]:
    """Return the lines of the rooms, of the package, its core, and what is beside.

    What a checkout does not contain, such as an installed site, does not count.
    """
    package = root / "hsp_control"
    rooms = [each for each in package.iterdir() if each.is_dir()]
    found = {
        room.name: _lines(room, "*.py")
        for room in sorted(rooms)
        if room.name not in _NOT_WRITTEN
    }
    found["package"] = _lines(package, "*.py")
    found["core"] = found["package"] - found.get("companions", 0)
    return found | {
        name: _lines(root / of, kind) for name, (of, kind) in _PARTS.items()
    }


def wrong(found: Mapping[str, int], allowed: Mapping[str, int]) -> list[str]:
    """Return a message for each part that exceeds its budget, or has none."""
    messages = [
        f"{name}: {lines} lines, {lines - allowed[name]} more than its budget"
        for name, lines in found.items()
        if name in allowed and lines > allowed[name]
    ]
    messages += [
        f"{name}: {found[name]} lines, and no budget"
        for name in found
        if name not in allowed
    ]
    return messages + [
        f"{name}: a budget of nothing" for name in allowed if name not in found
    ]


def _lines(folder: Path, pattern: str) -> int:
    """Return how many lines the files of a folder have."""
    return sum(
        file.read_bytes().count(b"\n")
        for file in folder.rglob(pattern)
        if not _NOT_WRITTEN & set(file.parts)
    )


def main() -> int:
    """Print what is wrong, or the total; return 1 if anything is wrong."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found = counted(ROOT)
    messages = wrong(found, table["tool"]["budget"])
    for message in messages:
        print(message, file=sys.stderr)
    if not messages:
        print(
            f"{found['core']} lines in the core, {found['companions']} in companions, "
            f"{found['tests']} of tests."
        )
    return bool(messages)


if __name__ == "__main__":
    sys.exit(main())
