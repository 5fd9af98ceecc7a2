"""What is wrong with a YAML text, in plain words and with the line."""

import yaml

from hsp_control.config.keys import KeyPath

_HINTS = {
    r"'\t'": "a tab; indent with spaces",
    "mapping values are not allowed": (
        "no key can stand here; check the indentation, and quote texts that hold ': '"
    ),
    "expected <block end>": "the indentation does not fit the lines above",
}
"""Plain words for what PyYAML says in those of its grammar."""


class YamlError(Exception):
    """A text that is not the YAML that we accept.

    Attributes:
        line: The line that the message speaks of.
        message: What is wrong there.
        path: The key path that it speaks of, if the text was understood that far.
    """

    def __init__(self, line: int, message: str, path: KeyPath = ()) -> None:
        """Keep the three apart: the caller knows the name of the file."""
        super().__init__(line, message, path)
        self.line = line
        self.message = message
        self.path = path


def syntax_error(error: yaml.MarkedYAMLError) -> YamlError:
    """Return PyYAML's error as ours."""
    problem, context = error.problem or "", error.context or ""
    mark = error.problem_mark or error.context_mark
    line = mark.line + 1 if mark else 1
    for sign, hint in _HINTS.items():
        if sign in problem:
            return YamlError(line, f"not YAML: {hint}")
    if context and error.context_mark and error.context_mark.line + 1 != line:
        context += f" from line {error.context_mark.line + 1}"
    what = ", ".join(part for part in (context, problem) if part)
    return YamlError(line, f"not YAML: {what}")


def character_error(error: yaml.reader.ReaderError, text: str) -> YamlError:
    """Return PyYAML's error about a character that no YAML may hold as ours."""
    line = text.count("\n", 0, error.position) + 1
    return YamlError(line, f"not YAML: the character U+{ord(text[error.position]):04X}")
