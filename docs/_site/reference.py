"""The reference's pages, written from the code: names, YAML keys, commands, files."""

import json
import os
import re
from importlib import import_module
from pathlib import Path

from bundled import configurations_page, robots_page
from names import names_page, namespace_pages
from sphinx.application import Sphinx
from yaml_keys import yaml_page

SCHEMA = "../configs/hsp_control.schema.json"
ROOT = Path(__file__).resolve().parents[2]
COMPANIONS = "hsp_control/companions"
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s:]+)\)")


def write(app: Sphinx) -> None:
    """Write the pages that are made of the code or stand outside of docs."""
    folder = Path(app.srcdir) / "reference" / "generated"
    pages = {
        "names": names_page(),
        "configurations": configurations_page(),
        "robots": robots_page(),
        "yaml": yaml_page(json.loads((Path(app.srcdir) / SCHEMA).read_text())),
        **{f"hsp.{name}": page for name, page in namespace_pages()},
    }
    for pattern in ("benchmarks/results/*.md", f"{COMPANIONS}/*/**/*.md"):
        for file in ROOT.glob(pattern):
            if name := generated(file.relative_to(ROOT).as_posix()):
                text = file.read_text(encoding="utf-8")
                pages[name] = linked(text, file.parent, from_elsewhere=True)
    for script in sorted((ROOT / COMPANIONS).glob("*/site.py")):
        module = import_module(f"hsp_control.companions.{script.parent.name}.site")
        pages |= {f"tables/{name}": page for name, page in module.PAGES.items()}
    for name, page in pages.items():
        path = folder / f"{name}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text() != page:  # Sphinx reads it again
            path.write_text(page)
    for old in folder.rglob("*.md"):  # of removed companions
        if old.relative_to(folder).with_suffix("").as_posix() not in pages:
            old.unlink()


def generated(file: str) -> str | None:
    """Return the name of the generated page that shows a file of the checkout."""
    if found := re.fullmatch(r"benchmarks/results/(\w+)\.md", file):
        return f"results/{found[1]}"
    if found := re.fullmatch(rf"{COMPANIONS}/(\w+)/benchmark/results\.md", file):
        return f"results/{found[1]}"
    if found := re.fullmatch(rf"{COMPANIONS}/(\w+)/(\w+)\.md", file):
        return f"companions/{found[1] if found[2] == 'page' else found[2]}"
    return None


def linked(text: str, folder: Path, *, from_elsewhere: bool = False) -> str:
    """Let a page's links lead to pages of the site.

    Of a link to a companion that was taken away its text remains.
    """

    def led(found: re.Match[str]) -> str:
        words, (path, mark, part) = found[1], found[2].partition("#")
        if path.startswith("/") or not path:
            return found[0]
        file = Path(os.path.normpath(folder / path))
        if not file.is_relative_to(ROOT):
            return found[0]
        place = file.relative_to(ROOT).as_posix()
        companion = re.match(rf"{COMPANIONS}/\w+(?=/)", place)
        if companion and not (ROOT / companion[0]).exists():
            return words
        if name := generated(place):
            return f"[{words}](/reference/generated/{name}.md{mark}{part})"
        if from_elsewhere and place.startswith("docs/"):
            return f"[{words}]({place.removeprefix('docs')}{mark}{part})"
        return found[0]

    return LINK.sub(led, text)


def _led(app: Sphinx, name: str, source: list[str]) -> None:
    """Redirect the links of a page in docs to generated pages."""
    source[0] = linked(source[0], (Path(app.srcdir) / name).parent)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", write)
    app.connect("source-read", _led)
    return {"parallel_read_safe": True}
