"""Read untrusted XML: limited in size, and without a document type.

A document type (``<!DOCTYPE>``) can declare entities, which allow attacks: text that
grows exponentially (billion laughs), and access to local files and to network
addresses. No URDF, SRDF or Collada file needs one, so a file that has one is an error
before its content is read.
"""

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

MAX_SIZE = 20_000_000
"""Maximum size of a URDF or SRDF [bytes]; example-robot-data has up to 0.3 MB."""
MAX_ELEMENTS = 200_000
"""Maximum number of elements in a URDF or SRDF."""
MAX_DEPTH = 100
"""Maximum depth of nesting, since parsers recurse."""


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
    with path.open("rb") as file:
        data = file.read(MAX_SIZE + 1)
    if len(data) > MAX_SIZE:
        raise XmlError(0, f"larger than {MAX_SIZE // 1_000_000} MB")
    return parse_xml(data)


def parse_xml(data: bytes) -> Element:
    """Return the top element of an XML text."""
    _Limits(MAX_ELEMENTS, MAX_DEPTH).check(data)
    try:
        return ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise XmlError(line, f"malformed XML: {error}", column + 1) from error
    except (LookupError, ValueError) as error:  # an unknown encoding
        raise XmlError(0, f"malformed XML: {error}") from error


def check_no_document_type(data: bytes) -> None:
    """Check that XML has no document type; it stands before the top element."""
    _Limits(1, MAX_DEPTH).check(data, only_prolog=True)


class _EndOfPrologError(Exception):
    """The top element begins: ends the parse of the prolog."""


class _Limits:
    """Counts Expat's events; malformed XML is left to the parser that follows."""

    def __init__(self, max_elements: int, max_depth: int) -> None:
        self._max_elements, self._max_depth = max_elements, max_depth
        self._elements = self._depth = 0
        self._only_prolog = False
        self._parser = expat.ParserCreate()
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end

    def check(self, data: bytes, *, only_prolog: bool = False) -> None:
        self._only_prolog = only_prolog
        try:
            self._parser.Parse(data, True)
        except (expat.ExpatError, _EndOfPrologError, LookupError, ValueError):
            return

    def _doctype(self, *_: object) -> None:
        raise XmlError(
            self._parser.CurrentLineNumber,
            "a document type (<!DOCTYPE>) is not allowed, because it can declare "
            "entities; delete it",
        )

    def _start(self, name: str, attributes: object) -> None:
        if self._only_prolog:
            raise _EndOfPrologError
        self._elements += 1
        self._depth += 1
        if self._elements > self._max_elements:
            self._fail(f"more than {self._max_elements} elements")
        if self._depth > self._max_depth:
            self._fail(f"nested deeper than {self._max_depth} levels")

    def _end(self, name: str) -> None:
        self._depth -= 1

    def _fail(self, message: str) -> None:
        raise XmlError(self._parser.CurrentLineNumber, message)
