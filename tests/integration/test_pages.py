"""Every page runs as it stands: README, tutorial, recipes, companions and the rest."""

from pathlib import Path

import pytest
from page_runner import OUTPUT, blocks_of, run_page, runs_commands
from places import ROOT, THOROUGH

# No page starts a robot with a jump of its effort.
pytestmark = pytest.mark.filterwarnings("error:the first effort of joint:UserWarning")

FOLDERS = ("docs", "docs/tutorial", "docs/how_to")
ELSEWHERE = "hsp_control/companions/*/*.md"
PAGES = [
    "README.md",
    *sorted(
        page.relative_to(ROOT).as_posix()
        for folder in FOLDERS
        for page in (ROOT / folder).glob("*.md")
    ),
    *sorted(page.relative_to(ROOT).as_posix() for page in ROOT.glob(ELSEWHERE)),
    "docs/development/engine.md",
]
WITH_BLOCKS = [page for page in PAGES if blocks_of(page)]
FIRST = ("README.md", "docs/tutorial/", "docs/how_to/")
"""Whose commands run each time; those of the others keep pace with real time."""
WITH_COMMANDS = [
    page
    for page in WITH_BLOCKS
    if runs_commands(page) and (THOROUGH or page.startswith(FIRST))
]
NOT_RUN = [
    pytest.param(page, block, id=f"{page}:{block.line}")
    for page in WITH_BLOCKS
    for block in blocks_of(page)
    if block.kind == "not run"
]


def test_what_the_tutorial_prints_is_true(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    space = run_page("docs/tutorial/ten_minutes.md", tmp_path, whole=False)
    assert space["error"].max() < 1e-9
    assert space["difference"] < 1e-8


@pytest.mark.parametrize(
    "page", [each for each in WITH_BLOCKS if each not in WITH_COMMANDS]
)
def test_python_and_configurations_of_a_page_run(page: str, tmp_path: Path) -> None:
    run_page(page, tmp_path, whole=False)


@pytest.mark.process
@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", WITH_COMMANDS)
def test_a_page_runs_with_its_commands(page: str, tmp_path: Path) -> None:
    run_page(page, tmp_path, whole=True)


@pytest.mark.parametrize(("page", "block"), NOT_RUN)
def test_a_block_is_not_run(page: str, block) -> None:
    assert block.reason
    pytest.skip(f"{page}:{block.line}: {block.reason}")


@pytest.mark.parametrize("page", WITH_BLOCKS)
def test_commands_stand_in_blocks_of_commands(page: str) -> None:
    """A block of text is what something prints: nobody runs it."""
    commands = {"hsp", "make", "pip", "python", "git", "cd", "source", "sudo"}
    for block in blocks_of(page):
        assert block.language, f"{page}:{block.line} does not say its language"
        if block.language in OUTPUT and block.kind != "not run":
            first = {line.split(" ")[0] for line in block.text.splitlines()}
            assert not first & commands, f"{page}:{block.line}"
