"""The lecture is one page: its pictures within, its frames the site's, no network."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from places import ROOT

pytest.importorskip("sphinx")
pytest.importorskip("latex2mathml")
from sphinx.errors import ExtensionError

LECTURE = ROOT / "docs" / "lecture" / "lecture.md"


def _load(path: Path) -> ModuleType:
    """Return a script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


lecture = _load(ROOT / "docs" / "_site" / "lecture.py")
known = _load(ROOT / "tools" / "replays.py").REPLAYS


@pytest.fixture
def replays(tmp_path: Path) -> Path:
    """Return a folder with a file for each replay of the site."""
    for name in known:
        (tmp_path / f"{name.replace('/', '-')}.html").touch()
    return tmp_path


def test_it_has_slides_pictures_and_frames_and_needs_no_network(replays: Path) -> None:
    text = lecture.page(LECTURE, "replays", replays)
    assert 15 <= text.count("<section") == text.count("</section>") <= 20
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert len(sources) > 30
    for source in sources:
        assert source.startswith(("replays/", "data:image/", "#")), source[:80]
    assert text.count("<iframe") >= 5
    assert text.count("data:image/png") >= 4
    assert 'alt=""' not in text


@pytest.mark.parametrize(("text", "message"), [
    ("```{replay} missing\n:title: A run\n```", "missing.html; `make docs` writes it"),
    ("![A figure](missing.png)", "there is no picture missing.png"),
])  # fmt: skip
def test_missing_names_are_reported(tmp_path: Path, text: str, message: str) -> None:
    source = tmp_path / "lecture.md"
    source.write_text(f"# Title\n\n{text}\n", encoding="utf-8")
    with pytest.raises(ExtensionError, match=message):
        lecture.page(source, "replays", tmp_path)
