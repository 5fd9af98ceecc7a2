"""YAML syntax errors, with the line and a message in plain words."""

import yaml

from hsp_control.declaration.keys import KeyPath

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
        self.line = line  # the line of the error, counted from 1
        self.message = message  # what is wrong there
        self.path = path  # the key path of the error; empty if it is not known


def syntax_error(error: yaml.MarkedYAMLError) -> YamlError:
    """Return the `YamlError` for an error of PyYAML."""
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


def character_error(error: yaml.reader.ReaderError, text: str) -> YamlError:
    """Return the `YamlError` for a character that YAML does not allow."""
    line = text.count("\n", 0, error.position) + 1
    character = f"U+{ord(text[error.position]):04X}"
    return YamlError(line, f"not YAML: the character {character} is not allowed")
