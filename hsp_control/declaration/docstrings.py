"""The docstrings of a class's fields: the strings that stand below them."""

import ast
import inspect
import sys
from collections.abc import Iterator
from functools import cache


def attribute_docstrings(cls: type) -> dict[str, str]:
    """Return the docstring of each annotated attribute, as one line, by name.

    Without source text, such as in an interactive session, there are none.
    """
    return _of_module(cls.__module__).get(cls.__qualname__, {})


@cache
def _of_module(module: str) -> dict[str, dict[str, str]]:
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        return {}
    return dict(_of_classes(ast.parse(source), ""))


def _of_classes(node: ast.AST, prefix: str) -> Iterator[tuple[str, dict[str, str]]]:
    for each in ast.iter_child_nodes(node):
        if isinstance(each, ast.ClassDef):
            name = f"{prefix}{each.name}"
            yield name, dict(_of_attributes(each))
            yield from _of_classes(each, f"{name}.")
        elif isinstance(each, ast.FunctionDef):
            yield from _of_classes(each, f"{prefix}{each.name}.<locals>.")


def _of_attributes(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for field, below in zip(node.body, node.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        ):
            yield field.target.id, " ".join(below.value.value.split())
