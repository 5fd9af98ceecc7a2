"""The lecture: slides in one page, made of ``docs/lecture/lecture.md``.

A line ``---`` ends a slide, a line ``+++`` begins its right half. Pictures are within
the page, replays are frames, written as on the other pages, and formulas are MathML. If
its script does not run, the page still scrolls.
"""

import base64
import re
from html import escape
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

TYPES = {".png": "image/png", ".webp": "image/webp"}
PICTURE = re.compile(r"!\[([^\]]+)\]\(([^)]+)\)")
REPLAY = re.compile(r"^```\{replay\} (\S+)\n:title: (.+)\n```$", re.MULTILINE)


def page(source: Path, replays: str, folder: Path) -> str:
    """Return the lecture as HTML.

    Args:
        source: The Markdown file.
        replays: Address of the folder of replays, relative to the page.
        folder: Where that folder is now.

    Raises:
        ExtensionError: If a picture or a replay does not exist.
    """

    def frame(match: re.Match[str]) -> str:
        name, title = match[1].replace("/", "-") + ".html", escape(match[2])
        if not (folder / name).is_file():
            raise ExtensionError(f"there is no {folder / name}; `make docs` writes it")
        address = f"{replays}/{name}"
        return (
            f'<figure><iframe src="{address}" loading="lazy" title="{title}" '
            f'allow="fullscreen"></iframe><figcaption>{title} '
            f'<a href="{address}">Alone</a></figcaption></figure>'
        )

    def picture(match: re.Match[str]) -> str:
        file = source.parent / match[2]
        if not file.is_file():
            raise ExtensionError(f"{source.name}: there is no picture {match[2]}")
        data = base64.b64encode(file.read_bytes()).decode()
        address = f"data:{TYPES[file.suffix]};base64,{data}"
        return f'<img src="{address}" alt="{escape(match[1])}">'

    markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
    dollarmath_plugin(markdown, double_inline=True, renderer=_formula)
    text = source.read_text(encoding="utf-8")
    title = re.match(r"# (.*)", text)
    if title is None:
        raise ExtensionError(f"{source.name} does not begin with its title")
    shown = [
        "".join(
            f"<div>{markdown.render(half)}</div>" for half in slide.split("\n+++\n")
        )
        for slide in PICTURE.sub(picture, REPLAY.sub(frame, text)).split("\n---\n")
    ]
    template = source.with_name("page.html").read_text(encoding="utf-8")
    sections = "\n".join(
        f'<section id="{number}"><div class="halves">{slide}</div>'
        f'<a class="number" href="#{number}">{number}</a></section>'
        for number, slide in enumerate(shown, 1)
    )
    return template.replace("$title", escape(title[1])).replace("$slides", sections)


def _formula(content: str, options: dict[str, Any]) -> str:
    display = "block" if options["display_mode"] else "inline"
    return str(convert(content, display=display))


def _write(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        source = Path(app.srcdir)
        text = page(
            source / "lecture" / "lecture.md",
            "_static/replays",
            source / "_static" / "replays",
        )
        (Path(app.outdir) / "lecture.html").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the lecture when the site is written."""
    app.connect("build-finished", _write)
    return {"parallel_read_safe": True}
