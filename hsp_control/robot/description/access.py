"""Which files may be read when an untrusted file names them.

A configuration, a URDF, a mesh or a log names other files. Strict reading opens only
files in folders that the user allowed. Paths are compared after ``..`` and symbolic
links have been resolved, so neither leads out of these folders.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from hsp_control.common.exceptions import AccessError
from hsp_control.common.resources import bundled


@dataclass(frozen=True)
class Access:
    """Which files may be read."""

    # resolved paths of the allowed folders; None: every file is allowed
    folders: tuple[Path, ...] | None = None

    @property
    def strict(self) -> bool:
        """Whether only files in ``folders`` are allowed."""
        return self.folders is not None

    def allows(self, path: Path) -> bool:
        """Return whether a file, or everything in a folder, may be read."""
        if self.folders is None:
            return True
        real = _resolved(path)
        return real is not None and any(
            real.is_relative_to(folder) for folder in self.folders
        )

    def check(self, path: Path, what: str) -> None:
        """Check that a path is allowed."""
        if self.allows(path):
            return
        real = _resolved(path)
        if real is None:
            raise AccessError(f"{what} {str(path)!r}: cannot resolve this path")
        raise AccessError(
            f"{what} {str(path)!r} resolves to {real}, outside the folders that strict "
            f"reading allows; if you trust it, add --allow {real.parent}"
        )


ANYWHERE = Access()
"""Every file may be read: the default, without strict reading."""


def only_within(folders: Iterable[str | PathLike[str]]) -> Access:
    """Return access to these folders and to the bundled robots and configurations."""
    allowed = [*map(Path, folders), bundled("robots"), bundled("configs")]
    return Access(tuple(folder.expanduser().resolve() for folder in allowed))


def _resolved(path: Path) -> Path | None:
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):  # a null byte or a loop of links
        return None
