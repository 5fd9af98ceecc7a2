"""Which files may be read on a stranger's word.

A configuration, a URDF, a mesh or a log names other files. Told to be strict, we read
only those that lie in folders which the user allowed. Paths are compared as the file
system resolves them: neither ``..`` nor a link leads out.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from hsp_control.common.exceptions import AccessError
from hsp_control.common.resources import bundled


@dataclass(frozen=True)
class Access:
    """Which files may be read.

    Attributes:
        folders: Where they may lie, as the file system resolves them; None: anywhere.
    """

    folders: tuple[Path, ...] | None = None

    @property
    def strict(self) -> bool:
        """Whether anything is forbidden."""
        return self.folders is not None

    def allows(self, path: Path) -> bool:
        """Say whether a file, or everything in a folder, may be read."""
        if self.folders is None:
            return True
        real = _resolved(path)
        return real is not None and any(
            real.is_relative_to(folder) for folder in self.folders
        )

    def check(self, path: Path, what: str) -> None:
        """Refuse a path that is not allowed.

        Args:
            path: The file, relative to the working folder if to anything.
            what: What names it, for the message: ``robot`` or ``link 'hand': mesh``.

        Raises:
            AccessError: If the path leads outside the folders that are allowed.
        """
        if self.allows(path):
            return
        real = _resolved(path)
        if real is None:
            raise AccessError(f"{what} {str(path)!r}: no path that can be resolved")
        raise AccessError(
            f"{what} {str(path)!r} leads to {real}, outside the folders that strict "
            f"reading allows; if you trust it: --allow {real.parent}"
        )


ANYWHERE = Access()
"""What is read where nobody asked to be strict."""


def only_within(folders: Iterable[str | PathLike[str]]) -> Access:
    """Return access to some folders and to the bundled robots and configurations."""
    allowed = [*map(Path, folders), bundled("robots"), bundled("configs")]
    return Access(tuple(folder.expanduser().resolve() for folder in allowed))


def _resolved(path: Path) -> Path | None:
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):  # a null byte, a loop of links
        return None
