"""The edits that make code wrong and keep it running: of Python, and of the engine.

Python is edited on its syntax tree: the text of an expression or statement is replaced.
The engine is edited by words between blanks, which is enough, since clang-format puts
blanks around each operator; an edit that does not compile is no mutant.
"""

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div, ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
"""Replacements of operators."""
WORDS = {
    " + ": " - ", " - ": " + ", " * ": " / ", " / ": " * ", " += ": " -= ",
    " -= ": " += ", " *= ": " /= ", " < ": " <= ", " > ": " >= ", " <= ": " < ",
    " >= ": " > ", " == ": " != ", " != ": " == ", " && ": " || ", " || ": " && ",
    "std::min(": "std::max(", "std::max(": "std::min(", "if (": "if (!(", " = ": None,
}  # fmt: skip
"""Replacements of the engine's words; None: the whole statement is removed."""
NUMBER = re.compile(r"(?<![\w.])\d+\.\d+(?:e-?\d+)?(?![\w.])")
NO_CODE = re.compile(r"^\s*(//|#|\*|template|static_assert|using|namespace|throw)")


class Edit(NamedTuple):
    """One replacement in a text.

    Attributes:
        line: The line in which it begins, from 1.
        begin: Where the replaced text begins in the whole.
        old: The replaced text.
        new: The replacement.
    """

    line: int
    begin: int
    old: str
    new: str

    def __str__(self) -> str:
        """Return both on one line."""
        old, new = (" ".join(text.split()) for text in (self.old, self.new))
        return f"{old:.60} => {new:.60}"

    def applied(self, text: str) -> str:
        """Return the text with the edit.

        Raises:
            ValueError: If the text is not the one that the edit was made for.
        """
        end = self.begin + len(self.old)
        if text[self.begin : end] != self.old:
            raise ValueError(f"line {self.line} is not {self.old!r}")
        return text[: self.begin] + self.new + text[end:]


def edits(file: str, text: str) -> Iterator[Edit]:
    """Return all edits of a file's text."""
    return _of_python(text) if file.endswith(".py") else _of_cpp(text)


# ---------------------------------------------------------------------------- Python


def _of_python(text: str) -> Iterator[Edit]:
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    lines = text.splitlines(keepends=True)

    def place(line: int, column: int) -> int:
        """Return the position in the text of a column in bytes."""
        begun = lines[line - 1].encode()[:column].decode()
        return starts[line - 1] + len(begun)

    for node, new in _changed(ast.parse(text)):
        begin = place(node.lineno, node.col_offset)
        old = text[begin : place(node.end_lineno or 0, node.end_col_offset or 0)]
        yield Edit(node.lineno, begin, old, new)


def _changed(tree: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Return the nodes that an edit replaces, and the replacement texts."""
    for node in _told(tree):
        match node:
            case ast.BinOp(op=op) if type(op) in OPERATORS:
                yield node, _instead(node, op=OPERATORS[type(op)]())
            case ast.BoolOp(op=op):
                yield node, _instead(node, op=OPERATORS[type(op)]())
            case ast.Compare(ops=[op]):
                yield node, _instead(node, ops=[OPERATORS[type(op)]()])
            case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
                yield node, f"({ast.unparse(operand)})"
            case ast.IfExp(test=test):
                yield node, _instead(node, test=ast.UnaryOp(ast.Not(), test))
            case ast.If(test=test) | ast.While(test=test):
                if not isinstance(test, ast.Compare | ast.BoolOp | ast.UnaryOp):
                    yield test, f"(not {ast.unparse(test)})"
            case ast.Constant(value=bool() as value):
                yield node, str(not value)
            case ast.Constant(value=int() | float() as value):
                yield node, repr(2 * value if value else value + 1)
            case ast.AugAssign(op=op) if type(op) in OPERATORS:
                yield node, _instead(node, op=OPERATORS[type(op)]())[1:-1]
            case ast.Expr(value=ast.Call()):
                yield node, "pass"


def _told(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a tree's nodes without text: types, docstrings, messages."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "type_params", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(
                child, ast.Raise | ast.JoinedStr | ast.Assert | ast.Import
            ):
                continue
            if isinstance(child, ast.Assign) and _names_a_type(child):
                continue
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                continue
            if isinstance(child, ast.FunctionDef) and child.name == "__repr__":
                continue
            yield child
            yield from _told(child)


def _names_a_type(node: ast.Assign) -> bool:
    return isinstance(node.value, ast.BinOp) and "NDArray" in ast.unparse(node.value)


def _instead(node: ast.AST, **fields: object) -> str:
    """Return the text of a node with other fields, in parentheses."""
    old = dict(ast.iter_fields(node))
    return f"({ast.unparse(type(node)(**{**old, **fields}))})"


# ------------------------------------------------------------------------ the engine


def _of_cpp(text: str) -> Iterator[Edit]:
    begin = 0
    for number, line in enumerate(text.splitlines(keepends=True), start=1):
        code = re.sub(r'"[^"]*"', lambda s: "_" * len(s[0]), line).split("//")[0]
        if not NO_CODE.match(line):
            for column, old, new in _of_line(code, line):
                yield Edit(number, begin + column, old, new)
        begin += len(line)


def _of_line(code: str, line: str) -> Iterator[tuple[int, str, str]]:
    """Return the edits of a line; ``code`` is the line with its strings hidden."""
    for old, new in WORDS.items():
        for found in re.finditer(re.escape(old), code):
            if new and new.count("(") == new.count(")") + old.count("("):
                yield found.start(), old, new
            elif old == "if (" and (end := _closing(code, found.end())):
                negated = f"if (!({line[found.end() : end - 1]}))"
                yield found.start(), line[found.start() : end], negated
            elif old == " = " and re.fullmatch(r"\s*[\w.\[\]()]+ = .*;\s*", code):
                begin = len(code) - len(code.lstrip())  # one line, and no declaration
                yield begin, line[begin : len(code.rstrip())], ";"
    for found in NUMBER.finditer(code):
        value = float(found[0])
        yield found.start(), found[0], repr(2.0 * value if value else 1.0)


def _closing(code: str, begin: int) -> int | None:
    """Return the text after the parenthesis that closes the one before ``begin``."""
    depth = 1
    for i, letter in enumerate(code[begin:], start=begin):
        depth += (letter == "(") - (letter == ")")
        if not depth:
            return i + 1
    return None
