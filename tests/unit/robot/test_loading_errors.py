"""Check every error of a robot that cannot be loaded."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from places import ROOT
from robot_texts import ARM, INERTIA, gripper, joint, link, robot_xml

from hsp_control import HspControlError, Robot
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    RobotNotFoundError,
)
from hsp_control.robot import ToolFrame


@pytest.mark.parametrize(("name", "message"), [
    ("pnada", "no robot 'pnada'; did you mean 'panda'?"),
    ("PANDA", "did you mean 'panda'?"),
    ("xyzzy", "no robot 'xyzzy' (give a path to a .urdf file, or one of: "),
    ("robots/panda/", "is a folder; give a .urdf file in it (it contains panda."),
    ("robots/panda", "robots/panda is a folder; give a .urdf file in it (it contains"),
    ("./robots/panda", "robots/panda is a folder; give a .urdf file in it (it contai"),
    ("robots", "robots is a folder; give a .urdf file in it (it contains none)"),
    ("", "no robot ''"),
    (300 * "a", "no robot 'aaa"),
    ("a\0b", "no robot 'a\\x00b'"),
    ("/nowhere/arm.urdf", "/nowhere/arm.urdf: no such file"),
    ("arm_without_folder.urdf", "arm_without_folder.urdf: no such file"),
])  # fmt: skip
def test_robot_not_found(
    name: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises(RobotNotFoundError, match=re.escape(message)) as caught:
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
    """Return the arm with more elements."""
    return ARM.replace("</robot>", "".join(parts) + "</robot>")


BUILD = "Pinocchio cannot build a model"
TWO_SHAPES = '<geometry><sphere radius="1"/><box size="1 1 1"/></geometry>'
SOFT = (
    '<safety_controller k_velocity="1" soft_lower_limit="4" soft_upper_limit="5"/>'
    "</joint>"
)
NO_ROBOTS = [
    ('<robot name="r">\n  <link name="a">\n</robot>', r":3:3: malformed XML: mism"),
    ("", r"arm\.urdf:1:1: malformed XML: no element found"),
    (b"\xff\xfe\x00\x00binary", r"arm\.urdf:1:\d+: malformed XML"),
    ('<?xml version="1.0" encoding="no-such"?>' + ARM, "malformed XML: unknown enc"),
    ("<mujoco/>", "in a URDF it is <robot>; an MJCF's robot is robot: {mjcf: FILE}"),
    ("<robot/>", BUILD + ": No name given for the robot"),
    (ARM.replace('lower="-3" upper="3"', 'lower="3" upper="-3"', 1),
     "joint 'shoulder': its lower limit 3 is above its upper limit -3"),
    (robot_xml(link("a"), link("b"), joint("j", "a", "b", "fixed")),
     "the robot has no moving joint"),
    (grown(joint("j", "lower", "b")), BUILD + r".* child link \[b\] of joint \[j\] n"),
    (grown(joint("second", "base", "lower")),
     "link 'lower': it is the child of the joints 'elbow' and 'second'; must be of on"),
    (grown(link("c"), joint("own", "c", "c")),
     "links 'c': their joints 'own' make a loop"),
    (grown(link("c")), "links 'base', 'c': none is the child of a joint; a robot has "),
    (grown(link("c"), link("d"), joint("cd", "c", "d"), joint("dc", "d", "c")),
     "links 'c', 'd': their joints 'dc', 'cd' make a loop"),
    (grown("<arm>", link("c"), joint("wrist", "lower", "c"), "</arm>"),
     "joint 'wrist': parsers skip <joint> in <arm>; must be <joint> in <robot>"),
    (grown('<Link name="c"/>'), "link 'c': parsers skip <Link>; must be <link> in <r"),
    (grown(link("base")), "link 'base': 2 links have this name"),
    (grown(joint("elbow", "base", "lower")), "joint 'elbow': 2 joints have this name"),
    (ARM.replace('<mass value="2"/>', '<mass value="2"/><mass value="3"/>', 1),
     "link 'upper': <inertial>: contains 2 elements <mass>; must be one"),
    (ARM.replace("<axis", '<axis xyz="1 0 0"/><axis', 1),
     "joint 'shoulder': <joint>: contains 2 elements <axis>; must be one"),
    (ARM.replace(INERTIA, f"<collision>{TWO_SHAPES}</collision>", 1),
     "link 'upper': <geometry>: contains sphere, box; must be one shape"),
    (ARM.replace('<mass value="2"/>', '<mass value="٢"/>', 1),
     "link 'upper': <mass>: value=\"٢\" must be a number in the digits 0 to 9"),
    (ARM.replace('xyz="0.2 0.1 0.3"', 'xyz="0.2 0.1 ３"', 1),
     'xyz="0.2 0.1 ３" must be 3 numbers in the digits 0 to 9'),
    (ARM.replace("</joint>", '<mimic joint="ghost"/></joint>', 1),
     "joint 'shoulder' mimics 'ghost', which is not a moving joint; load its"),
    (gripper().replace('mimic joint="shoulder"', 'mimic joint="follower"'),
     "joint 'follower' mimics 'follower', which follows itself; load .*mimic=False"),
    (gripper().replace("</joint>", '<mimic joint="follower"/></joint>', 1),
     "joint 'follower' mimics 'shoulder', which follows it; load .*mimic=False"),
    (gripper().replace('"shoulder" type="revolute"', '"shoulder" type="floating"'),
     "joint 'shoulder' is mimicked but is floating; must be one of revolute, cont"),
    (gripper().replace('"follower" type="revolute"', '"follower" type="planar"'),
     "joint 'follower' mimics but is planar; must be one of revolute, cont"),
    (gripper().replace("</joint>", SOFT, 1),
     "joint 'shoulder': <safety_controller>: the soft limits 4 to 5 leave nothing of "
     "its limits -3 to 3"),
    (gripper().replace("</joint>", SOFT.replace("4", "soft"), 1),
     "joint 'shoulder': <safety_controller>: soft_lower_limit=\"soft\" must be a num"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), NO_ROBOTS)
def test_file_that_is_no_robot(
    text: str | bytes, message: str, write: Callable[..., Path]
) -> None:
    path = write(text)
    with pytest.raises(ModelError, match=message) as caught:
        Robot.load(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "options"), [("bravo7_gripper", {}), ("romeo", {"mimic": False})]
)
def test_hint_to_lock_joints_that_move_no_mass_helps(
    name: str, options: dict[str, Any]
) -> None:
    """The message's own words, read as YAML, are the cure."""
    pytest.importorskip("example_robot_data")
    with pytest.raises(ModelError, match="lock the joints: locked: ") as caught:
        Robot.load(name, **options)
    hint = yaml.safe_load(str(caught.value).split("lock the joints: ")[1])
    robot = Robot.load(name, **hint, **options)
    assert not set(hint["locked"]) & set(robot.joint_names)


def test_what_the_parser_leaves_out_is_an_error(write: Callable[..., Path]) -> None:
    text = ARM.replace('ixy="0"', "", 1)
    with pytest.raises(ModelError, match=r"leaves out a part of the model: .*upper\]"):
        Robot.load(write(text))


def test_root_and_joint_that_do_the_same(write: Callable[..., Path]) -> None:
    """A massless base that yaws about its first joint's axis: two joints for one."""
    text = robot_xml(
        link("base", ""), link("upper"), joint("shoulder", "base", "upper")
    )
    path = write(text.replace(' rpy="0.3 0.2 0.1"', ""))
    assert Robot.load(path).nv == 1
    with pytest.raises(ModelError, match=r"no mass moves with (root_joint|shoulder),"):
        Robot.load(path, root="planar")


OPTIONS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"root": "free_flier"}, ModelError,
     "RobotDescription: root: unknown value 'free_flier'; did you mean 'free_flyer'? "
     "(allowed: fixed, planar, free_flyer)"),
    ({"locked": {"sholder": 0.0}}, JointNotFoundError,
     "cannot lock 'sholder': no such joint; did you mean 'shoulder'? (the model has "
     "shoulder, elbow)"),
    ({"locked": {"universe": 0.0}}, JointNotFoundError,
     "cannot lock 'universe': no such joint"),
    ({"locked": {"shoulder": 0.0, "elbow": 1.0}}, ModelError,
     "every joint is locked; at least one must be left to control"),
    ({"locked": {"elbow": float("nan")}}, ModelError,
     "RobotDescription: locked.elbow: nan is not a finite number"),
    ({"root": "free_flyer", "locked": {"root_joint": 0.0}}, ModelError,
     "cannot lock 'root_joint': it has 6 degrees of freedom, only joints with one can "
     "be locked; for a fixed base use root: fixed"),
    ({"tool_frames": {"pen": ToolFrame("lowr")}}, FrameNotFoundError,
     "tool frame 'pen': no parent frame 'lowr'; did you mean 'lower'? (the model has "
     "universe, "),
    ({"tool_frames": {"elbow": ToolFrame("lower")}}, ModelError,  # joints are frames
     "cannot add tool frame 'elbow': the model has a frame with this name"),
    ({"gravity": (0.0, -9.81)}, ModelError,
     "RobotDescription: gravity: (0.0, -9.81) has 2 entries, needs 3"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "error", "message"), OPTIONS)
def test_option_that_does_not_fit(
    options: dict[str, Any],
    error: type[Exception],
    message: str,
    write: Callable[..., Path],
) -> None:
    with pytest.raises(error, match=re.escape(message)) as caught:
        Robot.load(write(ARM), **options)
    assert isinstance(caught.value, HspControlError)


def test_a_pipe_is_not_read_for_ever(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "arm.urdf")
    with pytest.raises(RobotNotFoundError, match="a device or a pipe, which may never"):
        Robot.load(tmp_path / "arm.urdf")
    os.mkfifo(tmp_path / "package.xml")  # it is read where a mesh is looked for
    (tmp_path / "b.urdf").write_text(robot_xml(link("a")))
    with pytest.raises(ModelError, match="no moving joint"):
        Robot.load(tmp_path / "b.urdf")
