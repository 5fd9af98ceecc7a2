"""Documents of this checkout link only to files that exist.

Links between pages of the site are checked when it is built, those to other sites by
`make links`; this covers README, notebooks and other documents outside of docs.
"""

import json
import os
import re
import sys
from pathlib import Path

import pytest
from places import ROOT

PATTERNS = (
    *("*.md", "*/*.md", "robots/*/*.md", "docs/**/*.md", "notebooks/*.ipynb"),
    "hsp_control/companions/**/*.md",
)
COMPANIONS = ROOT / "hsp_control" / "companions"
PACKAGE = (ROOT / "hsp_control" / "__init__.pyi").read_text(encoding="utf-8")
BUILT = ("_build", "generated")
LINK = re.compile(r"\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)|<img src=\"([^\"]+)\"", re.M)
CODE = re.compile(r"^(```|~~~|::::?).*?^\1|`[^`\n]+`", re.M | re.S)
DOCUMENTS = [
    file
    for pattern in PATTERNS
    for file in sorted(ROOT.glob(pattern))
    if not set(file.relative_to(ROOT).parts) & set(BUILT)
    and not file.relative_to(ROOT).parts[0].startswith(".")
]


def missing(text: str, folder: Path) -> list[str]:
    """Return a Markdown text's links to files that do not exist."""
    found = (next(filter(None, each)) for each in LINK.findall(CODE.sub("", text)))
    paths = {link.partition("#")[0] for link in found if ":" not in link}
    return sorted(
        path
        for path in paths
        if path and "/generated/" not in path and not (folder / path).exists()
        if not taken_away(Path(os.path.normpath(folder / path)))
    )


def taken_away(file: Path) -> bool:
    """Return whether a file belongs to a listed companion whose folder is missing."""
    if not file.is_relative_to(COMPANIONS):
        return False
    name = file.relative_to(COMPANIONS).parts[0]
    listed = f"from .companions import {name} as {name}\n"
    return listed in PACKAGE and not (COMPANIONS / name).exists()


@pytest.mark.parametrize(
    "file", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT))
)
def test_no_document_links_to_a_file_that_is_not_there(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if "outputs" not in cell]
        text = "\n\n".join("".join(cell["source"]) for cell in cells)
    assert missing(text, file.parent) == []


def test_a_companion_that_is_taken_away_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules[__name__], "COMPANIONS", tmp_path)
    (tmp_path / "rerun").mkdir()
    assert taken_away(tmp_path / "film" / "page.md")
    assert not taken_away(tmp_path / "rerun" / "page.md")
    assert not taken_away(tmp_path / "flim" / "page.md")


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "there.md").touch()
    text = (
        "[a](there.md#part) [b](gone.md) ![c](gone.png) [d](#here) [x](https://a.b/c)\n"
        "`[code](no.md)`\n\n```\n[fenced](no.md)\n```\n\n"
        "[e]: other.md\nthe clock [s]: at its first step\n"
    )
    assert missing(text, tmp_path) == ["gone.md", "gone.png", "other.md"]
