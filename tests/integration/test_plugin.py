"""The example of a package that adds a task, a field, a plant and a robot."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT, further
from typing_commands import READY

EXAMPLE = ROOT / "examples" / "plugin"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with only the installed example."""
    folder = tmp_path_factory.mktemp("installed")
    source = tmp_path_factory.mktemp("source") / "plugin"
    copy = ["cp", "-r", str(EXAMPLE), str(source)]  # a build leaves files behind
    subprocess.run(copy, check=True)
    offline = ["--no-deps", "--no-index", "--no-build-isolation", "--quiet"]
    pip = [sys.executable, "-m", "pip", "install", *offline]
    # pip refuses constraints for a build without isolation.
    own = {k: v for k, v in os.environ.items() if k != "PIP_BUILD_CONSTRAINT"}
    subprocess.run([*pip, "--target", str(folder), str(source)], check=True, env=own)
    return folder


def hsp(installed: Path, line: str, where: Path, status: int = 0) -> str:
    """Run a command with the example installed, and return its output."""
    environment = os.environ | {"PYTHONPATH": str(installed)}
    found, printed = READY.run(line.split(), where, environment)
    assert found == status, f"hsp {line}\n{printed}"
    return printed


DEMO = str(EXAMPLE / "demo.yaml")


@pytest.mark.process
def test_its_types_work_in_a_configuration(installed: Path, tmp_path: Path) -> None:
    reported = hsp(installed, f"check {DEMO}", tmp_path)
    assert "FrameHeight, 1 rows" in reported
    assert "elbow_height" in reported
    assert "DampedPlant" in reported or "damped" in reported.lower()


@pytest.mark.process
def test_strict_reading_admits_it_by_name_only(installed: Path, tmp_path: Path) -> None:
    refused = hsp(installed, f"check --strict {DEMO}", tmp_path, status=2)
    assert "is of the package hsp_example" in refused
    assert "--allow hsp_example" in refused
    hsp(installed, f"check --allow hsp_example {DEMO}", tmp_path)


@pytest.mark.process
@pytest.mark.system
def test_it_runs_plots_and_exports(installed: Path, tmp_path: Path) -> None:
    hsp(installed, f"run {DEMO} --out . --set simulation.duration=0.3", tmp_path)
    log = "demo-simulation.duration=0.3.npz"
    for line in (
        *further(f"plot {log}"),
        f"export {log} --html demo.html",
        f"run {log} --out again",
    ):
        hsp(installed, line, tmp_path)


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize("workers", further(1))  # a worker finds types like any process
def test_it_sweeps(workers: int, installed: Path, tmp_path: Path) -> None:
    over = "--over plant.damping=0:2:2 --out s.parquet"
    line = f"sweep {DEMO} {over} --workers {workers}"
    hsp(installed, f"{line} --set simulation.duration=0.2", tmp_path)


@pytest.mark.process
@pytest.mark.system
def test_its_robot_is_reached_by_name(installed: Path, tmp_path: Path) -> None:
    live = f"live {DEMO} --robot"
    hsp(installed, f"{live} example://anywhere --duration 0.2", tmp_path)
    reported = hsp(installed, f"{live} exmaple://x", tmp_path, status=2)
    assert "did you mean example://ADDRESS?" in reported
