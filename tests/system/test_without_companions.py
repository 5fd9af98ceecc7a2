"""The core alone: a copy of the checkout in which `companions` is empty."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT, THOROUGH

import hsp_control as hsp

pytestmark = pytest.mark.slow

TIME_LIMIT = 1200.0  # [s], ends a process that hangs
ROOMS = ["cli/test_cli.py", "cli/test_consoles.py"]
"""Tests that run in the copy: those near the companions (thorough: all)."""
THE_SAME = "check or robots or diverging or beyond"
"""Of these, names of tests whose commands use no companion."""
COMPANIONS = {each.name for each in (ROOT / "hsp_control/companions").glob("[a-z]*")}


def without_companions(folder: str, names: list[str]) -> set[str]:
    """Copy nothing from a folder called companions but its `__init__.py`."""
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
    """Use the kernels that are already compiled."""
    core = tmp_path_factory.mktemp("core")
    for each in ROOT.iterdir():
        if each.name in {"hsp_control", "tests", "configs"}:
            shutil.copytree(each, core / each.name, ignore=without_companions)
        elif not each.name.startswith(".") or each.name == ".dockerignore":
            (core / each.name).symlink_to(each)
    return core


def run(core: Path, *command: str) -> str:
    """Run a command with the copy's package; return its output."""
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
    reported = run(core, "pytest", *rooms, "-m", chosen, *named)
    assert " passed" in reported
    assert "failed" not in reported


@pytest.mark.parametrize("name", ["paper/4_moving_obstacle", "panda_obstacle"])
def test_the_demo_runs_as_before(core: Path, name: str) -> None:
    short = "simulation.duration=1"
    run(core, "hsp_control", "run", name, "--out", "out", "--set", short)
    (log,) = (core / "out").glob(f"{Path(name).name}-{short}.npz")
    here = hsp.load_experiment(name, short).run()
    there = hsp.Rollout.load(log)
    assert (there.tau == here.tau).all()


def test_removed_parts_are_unknown(core: Path) -> None:
    reported = run(core, "hsp_control", "--help")
    assert "check" in reported
    assert not {"sweep", "franka-box", "view", "play", "export"} & set(reported.split())
    assert "--view" not in run(core, "hsp_control", "run", "--help")
