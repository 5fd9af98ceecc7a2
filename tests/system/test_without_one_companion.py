"""The folder of any companion can be deleted, together with its dependents.

In a copy of the checkout, the remaining code passes lint and type checks, and its tests
are collected.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from places import ROOT, further

grimp = pytest.importorskip("grimp")  # the tool behind lint-imports

pytestmark = pytest.mark.slow

TIME_LIMIT = 1200.0  # [s], ends a process that hangs
FOLDER = "hsp_control/companions"
CACHE = ".mypy_cache"
COMPANIONS = sorted(each.parent.name for each in (ROOT / FOLDER).glob("*/__init__.py"))
CHECKS = {
    "layers": "from importlinter.cli import lint_imports_command as run",
    "types": "from mypy.__main__ import console_entry as run",
    "style": "from ruff.__main__ import find_ruff_bin; import os; run = lambda: "
    "os.execv(find_ruff_bin(), ['ruff', 'check', '--quiet'])",
    "tests": "import pytest, sys; run = lambda: "
    "sys.exit(pytest.main(['--collect-only', '-q', '-p', 'no:randomly']))",
    "links": "import pytest, sys; run = lambda: "
    "sys.exit(pytest.main(['tests/unit/test_links.py', '-q', '-n0']))",
}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy in which folders are moved away and back."""
    if not ROOT.joinpath(".git").exists():
        pytest.skip("not in a checkout")
    copy = tmp_path_factory.mktemp("checkout")
    tracked = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    libraries = (ROOT / "hsp_control" / "engine").glob("*.so")
    for name in (*tracked, *(str(each.relative_to(ROOT)) for each in libraries)):
        if name and (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name, follow_symlinks=False)
    if (ROOT / CACHE).is_dir():
        shutil.copytree(ROOT / CACHE, copy / CACHE)
    return copy


def built_on(companion: str) -> set[str]:
    """Return a companion, and those that import it or name it in a configuration."""
    graph = grimp.build_graph("hsp_control", cache_dir=None)
    package = f"hsp_control.companions.{companion}"
    importers = graph.find_downstream_modules(package, as_package=True)
    named = {
        file.relative_to(ROOT / FOLDER).parts[0]
        for file in (ROOT / FOLDER).glob("*/configs/**/*.yaml")
        if f"type: {companion}" in file.read_text(encoding="utf-8")
    }
    return {companion} | named | {each.split(".")[2] for each in importers
                          if each.startswith("hsp_control.companions.")}  # fmt: skip


@contextmanager
def deleted(checkout: Path, names: set[str]) -> Iterator[None]:
    """Within the block the folders of some companions are absent."""
    aside = checkout.with_name("aside")
    aside.mkdir()
    for name in names:
        (checkout / FOLDER / name).rename(aside / name)
    try:
        yield
    finally:
        for name in names:
            shutil.rmtree(checkout / FOLDER / name, ignore_errors=True)
            (aside / name).rename(checkout / FOLDER / name)
        aside.rmdir()


@pytest.mark.timeout(TIME_LIMIT)
@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("companion", further(*COMPANIONS))
def test_the_remaining_checkout_is_complete(
    companion: str, check: str, checkout: Path
) -> None:
    with deleted(checkout, built_on(companion)):
        done = subprocess.run(
            [sys.executable, "-c", f"{CHECKS[check]}; run()"],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": str(checkout)},
            capture_output=True,
            text=True,
            timeout=TIME_LIMIT,
            check=False,
        )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
