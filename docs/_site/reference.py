"""The reference's pages, written from the code: names, YAML keys, commands, files."""

import json
import re
from pathlib import Path

from bundled import configurations_page, franka_errors_page, robots_page
from names import names_page, namespace_pages
from sphinx.application import Sphinx
from yaml_keys import yaml_page

SCHEMA = "../configs/hsp_control.schema.json"
RESULTS = "../benchmarks/results"


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
    for file in (Path(app.srcdir) / RESULTS).glob("*.md"):  # so that pages link to them
        text = file.read_text(encoding="utf-8")
        pages[f"results/{file.stem}"] = text.replace("](../../docs/", "](/")
    (folder / "results").mkdir(exist_ok=True)
    for name, page in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != page:  # Sphinx reads it again
            path.write_text(page)


def _here(app: Sphinx, name: str, source: list[str]) -> None:
    """Let links to tables of benchmarks lead to their pages in the site."""
    pattern = r"\]\((?:\.\./)+benchmarks/results/(\w+\.md)"
    source[0] = re.sub(pattern, r"](/reference/generated/results/\1", source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", write)
    app.connect("source-read", _here)
    return {"parallel_read_safe": True}
