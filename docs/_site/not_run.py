"""Show the reason, a comment in the page, below every block that no test runs."""

import re

from sphinx.application import Sphinx

_BLOCK = re.compile(
    r"^<!-- not run: ((?:(?!-->).)*) -->\n+(```\w+\n.*?^```\n)",
    re.MULTILINE | re.DOTALL,
)


def shown(text: str) -> str:
    """Return a page with a line of text below each block that is not run."""

    def below(found: re.Match[str]) -> str:
        reason = " ".join(found[1].split())
        return f"{found[2]}\n{{.not-run}}\nNot run by the tests: {reason}.\n\n"

    return _BLOCK.sub(below, text)


def _show(app: Sphinx, name: str, source: list[str]) -> None:
    source[0] = shown(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Change pages as they are read."""
    app.connect("source-read", _show)
    return {"parallel_read_safe": True}
