"""Files that end: no pipes, and no devices."""

from errno import EINVAL
from pathlib import Path

_ENDLESS = "a device or a pipe, which may never end"


def why_no_file(path: Path) -> str:
    """Return why a path cannot be read as a file, in words."""
    return _ENDLESS if _is_endless(path) else "no such file"


def _is_endless(path: Path) -> bool:
    return path.exists() and not (path.is_file() or path.is_dir())


def check_ends(path: Path) -> None:
    """Check that the file at a path, if it exists, is finite.

    Raises:
        OSError: If it is a device or a pipe; reading one may never return.
    """
    if _is_endless(path):
        raise OSError(EINVAL, _ENDLESS, str(path))
