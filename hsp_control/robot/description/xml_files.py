"""Read XML that a stranger may have written: bounded in size, and without entities.

A document type is what entities are declared in: the billion laughs, files of the
reader's machine, addresses that are called. No URDF, SRDF or Collada file needs one, so
it is refused before anything in it is looked at.
"""

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

MAX_SIZE = 20_000_000
"""Bytes of a URDF or SRDF; the largest robot of example-robot-data has 0.3 MB."""
MAX_ELEMENTS = 200_000
"""Elements of a URDF or SRDF."""
MAX_DEPTH = 100
"""Levels of nesting: parsers that recurse have an end."""


class XmlError(Exception):
    """XML that is not read.

    Attributes:
        line: Where, counted from 1; 0 if it concerns the file as a whole.
        message: What is wrong.
    """

    def __init__(self, line: int, message: str) -> None:
        """Keep the two apart: the caller knows how to name the file."""
        super().__init__(line, message)
        self.line = line
        self.message = message


def read_xml(path: Path) -> Element:
    """Return the top element of an XML file.

    Raises:
        XmlError: If it is too large or too deep, or has a document type.
        ElementTree.ParseError: If it is malformed.
        OSError: If it cannot be read.
        LookupError, ValueError: If its encoding is unknown.
    """
    with path.open("rb") as file:
        data = file.read(MAX_SIZE + 1)
    if len(data) > MAX_SIZE:
        raise XmlError(0, f"larger than {MAX_SIZE // 1_000_000} MB")
    return parse_xml(data)


def parse_xml(data: bytes) -> Element:
    """Return the top element of an XML text; see `read_xml` for what is raised."""
    _Guard(MAX_ELEMENTS, MAX_DEPTH).look_at(data)
    return ElementTree.fromstring(data)


def refuse_document_type(data: bytes) -> None:
    """Refuse an XML text of any size if it has a document type.

    It can stand before the top element only, so what comes after is not looked at.

    Raises:
        XmlError: If it has one.
    """
    _Guard(1, MAX_DEPTH).look_at(data, only_prolog=True)


class _EndOfPrologError(Exception):
    """The top element begins."""


class _Guard:
    """Expat's events, counted; what is malformed is left to the parser proper."""

    def __init__(self, elements: int, depth: int) -> None:
        self._most, self._deepest = elements, depth
        self._elements = self._depth = 0
        self._only_prolog = False
        self._parser = expat.ParserCreate()
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end

    def look_at(self, data: bytes, *, only_prolog: bool = False) -> None:
        self._only_prolog = only_prolog
        try:
            self._parser.Parse(data, True)
        except (expat.ExpatError, _EndOfPrologError, LookupError, ValueError):
            return

    def _doctype(self, *_: object) -> None:
        raise XmlError(
            self._parser.CurrentLineNumber,
            "a document type (<!DOCTYPE>), which is where entities are declared, is "
            "not read; delete it",
        )

    def _start(self, name: str, attributes: object) -> None:
        if self._only_prolog:
            raise _EndOfPrologError
        self._elements += 1
        self._depth += 1
        if self._elements > self._most:
            self._refuse(f"more than {self._most} elements")
        if self._depth > self._deepest:
            self._refuse(f"nested deeper than {self._deepest} levels")

    def _end(self, name: str) -> None:
        self._depth -= 1

    def _refuse(self, message: str) -> None:
        raise XmlError(self._parser.CurrentLineNumber, message)
