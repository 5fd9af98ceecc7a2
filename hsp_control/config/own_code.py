"""The user's Python code that a configuration imports: its key ``imports``."""

import logging
import sys
from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path

from hsp_control.common.errors import AccessError
from hsp_control.config.document import Document
from hsp_control.declaration.imported import fingerprints, import_code, is_file_name

_log = logging.getLogger(__name__)
_KEY = "imports"


def add_imports(document: Document, names: Sequence[str | PathLike[str]]) -> None:
    """Add code to the list of a configuration, as ``--import`` does."""
    if not names:
        return
    listed = document.to_dict().get(_KEY)
    before = listed if isinstance(listed, list) else []
    added = [_absolute(fspath(name), Path.cwd()) for name in names]
    document.assign([_KEY], list(dict.fromkeys([*before, *added])), "--import")
    document.given_code = frozenset(added)


def run_imports(document: Document) -> None:
    """Import the code that a configuration lists, before its types are looked up.

    The code in a log's list is imported only if it is the same to the last byte as in
    the run, or named by ``--import`` as well.

    Raises:
        AccessError: If a strictly read configuration lists a file, or a module of a
        package that is not allowed.
        ConfigError: If something cannot be imported.
    """
    listed = document.to_dict().get(_KEY)
    if not isinstance(listed, list) or not all(isinstance(x, str) for x in listed):
        return  # the schema reports the error
    folder = Path(document.name).resolve().parent
    for k, name in enumerate(listed):
        code = _absolute(name, folder)
        with document.at(_KEY, k):
            if document.recorded_code is None or name in document.given_code:
                _check_allowed(name, document)
                import_code(code)
            elif not _is_known(code):
                _import_again(code, document)


def _import_again(name: str, document: Document) -> None:
    """Import the code that a log lists, if it is unchanged since the run."""
    then = (document.recorded_code or {}).get(name)
    if document.access.strict and not document.imports_recorded_code:
        why = "no code is run with --strict"
    elif then is None or fingerprints([name]).get(name) != then:
        why = f"it is missing or was edited since the run; --import {name} imports it"
    else:
        import_code(name)
        return
    _log.warning("%s: %s is not imported: %s", document.name, name, why)


def located_imports(imports: Sequence[str], folder: Path) -> tuple[str, ...]:
    """Return the list with absolute paths."""
    return tuple(_absolute(name, folder) for name in imports)


def _absolute(name: str, folder: Path) -> str:
    return str((folder / name).resolve()) if is_file_name(name) else name


def _is_known(name: str) -> bool:
    stem = Path(name).stem if is_file_name(name) else name
    file = getattr(sys.modules.get(stem), "__file__", None)
    return file is not None and (not is_file_name(name) or Path(file) == Path(name))


def _check_allowed(name: str, document: Document) -> None:
    """Check that strict reading accepts the package of a module; it accepts no file."""
    package = "" if is_file_name(name) else name.partition(".")[0]
    if not document.access.strict or package in (document.packages or ()):
        return
    hint = f"; if you trust it, add --allow {package}" if package else ""
    raise AccessError(f"{name} is code, which --strict does not run{hint}")
