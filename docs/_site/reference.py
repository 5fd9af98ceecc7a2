"""The reference's pages, written from the code: names, YAML keys, commands, files."""

import json
import re
from pathlib import Path

from bundled import configurations_page, franka_errors_page, robots_page
from names import names_page, namespace_pages
from sphinx.application import Sphinx
from yaml_keys import yaml_page

SCHEMA = "../configs/hsp_control.schema.json"
BENCHMARKS = "../benchmarks"
COMPANIONS = "../hsp_control/companions"


def write(app: Sphinx) -> None:
    """Write all pages that are made of the code."""
    folder = Path(app.srcdir) / "reference" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "names": names_page(),
        "configurations": configurations_page(),
        "robots": robots_page(),
        "franka_errors": franka_errors_page(),
        "yaml": yaml_page(json.loads((Path(app.srcdir) / SCHEMA).read_text())),
        **{f"hsp.{name}": page for name, page in namespace_pages()},
    }
    benchmarks = Path(app.srcdir) / BENCHMARKS
    for file in benchmarks.glob("results/*.md"):  # so that pages link to them
        pages[f"results/{file.stem}"] = _page(file)
    for file in benchmarks.glob("companions/*/results.md"):
        pages[f"results/{file.parent.name}"] = _page(file)
    for file in (Path(app.srcdir) / COMPANIONS).glob("*/page.md"):
        pages[f"companions/{file.parent.name}"] = _page(file)
    for name in ("results", "companions"):
        (folder / name).mkdir(exist_ok=True)
    for name, page in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != page:  # Sphinx reads it again
            path.write_text(page)
    for stale in (folder / "companions").glob("*.md"):  # of what was taken away
        if f"companions/{stale.stem}" not in pages:
            stale.unlink()


def _page(file: Path) -> str:
    """Return a page from elsewhere, whose links to pages of the site are absolute."""
    return re.sub(r"\]\((?:\.\./)+docs/", "](/", file.read_text(encoding="utf-8"))


def _here(app: Sphinx, name: str, source: list[str]) -> None:
    """Let links to tables and pages outside of docs lead to their pages in the site."""
    at = "](/reference/generated"
    tables = r"\]\((?:\.\./)+benchmarks/(?:results/(\w+)|companions/(\w+)/results)\.md"
    text = re.sub(tables, lambda f: f"{at}/results/{f[1] or f[2]}.md", source[0])
    pages = r"\]\((?:\.\./)+hsp_control/companions/(\w+)/page\.md"
    source[0] = re.sub(pages, rf"{at}/companions/\1.md", text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", write)
    app.connect("source-read", _here)
    return {"parallel_read_safe": True}
