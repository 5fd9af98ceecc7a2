"""Find the bundled robots and configurations; distinguish files from folders."""

from collections.abc import Iterator
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def bundled(folder: str) -> Path:
    """Return a bundled folder: inside the package, in a checkout beside it."""
    installed = _PACKAGE / "data" / folder
    return installed if installed.is_dir() else _PACKAGE.parent / folder


def bundled_robots() -> dict[str, Path]:
    """Return the folders of bundled robots by name, in alphabetical order."""
    return {path.parent.name: path.parent for path in _urdf_files()}


def config_folders() -> list[Path]:
    """Return the folders of bundled configurations.

    A checkout has some in its companions; a wheel has all in one folder.
    """
    return [bundled("configs"), *sorted(_PACKAGE.glob("companions/*/configs"))]


def bundled_configs() -> dict[str, Path]:
    """Return the files of bundled configurations by name (``paper/1_...``)."""
    found = {
        file.relative_to(folder).with_suffix("").as_posix(): file
        for folder in config_folders()
        for file in folder.rglob("*.yaml")
    }
    return dict(sorted(found.items()))


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
