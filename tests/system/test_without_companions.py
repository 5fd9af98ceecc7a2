"""The core alone: a copy of the checkout without what stands in `companions`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT, THOROUGH

import hsp_control as hsp

pytestmark = pytest.mark.slow

TIME_LIMIT = 1200.0  # s; only ends what hangs
ROOMS = ["cli/test_cli.py", "cli/test_consoles.py"]
"""The tests that run in the copy unless thorough: those that meet companions."""
THE_SAME = "check or robots or diverging or beyond"
"""Of these, names of tests in whose commands companions have no part."""
COMPANIONS = {each.name for each in (ROOT / "hsp_control/companions").glob("[a-z]*")}


def without_companions(folder: str, names: list[str]) -> set[str]:
    """Of a folder called companions only what makes it a package remains."""
    if Path(folder).name == "companions":
        return set(names) - {"__init__.py"}
    if "configs" not in Path(folder).parts:
        return set()
    files = {each.name for each in Path(folder).glob("*.yaml") if needs_mujoco(each)}
    return (COMPANIONS | files) & set(names)


def needs_mujoco(configuration: Path) -> bool:
    """Return whether a configuration's plant is a companion's."""
    return "mujoco" in configuration.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the kernels that are compiled already."""
    core = tmp_path_factory.mktemp("core")
    for each in ROOT.iterdir():
        if each.name in {"hsp_control", "tests", "configs"}:
            shutil.copytree(each, core / each.name, ignore=without_companions)
        elif not each.name.startswith(".") or each.name == ".dockerignore":
            (core / each.name).symlink_to(each)
    return core


def run(core: Path, *command: str) -> str:
    """Return what a command prints, which runs with the copy's package."""
    environment = {**os.environ, "PYTHONPATH": str(core), "PYTHONWARNINGS": ""}
    done = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=core,
        env=environment,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


@pytest.mark.timeout(TIME_LIMIT)
def test_the_quick_tests_pass(core: Path) -> None:
    chosen = "not slow and not process and not browser"
    rooms = ["tests/unit"] if THOROUGH else [f"tests/unit/{room}" for room in ROOMS]
    named = () if THOROUGH else ("-k", f"not ({THE_SAME})")
    told = run(core, "pytest", *rooms, "-m", chosen, *named)
    assert " passed" in told
    assert "failed" not in told


@pytest.mark.parametrize("name", ["paper/4_moving_obstacle", "panda_obstacle"])
def test_the_demo_runs_as_before(core: Path, name: str) -> None:
    short = "simulation.duration=1"
    run(core, "hsp_control", "run", name, "--out", "out", "--set", short)
    (log,) = (core / "out").glob(f"{Path(name).name}-{short}.npz")
    here = hsp.load_experiment(name, short).run()
    there = hsp.Rollout.load(log)
    assert (there.tau == here.tau).all()


def test_what_is_gone_is_not_known(core: Path) -> None:
    told = run(core, "hsp_control", "--help")
    assert "check" in told
    assert not {"sweep", "franka-box", "view", "play", "export"} & set(told.split())
    assert "--view" not in run(core, "hsp_control", "run", "--help")
