"""Find the bundled robots and configurations; tell files from folders."""

from collections.abc import Iterator
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def bundled(folder: str) -> Path:
    """Return a bundled folder: inside the package, in a checkout beside it."""
    installed = _PACKAGE / "data" / folder
    return installed if installed.is_dir() else _PACKAGE.parent / folder


def bundled_robots() -> dict[str, Path]:
    """Return the folder of each bundled robot, by name, in alphabetical order."""
    return {path.parent.name: path.parent for path in _urdf_files()}


def bundled_configs() -> dict[str, Path]:
    """Return the file of each bundled configuration, by name (``paper/1_...``)."""
    root = bundled("configs")
    files = sorted(root.rglob("*.yaml"))
    return {file.relative_to(root).with_suffix("").as_posix(): file for file in files}


def _urdf_files() -> Iterator[Path]:
    for folder in sorted(bundled("robots").glob("*")):
        urdf = folder / f"{folder.name}.urdf"
        if urdf.is_file():
            yield urdf


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
