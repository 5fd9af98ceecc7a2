"""``hsp freeze``: a configuration's controller for a program without Python."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from frozen_library import Opened

from hsp_control.cli import main
from hsp_control.common.resources import bundled_configs
from hsp_control.frozen import cmake_folder, compiler_flags


def test_a_configuration_is_frozen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = ["--out", str(tmp_path / "new"), "--set", "simulation.control_period=0.002"]
    assert main(["freeze", "panda_limits", *where]) == 0
    file = tmp_path / "new/panda_limits.hsp"
    assert str(file) in capsys.readouterr().out.replace("\n", "")
    assert Opened(file).get("period", 1).tolist() == [0.002]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (
            "whole_body/talos_lift_foot",
            r"talos_lift_foot.yaml:\d+: tasks.left_sole.schedule: ",
        ),
        ("walking/talos_walk", r"talos_walk.yaml:\d+: plan: "),
        ("compliance/panda_cartesian_impedance", r"\.yaml:\d+: changes: "),
    ],
)
def test_parts_that_cannot_be_frozen_are_refused_with_their_place(
    config: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if config not in bundled_configs():
        pytest.skip("it belongs to a companion that is not there")
    assert main(["freeze", config, "--out", str(tmp_path)]) == 2
    reported = " ".join(capsys.readouterr().err.split())
    assert re.search(message, reported), reported
    assert not list(tmp_path.iterdir())


TWO = """\
robot: {name: panda}
tasks:
  hand: {type: frame_position}
  elbow: {type: frame_position, frame: panda_link4, axes: z}
"""


def test_a_task_that_comes_and_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.yaml").write_text(TWO)
    command = ["freeze", str(tmp_path / "two.yaml"), "--out", str(tmp_path)]
    assert main([*command, "--presence", "elbow"]) == 0
    assert Opened(tmp_path / "two.hsp").get("elbow.presence", 1).tolist() == [1.0]
    capsys.readouterr()
    for option, known in (("--presence", "; did you mean 'elbow'?"), ("--payload", "")):
        assert main([*command, option, "elbwo"]) == 2
        reported = " ".join(capsys.readouterr().err.split())
        assert re.search(
            rf"two\.yaml:1: {option}: .*'elbwo'{re.escape(known)}", reported
        )


@pytest.mark.parametrize(
    ("option", "place"),
    [
        ("--cmake-dir", cmake_folder),
        ("--flags", compiler_flags),
    ],
)
def test_where_the_library_is(
    option: str, place: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["freeze", option]) == 0
    assert capsys.readouterr().out.strip() == str(place())  # type: ignore[operator]


PAGE = Path(__file__).parents[3] / "docs/how_to/without_python.md"


@pytest.mark.process
@pytest.mark.smoke
def test_the_page_leads_to_an_arm_that_moves(tmp_path: Path) -> None:
    """The page's first section, in a shell, in an empty folder."""
    if not shutil.which("cc"):
        pytest.skip("there is no C compiler")
    section = PAGE.read_text("utf-8").split("\n## ")[1]
    found = re.findall(r"`([\w.]+)`[^`]*:\n\n```\w+\n(.*?)```", section, re.DOTALL)
    names = ["panda.yaml", "loop.c", "arm.py", "CMakeLists.txt"]
    assert [name for name, _ in found] == names
    for name, text in found:
        (tmp_path / name).write_text(text, "utf-8")
    commands = "".join(re.findall(r"```sh\n(.*?)```", section, re.DOTALL))
    shell = f'hsp() {{ {sys.executable} -m hsp_control "$@"; }}\n'
    shell += f'python() {{ {sys.executable} "$@"; }}\n'
    # Without CMake on the machine, the package's build brought its own.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    run = subprocess.run(
        ["bash", "-euc", shell + commands],
        cwd=tmp_path,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert not run.stderr
    moved = re.search(r"The hand moved by (\S+) m\.", run.stdout)
    assert moved
    assert float(moved[1]) == pytest.approx(0.2, abs=0.01)


def test_nothing_to_freeze(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["freeze"]) == 2
    assert "needs a configuration" in capsys.readouterr().err
