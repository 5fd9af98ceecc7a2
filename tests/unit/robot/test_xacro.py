"""Xacro files: expanded if xacro is installed, otherwise an exact message."""

import sys
from pathlib import Path
from types import ModuleType
from xml.dom import minidom

import pytest
from robot_texts import ARM

from hsp_control import Robot
from hsp_control.common.errors import AccessError, ModelError
from hsp_control.robot import RobotDescription
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.sources import find_robot
from hsp_control.robot.description.xacro_files import xacro_text

XACRO = ARM.replace(
    '<robot name="made_up">',
    '<robot name="made_up" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    '<xacro:arg name="mass" default="2"/>',
).replace('<mass value="2"/>', '<mass value="$(arg mass)"/>')


class ArgumentMissingError(Exception):
    """The stand-in's error for an argument without a value."""


@pytest.fixture
def xacro(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A stand-in for xacro, with arguments and $(find) only."""
    package, args = ModuleType("xacro"), ModuleType("xacro.substitution_args")

    def process_file(name: str, mappings: dict[str, str]) -> minidom.Document:
        text = (
            Path(name).read_text().replace('<xacro:arg name="mass" default="2"/>', "")
        )
        if "$(find thing)" in text:
            text = text.replace("$(find thing)", args._eval_find("thing"))
        if mappings.get("mass") == "none":
            raise ArgumentMissingError("Undefined substitution argument mass")
        if "mass" not in mappings:
            mappings["mass"] = "2"
        return minidom.parseString(text.replace("$(arg mass)", mappings["mass"]))

    args._eval_find, args._eval_dict = None, {}  # type: ignore[attr-defined]
    package.process_file = process_file  # type: ignore[attr-defined]
    package.substitution_args = args  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "xacro", package)
    monkeypatch.setitem(sys.modules, "xacro.substitution_args", args)
    return package


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.xacro", "arm.urdf"])
def test_a_xacro_file_of_any_name_is_expanded(
    name: str, tmp_path: Path, xacro: ModuleType
) -> None:
    path = tmp_path / name
    path.write_text(XACRO)
    robot = Robot.load(path)
    assert robot.name == "arm"
    assert robot.source.urdf == path
    assert robot.model.inertias[1].mass == 2.0
    heavy = Robot.load(RobotDescription(path, xacro_args={"mass": 3}))
    assert heavy.model.inertias[1].mass == 3.0


def test_packages_are_found_without_ros(
    tmp_path: Path, xacro: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = (
        '<visual><geometry><mesh filename="$(find thing)/a.stl"/></geometry></visual>'
    )
    path = tmp_path / "robots" / "arm.xacro"
    path.parent.mkdir()
    path.write_text(XACRO.replace('<link name="upper">', f'<link name="upper">{mesh}'))
    with pytest.raises(ModelError, match=r"arm\.xacro: .* no package 'thing' beside"):
        Robot.load(path)
    (tmp_path / "ros" / "thing").mkdir(parents=True)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    assert f"{tmp_path}/ros/thing/a.stl" in str(find_robot(path).expanded)
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    (tmp_path / "package.xml").write_text("<package><name>thing</name></package>")
    assert f"{tmp_path}/a.stl" in str(find_robot(path).expanded)
    assert xacro.substitution_args._eval_find is None  # as it was


def test_without_xacro_the_message_has_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    macros = '<!-- <xacro:property name="mass" value="2"/> -->'
    commented = tmp_path / "expanded.urdf"
    commented.write_text(ARM.replace("<link", macros + "<link", 1))
    assert Robot.load(commented).nv == 2
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(XACRO)
    with pytest.raises(ModelError, match=r"xacro arm\.urdf > arm_expanded\.urdf$"):
        Robot.load(urdf)
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    message = (
        r"pip install xacro, or expand it first: xacro arm\.urdf\.xacro > arm\.urdf$"
    )
    with pytest.raises(ModelError, match=message):
        Robot.load(path)


def test_mistakes_are_those_of_the_file(tmp_path: Path, xacro: ModuleType) -> None:
    path = tmp_path / "arm.xacro"
    path.write_text(XACRO)
    with pytest.raises(
        ModelError, match=r"Undefined .* mass; give it by xacro_args, or"
    ):
        Robot.load(path, xacro_args={"mass": "none"})
    with pytest.raises(ModelError, match=r"panda is no xacro file"):
        Robot.load("panda", xacro_args={"mass": 1})
    plain = tmp_path / "plain.urdf"
    plain.write_text(ARM)
    with pytest.raises(ModelError, match=r"plain\.urdf is no xacro file"):
        Robot.load(plain, xacro_args={"mass": 1})
    wrong = r"no argument 'mas'; did you mean 'mass'"
    with pytest.raises(ModelError, match=wrong):
        Robot.load(path, xacro_args={"mas": 1})
    with pytest.raises(AccessError, match="no xacro file, because it is a program"):
        Robot.load(path, access=only_within([tmp_path]))


def test_arguments_are_written_as_in_xacro() -> None:
    given = [True, 7, 7.0, 0.25, "left_"]
    assert [xacro_text(each) for each in given] == ["true", "7", "7", "0.25", "left_"]
