"""Files that end: no pipes, and no devices."""

from errno import EINVAL
from pathlib import Path


def check_ends(path: Path) -> None:
    """Check that what is at a path, if anything is, ends when it is read.

    Raises:
        OSError: If it is a device or a pipe; reading one may never return.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(EINVAL, "a device or a pipe, which may never end", str(path))
