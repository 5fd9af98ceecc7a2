"""Every page runs as it stands: README, tutorial, recipes, companions and the rest."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_runner import OUTPUT, blocks_of, run_page, runs_commands
from places import ROOT, THOROUGH

from hsp_control.null_space.fields.weight import sample_weight

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
"""Pages whose commands always run; others' commands run in real time."""
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


# --- claims of a page about the variables of its Python -------------------------------


def the_readme(space: dict[str, Any]) -> None:
    """The law's exponential on the user's own cost."""
    rollout = space["rollout"]
    assert np.isfinite(space["output"].tau).all()
    assert Path("out/elbow.npz").is_file()
    decay = np.exp(-8.0 * rollout.t) * rollout["null_space_norm"][0]
    np.testing.assert_allclose(rollout["null_space_norm"], decay, rtol=1e-4, atol=1e-8)


def the_tutorial(space: dict[str, Any]) -> None:
    assert space["error"].max() < 1e-9
    assert space["difference"] < 1e-8


def the_live_page(space: dict[str, Any]) -> None:
    assert space["report"].ended == "completed"
    fields, state = space["controller"].field.terms, space["controller"].state
    weights = {each.name: sample_weight(each.weight, state)[0] for each in fields}
    assert weights == {"obstacle_clearance": 0.0, "target_posture": 0.0, "calm": 1.0}
    assert space["run"].status == "completed"


CLAIMS = {
    "README.md": the_readme,
    "docs/tutorial/ten_minutes.md": the_tutorial,
    "docs/live.md": the_live_page,
}


def runs(page: str, folder: Path, monkeypatch: pytest.MonkeyPatch, whole: bool) -> None:
    space = run_page(page, folder, whole=whole)
    monkeypatch.chdir(folder)
    if page in CLAIMS:
        CLAIMS[page](space)


@pytest.mark.parametrize(
    "page", [each for each in WITH_BLOCKS if each not in WITH_COMMANDS]
)
def test_python_and_configurations_of_a_page_run(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs(page, tmp_path, monkeypatch, whole=False)


@pytest.mark.process
@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", WITH_COMMANDS)
def test_a_page_runs_with_its_commands(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs(page, tmp_path, monkeypatch, whole=True)


def test_each_page_with_claims_is_run() -> None:
    assert set(CLAIMS) <= set(WITH_BLOCKS)


@pytest.mark.parametrize(("page", "block"), NOT_RUN)
def test_a_block_is_not_run(page: str, block) -> None:
    assert block.reason
    pytest.skip(f"{page}:{block.line}: {block.reason}")


@pytest.mark.parametrize("page", WITH_BLOCKS)
def test_commands_stand_in_blocks_of_commands(page: str) -> None:
    """A block of text is output and is not run."""
    commands = {"hsp", "make", "pip", "python", "git", "cd", "source", "sudo"}
    for block in blocks_of(page):
        assert block.language, f"{page}:{block.line} does not name its language"
        if block.language in OUTPUT and block.kind != "not run":
            first = {line.split(" ")[0] for line in block.text.splitlines()}
            assert not first & commands, f"{page}:{block.line}"
