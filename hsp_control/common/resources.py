"""Where the bundled robots and configurations lie: in a checkout or in the wheel."""

from collections.abc import Iterator
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def bundled(folder: str) -> Path:
    """Return the bundled folder ``robots`` or ``configs``.

    In an installed wheel it lies inside the package (``hsp_control/data``), in a
    checkout or an editable install beside it.
    """
    installed = _PACKAGE / "data" / folder
    return installed if installed.is_dir() else _PACKAGE.parent / folder


def bundled_robots() -> dict[str, Path]:
    """Return the bundled robots, name to folder, sorted by name."""
    return {path.parent.name: path.parent for path in _urdf_files()}


def bundled_configs() -> dict[str, Path]:
    """Return the bundled configurations, name (``paper/1_...``) to file, sorted."""
    root = bundled("configs")
    files = sorted(root.rglob("*.yaml"))
    return {file.relative_to(root).with_suffix("").as_posix(): file for file in files}


def _urdf_files() -> Iterator[Path]:
    for folder in sorted(bundled("robots").glob("*")):
        urdf = folder / f"{folder.name}.urdf"
        if urdf.is_file():
            yield urdf
