"""Robots by their names in robot_descriptions; a stand-in for the package."""

import sys
from pathlib import Path

import pytest
from robot_texts import ARM

from hsp_control import Robot
from hsp_control.common.errors import AccessError, RobotNotFoundError
from hsp_control.robot import PlacedRobot, RobotDescription
from hsp_control.robot.description.access import only_within

MODULE = """
print("Cloning a repository...")
REPOSITORY_PATH = {folder!r}
PACKAGE_PATH = {folder!r} + "/arm_package"
URDF_PATH = PACKAGE_PATH + "/arm.urdf"
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a robot, one in another format, and one that cannot be fetched."""
    folder = tmp_path / "site" / "robot_descriptions"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text(
        "from types import SimpleNamespace as Of\n"
        "DESCRIPTIONS = {'arm_description': Of(has_urdf=True),"
        " 'lost_description': Of(has_urdf=True),"
        " 'arm_mj_description': Of(has_urdf=False)}\n"
    )
    data = tmp_path / "cache"
    (data / "arm_package").mkdir(parents=True)
    (data / "arm_package" / "arm.urdf").write_text(ARM)
    (folder / "arm_description.py").write_text(MODULE.format(folder=str(data)))
    (folder / "lost_description.py").write_text("raise OSError('no route to host')")
    monkeypatch.syspath_prepend(str(folder.parent))
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, name)
    return data


@pytest.mark.usefixtures("installed")
def test_by_name_and_by_description(capsys: pytest.CaptureFixture[str]) -> None:
    named = Robot.load("arm_description")
    assert capsys.readouterr().out == ""  # cloning is reported on standard error
    described = Robot.load(RobotDescription(description="arm_description"))
    assert named.source == described.source
    assert named.name == "arm_description"
    assert named.source.origin == "robot_descriptions"
    parts = {side: PlacedRobot(description="arm_description") for side in "lr"}
    assert Robot.load(RobotDescription(parts=parts)).nv == 2 * named.nv


@pytest.mark.usefixtures("installed")
def test_robots_that_it_does_not_have() -> None:
    with pytest.raises(RobotNotFoundError, match="no URDF of 'amr_description'; did"):
        Robot.load(RobotDescription(description="amr_description"))
    with pytest.raises(RobotNotFoundError, match="no URDF of 'arm_mj_description'"):
        Robot.load("arm_mj_description")
    with pytest.raises(RobotNotFoundError, match=r"fetch 'lost_.*: no route to host"):
        Robot.load("lost_description")
    with pytest.raises(AccessError, match="fetched from a network"):
        Robot.load("arm_description", access=only_within([]))
