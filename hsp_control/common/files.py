"""What is asked of a path that a file may contain, whatever characters it has."""

from pathlib import Path


def is_file(path: Path) -> bool:
    """Return whether a path leads to a file; False if it can be none."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long for a path, or with a null character
        return False


def is_folder(path: Path) -> bool:
    """Return whether a path leads to a folder; False if it can be none."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False
