"""The example of a package that adds a task, a field, a plant and a robot."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

EXAMPLE = ROOT / "examples" / "plugin"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which the example is installed, and nothing else."""
    folder = tmp_path_factory.mktemp("installed")
    source = tmp_path_factory.mktemp("source") / "plugin"
    copy = ["cp", "-r", str(EXAMPLE), str(source)]  # a build leaves files behind
    subprocess.run(copy, check=True)
    offline = ["--no-deps", "--no-index", "--no-build-isolation", "--quiet"]
    pip = [sys.executable, "-m", "pip", "install", *offline]
    # pip refuses constraints for a build that uses what is there.
    own = {k: v for k, v in os.environ.items() if k != "PIP_BUILD_CONSTRAINT"}
    subprocess.run([*pip, "--target", str(folder), str(source)], check=True, env=own)
    return folder


def hsp(
    folder: Path | None, *words: str, where: Path
) -> "subprocess.CompletedProcess[str]":
    """Run a command with the example installed, or without it."""
    paths = [str(ROOT), *([str(folder)] if folder else [])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.run(
        [sys.executable, "-m", "hsp_control", *words],
        env=environment,
        cwd=where,
        capture_output=True,
        text=True,
        check=False,
    )


DEMO = str(EXAMPLE / "demo.yaml")


@pytest.mark.process
def test_its_types_work_in_a_configuration(installed: Path, tmp_path: Path) -> None:
    ran = hsp(installed, "check", DEMO, where=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "FrameHeight, 1 rows" in ran.stdout
    assert "elbow_height" in ran.stdout
    assert "DampedPlant" in ran.stdout or "damped" in ran.stdout.lower()


@pytest.mark.process
def test_strict_reading_admits_it_by_name_only(installed: Path, tmp_path: Path) -> None:
    refused = hsp(installed, "check", "--strict", DEMO, where=tmp_path)
    assert refused.returncode == 2
    assert "is of the package hsp_example" in refused.stderr
    assert "--allow hsp_example" in refused.stderr
    admitted = hsp(installed, "check", "--allow", "hsp_example", DEMO, where=tmp_path)
    assert admitted.returncode == 0, admitted.stderr


@pytest.mark.process
@pytest.mark.system
@pytest.mark.slow
def test_it_runs_plots_and_exports(installed: Path, tmp_path: Path) -> None:
    short = ["--set", "simulation.duration=0.3"]
    ran = hsp(installed, "run", DEMO, "--out", ".", *short, where=tmp_path)
    assert ran.returncode == 0, ran.stderr
    log = "demo-simulation.duration=0.3.npz"
    for words in (
        ["plot", log],
        ["export", log, "--html", "demo.html"],
        ["run", log, "--out", "again"],
    ):
        ran = hsp(installed, *words, where=tmp_path)
        assert ran.returncode == 0, ran.stderr


@pytest.mark.process
@pytest.mark.slow
def test_it_sweeps(installed: Path, tmp_path: Path) -> None:
    words = ["sweep", DEMO, "--over", "plant.damping=0:2:2", "--out", "s.parquet"]
    short = ["--set", "simulation.duration=0.2", "--workers", "1"]
    ran = hsp(installed, *words, *short, where=tmp_path)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.process
@pytest.mark.system
@pytest.mark.slow
def test_its_robot_is_reached_by_name(installed: Path, tmp_path: Path) -> None:
    words = ["live", DEMO, "--robot", "example://anywhere", "--duration", "0.2"]
    ran = hsp(installed, *words, where=tmp_path)
    assert ran.returncode == 0, ran.stderr
    ran = hsp(installed, "live", DEMO, "--robot", "exmaple://x", where=tmp_path)
    assert ran.returncode == 2
    assert "did you mean example://ADDRESS?" in ran.stderr
