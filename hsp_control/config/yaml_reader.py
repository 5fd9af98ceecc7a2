"""Read a YAML text as plain data, and record the place of each key in the text.

Nothing in a text is ever executed. Errors that PyYAML accepts (a key given twice, a
key that is not text, a tag, aliases that grow without bound) is an error here.

PyYAML reads YAML 1.1, where ``1e-3`` is text, ``on`` is true, ``010`` is eight and
``1:30`` is ninety. In YAML 1.2 they are a number, text, ten and text.
"""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import yaml

from hsp_control.declaration.language import shown
from hsp_control.declaration.located import KeyPath

TAG = "tag:yaml.org,2002:"

_HINTS = {
    r"'\t'": "a tab in the indentation; use spaces",
    "mapping values are not allowed": (
        "a key is not allowed here; check the indentation, and put text that contains "
        "': ' in quotes"
    ),
    "expected <block end>": "the indentation does not match the lines above",
}
"""Part of a message of PyYAML, and the message that replaces it."""


class YamlError(Exception):
    """The text is not YAML, or uses a part of YAML that is not allowed."""

    def __init__(self, line: int, message: str, path: KeyPath = ()) -> None:
        super().__init__(line, message, path)
        self.line = line  # the line of the error, from 1
        self.message = message  # the message
        self.path = path  # the key path of the error; empty if unknown


def _null(text: str) -> None:
    return None


def _boolean(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(text)
    return text.lower() == "true"


def _integer(text: str) -> int:
    value = int(text, 0 if text.startswith(("0o", "0x")) else 10)
    if not -(2**63) <= value < 2**64:
        raise ValueError(text)
    return value


def _number(text: str) -> float:
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


def _text(text: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError:  # JSON writes "\ud83e\udd16"; half a pair raises again
        return text.encode("utf-16", "surrogatepass").decode("utf-16")
    return text


_SCALARS: dict[str, tuple[str, Callable[[str], Any], str | None]] = {
    TAG + "null": ("null", _null, r"~|null|Null|NULL|"),
    TAG + "bool": ("true or false", _boolean, "true|True|TRUE|false|False|FALSE"),
    TAG + "int": ("a 64-bit integer", _integer, "[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"),
    TAG + "float": (
        "a number",
        _number,
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
    ),
    TAG + "str": ("text", _text, None),
}
"""The permitted scalars by tag: the name in messages, the converter of the text (which
may raise ValueError), and the pattern of the text without quotes; None: any other
text."""


MAX_SIZE = 1_000_000
"""Maximum number of characters in a text; parsing that many takes seconds."""
MAX_VALUES = 100_000
"""Maximum number of values in a text, after expanding its aliases."""
MAX_DEPTH = 50
"""Maximum depth of nesting."""


class Mark(NamedTuple):
    """A place in a text: line and column, from 1."""

    line: int
    column: int


def read_yaml(text: str) -> tuple[Any, dict[KeyPath, Mark]]:
    """Return the plain data of a text, and the mark of every key path in it."""
    root = _compose(text)
    if root is None:
        return None, {(): Mark(1, 1)}
    builder = _DataBuilder()
    builder.marks[()] = _mark(root)
    return builder.build(root, ()), builder.marks


class _Composer(yaml.BaseLoader):
    """PyYAML's composer, with the scalars of YAML 1.2 and limits on size."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0
        self._count = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self._depth += 1
        self._count += 1
        event = self.peek_event()  # type: ignore[no-untyped-call]
        _check_bounds(self._depth, self._count, event.start_mark.line + 1)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


for _tag, (*_, _pattern) in _SCALARS.items():
    if _pattern is not None:
        _regex = re.compile(rf"(?:{_pattern})\Z")
        _Composer.add_implicit_resolver(_tag, _regex, None)


def _compose(text: str) -> yaml.Node | None:
    try:
        composer = _Composer(text)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        character = f"U+{ord(text[error.position]):04X}"
        message = f"not YAML: the character {character} is not allowed"
        raise YamlError(line, message) from None
    try:
        return composer.get_single_node()
    except yaml.MarkedYAMLError as error:
        raise _syntax_error(error) from None
    except (ValueError, OverflowError):  # raised by the scanner's own int() and chr()
        message = "not YAML: an escape sequence or a version number is out of range"
        raise YamlError(composer.line + 1, message) from None


def _syntax_error(error: yaml.MarkedYAMLError) -> YamlError:
    """Return the error for one of PyYAML."""
    problem, context = error.problem or "", error.context or ""
    mark = error.problem_mark or error.context_mark
    line = mark.line + 1 if mark else 1
    for part_of_problem, hint in _HINTS.items():
        if part_of_problem in problem:
            return YamlError(line, f"not YAML: {hint}")
    if context and error.context_mark and error.context_mark.line + 1 != line:
        context += f" from line {error.context_mark.line + 1}"
    what = ", ".join(part for part in (context, problem) if part)
    return YamlError(line, f"not YAML: {what}")


class _DataBuilder:
    """Turns nodes into plain data, a copy for every alias, and collects the marks."""

    def __init__(self) -> None:
        self.marks: dict[KeyPath, Mark] = {}
        self._open: set[int] = set()
        self._count = 0

    def build(self, node: yaml.Node, path: KeyPath) -> Any:
        self._count += 1
        _check_bounds(len(path) + 1, self._count, _mark(node).line)
        if id(node) in self._open:
            raise YamlError(
                _mark(node).line, "an alias inside the value that it refers to", path
            )
        self._open.add(id(node))
        value: Any
        if isinstance(node, yaml.MappingNode) and node.tag == TAG + "map":
            value = self._mapping(node, path)
        elif isinstance(node, yaml.SequenceNode) and node.tag == TAG + "seq":
            value = self._sequence(node, path)
        else:
            value = _value(node, path)
        self._open.remove(id(node))
        return value

    def _mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key, mark = _key(key_node, path), _mark(key_node)
            here = (*path, key)
            if key in mapping:
                first = self.marks[here].line
                message = f"the key {key!r} is given twice, first on line {first}"
                raise YamlError(mark.line, message, here)
            self.marks[here] = mark
            mapping[key] = self.build(value_node, here)
        return mapping

    def _sequence(self, node: yaml.SequenceNode, path: KeyPath) -> list[Any]:
        items: list[Any] = []
        for index, item in enumerate(node.value):
            here = (*path, index)
            self.marks[here] = _mark(item)
            items.append(self.build(item, here))
        return items


def _key(node: yaml.Node, path: KeyPath) -> str:
    line = _mark(node).line
    if not isinstance(node, yaml.ScalarNode):
        raise YamlError(line, "a key must be text, not a list or a mapping", path)
    key = _value(node, path)
    if not isinstance(key, str):
        message = f"a key must be text, and {node.value} is not; put it in quotes"
        raise YamlError(line, message, path)
    if key == "<<":
        message = "merge keys (<<) are not supported; write the keys out"
        raise YamlError(line, message, path)
    return key


def _value(node: yaml.Node, path: KeyPath) -> Any:
    line = _mark(node).line
    if node.tag not in _SCALARS or not isinstance(node, yaml.ScalarNode):
        tag = node.tag.replace(TAG, "!!")
        message = f"the tag {tag!r} is not allowed: plain data only"
        if isinstance(node, yaml.MappingNode) and not tag.startswith("!!"):
            message += f"; did you mean {{type: {tag[1:]}, ...}}?"
        raise YamlError(line, message, path)
    name, convert, _ = _SCALARS[node.tag]
    try:
        return convert(node.value)
    except ValueError:
        what = f"{shown(node.value)} cannot be read as {name}"
        raise YamlError(line, what, path) from None


def _mark(node: yaml.Node) -> Mark:
    return Mark(node.start_mark.line + 1, node.start_mark.column + 1)


def _check_bounds(depth: int, count: int, line: int) -> None:
    if depth > MAX_DEPTH:
        raise YamlError(line, f"nested deeper than {MAX_DEPTH} levels")
    if count > MAX_VALUES:
        raise YamlError(line, f"more than {MAX_VALUES} values (aliases expanded)")
