"""Docstrings are plain English with Google's sections, not reStructuredText.

So a star is a star, and an indented block after a line is a formula or an example. This
escapes Sphinx's markup; then `napoleon` reads the sections, except those of attributes:
it would parse ``N(q, v): efforts`` as a type.
"""

import re

from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, GoogleDocstring

_SECTIONS = Config(napoleon_use_ivar=True, napoleon_use_rtype=False)
_CODE = re.compile(r"(``.+?``|`[^`]+`)")
_MARKUP = re.compile(r"([*|\\])|(?<=\w)(_)(?=\W|$)")
_SECTION = re.compile(
    r"^(Args|Arguments|Attributes|Returns|Raises|Yields|Example|Examples|Note):\s*$"
)


def plain(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Escape markup outside of code, and mark indented blocks as literal."""
    out: list[str] = []
    in_section = in_literal = False
    for number, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if line.strip() and indent == 0:
            in_literal = False
            in_section = bool(_SECTION.match(line))
        before = lines[number - 1].strip() if number else "x"
        begins = indent >= 2 and not before and not in_section and not in_literal
        if begins and out and _starts_block(out):
            out += ["::", ""]
            in_literal = True
        out.append(line if in_literal else _escaped(line))
    if what not in {"attribute", "property"}:
        out = GoogleDocstring(out, _SECTIONS, app, what, name, obj, options).lines()
    lines[:] = out


def _starts_block(out: list[str]) -> bool:
    """Return whether the last text is at the margin, so that a block follows."""
    text = [line for line in out if line.strip()]
    return bool(text) and not text[-1].startswith((" ", "- ", "* "))


def _escaped(line: str) -> str:
    parts = _CODE.split(line)
    for k in range(0, len(parts), 2):
        parts[k] = _MARKUP.sub(r"\\\1\2", parts[k])
    text = "".join(parts)
    bullet = re.match(r"^(\s*)\\\*\s", text)  # a list's star is one
    return text.replace("\\*", "*", 1) if bullet else text


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to autodoc."""
    app.connect("autodoc-process-docstring", plain)
    return {"parallel_read_safe": True}
