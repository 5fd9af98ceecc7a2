"""Every error of a robot that cannot be loaded."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from places import ROOT
from robot_texts import ARM, INERTIA, gripper, joint, link, robot_xml
from wording import wording

from hsp_control import HspControlError, Robot
from hsp_control.common.errors import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    RobotNotFoundError,
)
from hsp_control.robot import ToolFrame


@pytest.mark.parametrize(("name", "message"), [
    ("pnada", "no ... 'pnada' ... 'panda'"),
    ("PANDA", "... 'panda'"),
    ("xyzzy", "... no robot 'xyzzy' ... .urdf"),
    ("robots/panda/", "... is a folder ... panda.urdf"),
    ("robots/panda", "... robots/panda is a folder ... .urdf"),
    ("./robots/panda", "... robots/panda is a folder ... .urdf"),
    ("robots", "... robots is a folder ... none"),
    ("", "no robot ''"),
    (300 * "a", "no robot 'aaa"),
    ("a\0b", r"no robot 'a\x00b'"),
    ("/nowhere/arm.urdf", "/nowhere/arm.urdf: no such file"),
    ("arm_without_folder.urdf", "arm_without_folder.urdf: no such file"),
])  # fmt: skip
def test_robot_not_found(
    name: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises(RobotNotFoundError, match=wording(message)) as caught:
        Robot.load(name)
    assert isinstance(caught.value, FileNotFoundError)
    assert isinstance(caught.value, HspControlError)


def test_missing_file_names_its_neighbour(write: Callable[..., Path]) -> None:
    path = write(ARM)
    with pytest.raises(RobotNotFoundError, match=r"no such file; .* mean 'arm\.urdf'"):
        Robot.load(path.with_name("amr.urdf"))
    with pytest.raises(RobotNotFoundError, match="is a folder"):
        Robot.load(path.parent)


def test_file_that_may_not_be_read(
    write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    path = write(ARM)
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(RobotNotFoundError, match=r"arm\.urdf: Permission denied"):
        Robot.load(path)


def grown(*parts: str) -> str:
    """Return the arm's URDF with additional elements."""
    return ARM.replace("</robot>", "".join(parts) + "</robot>")


BUILD = "Pinocchio cannot build a model"
TWO_SHAPES = '<geometry><sphere radius="1"/><box size="1 1 1"/></geometry>'
SOFT = (
    '<safety_controller k_velocity="1" soft_lower_limit="4" soft_upper_limit="5"/>'
    "</joint>"
)
NO_ROBOTS = [
    ('<robot name="r">\n  <link name="a">\n</robot>', "... :3:3: malformed XML"),
    ("", "... arm.urdf:1:1: malformed XML: no element"),
    (b"\xff\xfe\x00\x00binary", "... arm.urdf:1: ... malformed XML"),
    ('<?xml version="1.0" encoding="no-such"?>' + ARM, "... unknown encoding"),
    ("<mujoco/>", "... <robot> ... robot: {mjcf: FILE}"),
    ("<robot/>", f"... {BUILD}: No name given"),
    (ARM.replace('lower="-3" upper="3"', 'lower="3" upper="-3"', 1),
     "... joint 'shoulder': ... 3 ... upper limit -3"),
    (robot_xml(link("a"), link("b"), joint("j", "a", "b", "fixed")),
     "... no moving joint"),
    (grown(joint("j", "lower", "b")), f"... {BUILD} ... child link [b] of joint [j]"),
    (grown(joint("second", "base", "lower")),
     "... link 'lower': ... 'elbow' and 'second'"),
    (grown(link("c"), joint("own", "c", "c")), "... links 'c': ... 'own' ... loop"),
    (grown(link("c")), "... links 'base', 'c': ... child"),
    (grown(link("c"), link("d"), joint("cd", "c", "d"), joint("dc", "d", "c")),
     "... links 'c', 'd': ... 'dc', 'cd' ... loop"),
    (grown("<arm>", link("c"), joint("wrist", "lower", "c"), "</arm>"),
     "... joint 'wrist': ... <joint> in <arm> ... <robot>"),
    (grown('<Link name="c"/>'), "... link 'c': ... <Link> ... <link>"),
    (grown(link("base")), "... link 'base': 2 links ... name"),
    (grown(joint("elbow", "base", "lower")), "... joint 'elbow': 2 joints ... name"),
    (ARM.replace('<mass value="2"/>', '<mass value="2"/><mass value="3"/>', 1),
     "... link 'upper': <inertial>: ... 2 ... <mass>"),
    (ARM.replace("<axis", '<axis xyz="1 0 0"/><axis', 1),
     "... joint 'shoulder': <joint>: ... 2 ... <axis>"),
    (ARM.replace(INERTIA, f"<collision>{TWO_SHAPES}</collision>", 1),
     "... link 'upper': <geometry>: ... sphere, box"),
    (ARM.replace('<mass value="2"/>', '<mass value="٢"/>', 1),
     "... link 'upper': <mass>: value=\"٢\" ... digits"),
    (ARM.replace('xyz="0.2 0.1 0.3"', 'xyz="0.2 0.1 ３"', 1),
     '... xyz="0.2 0.1 ３" ... digits'),
    (ARM.replace("</joint>", '<mimic joint="ghost"/></joint>', 1),
     "... joint 'shoulder' mimics 'ghost'"),
    (gripper().replace('mimic joint="shoulder"', 'mimic joint="follower"'),
     "... 'follower' mimics 'follower' ... mimic=False"),
    (gripper().replace("</joint>", '<mimic joint="follower"/></joint>', 1),
     "... 'follower' mimics 'shoulder' ... mimic=False"),
    (gripper().replace('"shoulder" type="revolute"', '"shoulder" type="floating"'),
     "... 'shoulder' is mimicked ... floating ... revolute"),
    (gripper().replace('"follower" type="revolute"', '"follower" type="planar"'),
     "... 'follower' mimics ... planar ... revolute"),
    (gripper().replace("</joint>", SOFT, 1),
     "... joint 'shoulder': <safety_controller>: ... 4 to 5 ... -3 to 3"),
    (gripper().replace("</joint>", SOFT.replace("4", "soft"), 1),
     "... joint 'shoulder': <safety_controller>: ... \"soft\" ... number"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), NO_ROBOTS)
def test_file_that_is_no_robot(
    text: str | bytes, message: str, write: Callable[..., Path]
) -> None:
    path = write(text)
    with pytest.raises(ModelError, match=wording(message)) as caught:
        Robot.load(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "options"), [("bravo7_gripper", {}), ("romeo", {"mimic": False})]
)
def test_hint_to_lock_joints_that_move_no_mass_helps(
    name: str, options: dict[str, Any]
) -> None:
    """The YAML that the message suggests is the cure."""
    pytest.importorskip("example_robot_data")
    with pytest.raises(ModelError, match="lock the joints: locked: ") as caught:
        Robot.load(name, **options)
    hint = yaml.safe_load(str(caught.value).split("lock the joints: ")[1])
    robot = Robot.load(name, **hint, **options)
    assert not set(hint["locked"]) & set(robot.joint_names)


def test_elements_that_the_parser_skips_are_an_error(
    write: Callable[..., Path],
) -> None:
    text = ARM.replace('ixy="0"', "", 1)
    with pytest.raises(ModelError, match=r"leaves out a part of the model: .*upper\]"):
        Robot.load(write(text))


def test_root_and_joint_that_do_the_same(write: Callable[..., Path]) -> None:
    """A massless base that yaws about its first joint's axis: one joint is
    redundant."""
    text = robot_xml(
        link("base", ""), link("upper"), joint("shoulder", "base", "upper")
    )
    path = write(text.replace(' rpy="0.3 0.2 0.1"', ""))
    assert Robot.load(path).nv == 1
    with pytest.raises(ModelError, match=r"no mass moves with (root_joint|shoulder),"):
        Robot.load(path, root="planar")


OPTIONS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"root": "free_flier"}, ModelError,
     "RobotDescription: root: unknown ... 'free_flier' ... 'free_flyer'"),
    ({"locked": {"sholder": 0.0}}, JointNotFoundError, "... 'sholder' ... 'shoulder'"),
    ({"locked": {"universe": 0.0}}, JointNotFoundError,
     "... 'universe' ... no such joint"),
    ({"locked": {"shoulder": 0.0, "elbow": 1.0}}, ModelError,
     "... every joint is locked"),
    ({"locked": {"elbow": float("nan")}}, ModelError,
     "RobotDescription: locked.elbow: nan ... finite"),
    ({"root": "free_flyer", "locked": {"root_joint": 0.0}}, ModelError,
     "... 'root_joint' ... 6 degrees ... root: fixed"),
    ({"tool_frames": {"pen": ToolFrame("lowr")}}, FrameNotFoundError,
     "tool frame 'pen': no ... 'lowr' ... 'lower'"),
    ({"tool_frames": {"elbow": ToolFrame("lower")}}, ModelError,  # joints are frames
     "... tool frame 'elbow' ... this name"),
    ({"gravity": (0.0, -9.81)}, ModelError,
     "RobotDescription: gravity: (0.0, -9.81) ... 2 ... 3"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "error", "message"), OPTIONS)
def test_option_that_does_not_fit(
    options: dict[str, Any],
    error: type[Exception],
    message: str,
    write: Callable[..., Path],
) -> None:
    with pytest.raises(error, match=wording(message)) as caught:
        Robot.load(write(ARM), **options)
    assert isinstance(caught.value, HspControlError)


def test_a_pipe_is_not_read_for_ever(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "arm.urdf")
    with pytest.raises(RobotNotFoundError, match="a device or a pipe, which may never"):
        Robot.load(tmp_path / "arm.urdf")
    os.mkfifo(tmp_path / "package.xml")  # read where a mesh is looked up
    (tmp_path / "b.urdf").write_text(robot_xml(link("a")))
    with pytest.raises(ModelError, match="no moving joint"):
        Robot.load(tmp_path / "b.urdf")
