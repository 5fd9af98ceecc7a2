"""Files that end: no pipes, no devices, and none of the kernel's."""

from errno import EINVAL
from os.path import realpath
from pathlib import Path

_ENDLESS = "a device or a pipe, which may never end"
_KERNELS = "a file of the kernel, which may never end"
_KERNELS_FOLDERS = Path("/proc"), Path("/sys")
"""Folders whose files the kernel makes while they are read, such as its messages; they
look like any other file."""


def why_no_file(path: Path) -> str:
    """Return why a path cannot be read as a file, in words."""
    return why_endless(path) or "no such file"


def why_endless(path: Path) -> str:
    """Return why reading a path may never return, in words; empty if it does."""
    if not path.exists() or path.is_dir():
        return ""
    if not path.is_file():
        return _ENDLESS
    real = Path(realpath(path))
    return _KERNELS if any(map(real.is_relative_to, _KERNELS_FOLDERS)) else ""


def check_ends(path: Path) -> None:
    """Check that the file at a path, if it exists, is finite.

    Raises:
        OSError: If it is a device, a pipe or the kernel's; reading may never return.
    """
    if why := why_endless(path):
        raise OSError(EINVAL, why, str(path))
