"""Limits on reading untrusted files: which files, and how much of them.

A configuration, a URDF, a mesh or a log names other files. Strict reading opens only
files in folders that the user allowed. Paths are compared after ``..`` and symbolic
links have been resolved, so neither leads out of these folders.

XML is limited in size, and has no document type: a ``<!DOCTYPE>`` can declare entities,
which allow text that grows exponentially (billion laughs), and access to local files
and to network addresses. No URDF, SRDF or Collada file needs one.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from hsp_control.common.errors import AccessError
from hsp_control.common.regular_file import check_ends
from hsp_control.common.resources import bundled, config_folders

MAX_SIZE = 20_000_000
"""Maximum size of a URDF or SRDF [bytes]; example-robot-data has up to 0.3 MB."""
MAX_ELEMENTS = 200_000
"""Maximum number of elements in a URDF or SRDF."""
MAX_DEPTH = 100
"""Maximum depth of nesting, since parsers recurse."""


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
        return real is not None and any(map(real.is_relative_to, self.folders))

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
    allowed = [*map(Path, folders), bundled("robots"), *config_folders()]
    return Access(tuple(folder.expanduser().resolve() for folder in allowed))


def _resolved(path: Path) -> Path | None:
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):  # a null byte or a loop of links
        return None


class XmlError(Exception):
    """XML that is malformed or not allowed."""

    def __init__(self, line: int, message: str, column: int = 0) -> None:
        super().__init__(line, message, column)
        # line and column from 1; 0 if the whole file or line is meant
        self.line, self.message, self.column = line, message, column

    def within(self, file: Path | str) -> str:
        """Return the whole message: ``arm.urdf:3:7: malformed XML: ...``."""
        place = [str(number) for number in (self.line, self.column) if number]
        return f"{':'.join([str(file), *place])}: {self.message}"


def read_xml(path: Path) -> Element:
    """Return the top element of an XML file."""
    check_ends(path)
    with path.open("rb") as file:
        data = file.read(MAX_SIZE + 1)
    if len(data) > MAX_SIZE:
        raise XmlError(0, f"larger than {MAX_SIZE // 1_000_000} MB")
    return parse_xml(data)


def parse_xml(data: bytes) -> Element:
    """Return the top element of an XML text."""
    _check_limits(data)
    try:
        return ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise XmlError(line, f"malformed XML: {error}", column + 1) from error
    except (LookupError, ValueError) as error:  # an unknown encoding
        raise XmlError(0, f"malformed XML: {error}") from error


def check_no_document_type(data: bytes) -> None:
    """Check that XML has no document type; it is before the top element."""
    _check_limits(data, only_prolog=True)


class _TopElementError(Exception):
    """Ends a parse where the top element begins."""


def _check_limits(data: bytes, *, only_prolog: bool = False) -> None:
    """Count elements; malformed XML is left to the parser that follows."""
    parser = expat.ParserCreate()
    elements = depth = 0

    def refuse(message: str) -> None:
        raise XmlError(parser.CurrentLineNumber, message)

    def doctype(*_: object) -> None:
        refuse(
            "a document type (<!DOCTYPE>) is not allowed, because it can declare "
            "entities; delete it"
        )

    def start(*_: object) -> None:
        nonlocal elements, depth
        if only_prolog:
            raise _TopElementError
        elements, depth = elements + 1, depth + 1
        if elements > MAX_ELEMENTS:
            refuse(f"more than {MAX_ELEMENTS} elements")
        if depth > MAX_DEPTH:
            refuse(f"nested deeper than {MAX_DEPTH} levels")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, _TopElementError, LookupError, ValueError):
        return
