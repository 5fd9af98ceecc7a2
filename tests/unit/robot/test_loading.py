"""Robots by name and by path; their roots, locks, tools and gravity; every error."""

import importlib.util
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
from places import ROOT
from refused_robots import LATE_LEADER, NO_LEADER, REFUSED

from hsp_control import HspControlError, Robot, ToolFrame
from hsp_control.common import resources
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    NonFiniteError,
    RobotNotFoundError,
    ShapeError,
)
from hsp_control.common.resources import bundled_robots
from hsp_control.robot.description.loading import end_effector_frame, load_model
from hsp_control.robot.description.sources import example_robots, find_robot

BUNDLED = ("iiwa14", "panda", "planar3r")

# Of example-robot-data: name, root by default, nq, nv.
EXAMPLES = [
    ("ur5", "fixed", 6, 6),
    ("talos_arm", "fixed", 7, 7),
    ("kinova", "fixed", 9, 6),  # three continuous joints
    ("tiago", "fixed", 50, 48),  # two continuous wheels
    ("double_pendulum_continuous", "fixed", 4, 2),
    ("baxter", "fixed", 17, 17),  # 19 joints, two of them mimic
    ("solo12", "free_flyer", 19, 18),
    ("talos", "free_flyer", 39, 38),
]

# Robots of example-robot-data that are refused, and why. (cassie is not listed at all:
# it is no URDF.)
REFUSED_WITHOUT_MIMIC = {"romeo": r"no mass moves with LFinger21, .*\(24 in all\)"}

INERTIA = (
    '<inertial><origin xyz="0.2 0.1 0.3"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
)


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", inner: str = ""
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="0.5 0.1 0.2" rpy="0.3 0.2 0.1"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/>'
        f"{inner}</joint>"
    )


def link(name: str, inner: str = INERTIA) -> str:
    return f'<link name="{name}">{inner}</link>'


def robot_xml(*parts: str) -> str:
    return f'<robot name="made_up">{"".join(parts)}</robot>'


ARM = robot_xml(
    link("base", ""),
    link("upper"),
    link("lower"),
    joint("shoulder", "base", "upper"),
    joint("elbow", "upper", "lower"),
)


def gripper(kind: str = "revolute", multiplier: float = -1.5) -> str:
    """Return an arm whose last joint is multiplier · shoulder + 0.3."""
    mimic = f'<mimic joint="shoulder" multiplier="{multiplier}" offset="0.3"/>'
    return robot_xml(
        link("base", ""),
        link("upper"),
        link("lower"),
        link("finger"),
        joint("shoulder", "base", "upper", kind),
        joint("elbow", "upper", "lower"),
        joint("follower", "lower", "finger", kind, mimic),
    )


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def write_file(text: str | bytes, name: str = "arm.urdf") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write_file


def example(name: str) -> Robot:
    pytest.importorskip("example_robot_data")
    return Robot.load(name)


def placements(model: pin.Model, q: np.ndarray) -> dict[str, np.ndarray]:
    """Return every body frame's placement, by plain Pinocchio."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    return {f.name: data.oMf[model.getFrameId(f.name)].homogeneous for f in bodies}


def assert_same_placements(
    first: dict[str, np.ndarray], second: dict[str, np.ndarray]
) -> None:
    """Every body of the first stands where the second's does, to rounding."""
    assert first
    for name, placement in first.items():
        np.testing.assert_allclose(placement, second[name], rtol=0, atol=1e-14)


def full_configuration(model: pin.Model, values: dict[str, float]) -> np.ndarray:
    """Return q of an unreduced model with one-freedom joints, others at zero."""
    displacement = np.zeros(model.nv)
    for name, value in values.items():
        displacement[model.joints[model.getJointId(name)].idx_v] = value
    return pin.integrate(model, pin.neutral(model), displacement)


# --- by name -------------------------------------------------------------------------


@pytest.mark.parametrize("name", BUNDLED)
def test_bundled_robot(name: str) -> None:
    robot = Robot.load(name)
    assert robot.source.origin == "bundled"
    assert robot.name == name
    assert robot.nv == (3 if name == "planar3r" else 7)
    assert robot.source.root == "fixed"
    assert robot.source.end_effector in robot.frame_names
    # The source's home is what home() gives, and it is where the README says.
    np.testing.assert_allclose(
        robot.joint_positions(robot.home()), robot.source.home, rtol=0, atol=1e-15
    )


def test_bundled_robots_come_before_those_of_example_robot_data() -> None:
    """Both have a panda; the bundled one locks its fingers."""
    assert set(BUNDLED) <= set(bundled_robots())
    assert Robot.load("panda").source.origin == "bundled"
    if example_robots():
        assert example_robots()["panda"].origin == "example-robot-data"


@pytest.mark.parametrize(("name", "root", "nq", "nv"), EXAMPLES)
def test_example_robot(name: str, root: str, nq: int, nv: int) -> None:
    robot = example(name)
    assert (robot.source.root, robot.nq, robot.nv) == (root, nq, nv)
    assert robot.source.origin == "example-robot-data"
    assert robot.source.package_dirs[0].name == "share"
    assert (robot.source.package_dirs[0] / "example-robot-data").is_dir()


@pytest.mark.parametrize("name", sorted(example_robots()))
@pytest.mark.parametrize("mimic", [True, False])
def test_every_example_robot_loads_or_says_why_not(name: str, mimic: bool) -> None:
    """Nothing but ModelError, and of exactly the robots that are known for it."""
    reason = REFUSED.get(name)
    if not mimic and reason in {LATE_LEADER, NO_LEADER}:
        reason = REFUSED_WITHOUT_MIMIC.get(name)
    source = find_robot(name)
    if source.origin == "bundled":
        source = example_robots()[name]
    if reason is not None:
        with pytest.raises(ModelError, match=reason):
            load_model(source, mimic=mimic)
        return
    robot = Robot(load_model(source, mimic=mimic), source)
    plain = pin.buildModelFromUrdf(str(source.urdf), mimic=mimic)
    extra = 6 if source.root == "free_flyer" else 0
    assert robot.nv == plain.nv + extra
    # The root comes first, then the URDF's joints without those that only follow.
    assert len(robot.dof_names) == robot.nv
    assert len(robot.joint_names) == len(robot.joints)
    last = list(robot.joints.values())[-1]
    assert last.idx_v + last.nv == robot.nv
    assert last.idx_q + last.nq == robot.nq


def test_sdf_only_robot_is_not_listed() -> None:
    pytest.importorskip("example_robot_data")
    assert len(example_robots()) >= 70
    assert "cassie" not in example_robots()


def test_sdf_only_robot_is_refused_by_name() -> None:
    pytest.importorskip("example_robot_data")
    with pytest.raises(RobotNotFoundError, match=r"'cassie' .* has no URDF"):
        Robot.load("cassie")


def test_without_example_robot_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bundled robots still load; the error for others says what to install."""
    real = importlib.util.find_spec

    def find_spec(name: str, package: str | None = None) -> Any:
        return None if name == "example_robot_data" else real(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", find_spec)
    assert example_robots() == {}
    assert Robot.load("panda").nv == 7
    with pytest.raises(RobotNotFoundError, match="pip install example-robot-data-loa"):
        find_robot("talos_arm")


def test_bundled_folder_of_a_wheel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a wheel the data lie inside the package; a folder without a URDF is none."""
    arm = tmp_path / "data" / "robots" / "arm"
    arm.mkdir(parents=True)
    (arm / "arm.urdf").write_text(ARM)
    (tmp_path / "data" / "robots" / "empty").mkdir()
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path)
    assert bundled_robots() == {"arm": arm}
    assert Robot.load("arm").joint_names == ("shoulder", "elbow")


def test_bundle_without_a_home_and_with_all_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = tmp_path / "robots" / "arm"
    arm.mkdir(parents=True)
    (arm / "arm.urdf").write_text(ARM)
    (arm / "robot.yaml").write_text("locked: {elbow: 0.5}\nhome: [1]\n")
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path / "package")
    robot = Robot.load("arm")
    assert robot.joint_names == ("shoulder",)
    np.testing.assert_array_equal(robot.home(), [1.0])
    assert Robot.load("arm", locked={}).nv == 2
    (arm / "robot.yaml").write_text("")
    assert Robot.load("arm").nv == 2


# --- by path -------------------------------------------------------------------------


def test_path_as_text_as_path_and_in_the_home_folder(
    write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(ARM)
    monkeypatch.setenv("HOME", str(path.parent))
    for name in (path, str(path), "~/arm.urdf"):
        robot = Robot.load(name)
        assert robot.name == "arm"
        assert robot.source.origin == "file"
        assert robot.joint_names == ("shoulder", "elbow")
    monkeypatch.chdir(path.parent)
    assert Robot.load("arm.urdf").nv == 2  # no separator: the ending tells
    write(ARM, "arm.xml")
    assert Robot.load("arm.xml").nv == 2
    write(ARM, "without_ending")
    assert Robot.load("./without_ending").nv == 2


def test_model_is_the_urdfs(write: Callable[..., Path]) -> None:
    """What comes out is Pinocchio's own reading of the file."""
    path = write(ARM)
    assert Robot.load(path).model == pin.buildModelFromUrdf(str(path))


def test_meshes_may_be_missing(write: Callable[..., Path]) -> None:
    """Visuals are no business of dynamics: their files are never opened."""
    shapes = "".join(
        f'<{tag}><geometry><mesh filename="{place}"/></geometry></{tag}>'
        for tag in ("visual", "collision")
        for place in ("package://nowhere/hand.stl", "file:///nowhere/hand.dae")
    )
    with_meshes = Robot.load(write(ARM.replace(INERTIA, INERTIA + shapes)))
    without = Robot.load(write(ARM, "plain.urdf"))
    q = np.array([0.3, -0.4])
    assert_same_placements(
        placements(with_meshes.model, q), placements(without.model, q)
    )


def test_package_folders_of_a_file(
    write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`package://` is looked up above the file, then along ROS_PACKAGE_PATH."""
    path = write(ARM)
    monkeypatch.setenv("ROS_PACKAGE_PATH", "/opt/one:/opt/two")
    folders = find_robot(path).package_dirs
    assert folders[0] == path.resolve().parent
    assert path.resolve().parents[2] in folders
    assert folders[-2:] == (Path("/opt/one"), Path("/opt/two"))
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    assert Path("/opt/one") not in find_robot(path).package_dirs


# --- roots ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("root", "nq", "nv"), [("fixed", 2, 2), ("planar", 6, 5), ("free_flyer", 9, 8)]
)
def test_root(root: Any, nq: int, nv: int, write: Callable[..., Path]) -> None:
    text = ARM.replace(link("base", ""), link("base"))  # a root must move some mass
    robot = Robot.load(write(text), root=root)
    fixed = Robot.load(write(text))
    assert (robot.nq, robot.nv) == (nq, nv)
    # All stands where the root puts it. The pose by Pinocchio's own conventions.
    angles = np.array([0.4, -0.7])
    if root == "fixed":
        pose, q = pin.SE3.Identity(), angles
    elif root == "planar":
        pose = pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.6), np.array([1.0, -2.0, 0.0]))
        q = np.concatenate([[1.0, -2.0, np.cos(0.6), np.sin(0.6)], angles])
    else:
        pose = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.5, 0.6), np.array([1.0, -2.0, 0.5]))
        q = np.concatenate([pin.SE3ToXYZQUAT(pose), angles])
    standing = placements(fixed.model, angles)
    moved = {name: pose.homogeneous @ M for name, M in standing.items()}
    assert_same_placements(moved, placements(robot.model, q))
    np.testing.assert_array_equal(robot.check_configuration(q), q)


def test_source_names_the_root_unless_told_otherwise() -> None:
    assert example("solo12").nv == 18
    assert Robot.load("solo12", root="fixed").nv == 12
    assert Robot.load("solo12", root="planar").nv == 15
    assert Robot.load("talos_arm", root="free_flyer").nv == 13


# --- mimic joints --------------------------------------------------------------------


def test_mimic_fingers_of_the_panda() -> None:
    """Fingers unlocked: one freedom with mimic, two without; locked by default."""
    locked, leading, free = (
        Robot.load("panda"),
        Robot.load("panda", locked={}),
        Robot.load("panda", locked={}, mimic=False),
    )
    assert [r.nv for r in (locked, leading, free)] == [7, 8, 9]
    assert [r.mimics for r in (locked, leading, free)] == [False, True, False]
    assert leading.joint_names[-1] == "panda_finger_joint1"
    assert free.joint_names[-1] == "panda_finger_joint2"
    q = np.array([0.1, -0.2, 0.3, -1.4, 0.5, 1.6, 0.7, 0.03])
    assert_same_placements(
        placements(leading.model, q), placements(free.model, np.append(q, 0.03))
    )


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("multiplier", [1.0, 2.0, -1.5])
def test_follower_is_at_multiplier_times_leader_plus_offset(
    kind: str, multiplier: float, write: Callable[..., Path]
) -> None:
    path = write(gripper(kind, multiplier))
    robot, free = Robot.load(path), Robot.load(path, mimic=False)
    assert (robot.nv, free.nv) == (2, 3)
    q = robot.integrate(robot.neutral(), np.array([0.4, -0.7]))
    values = {"shoulder": 0.4, "elbow": -0.7, "follower": multiplier * 0.4 + 0.3}
    assert_same_placements(
        placements(robot.model, q),
        placements(free.model, full_configuration(free.model, values)),
    )


# --- locked joints -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "locks"),
    [
        (
            "panda",
            {"panda_joint3": 0.7, "panda_joint5": -1.1, "panda_finger_joint1": 0.0},
        ),
        ("planar3r", {"joint2": 2.5}),  # continuous
        ("planar3r", {"joint1": -1.5, "joint3": 4.0}),  # beyond half a turn
        ("kinova", {"j2s6s200_joint_1": -2.0, "j2s6s200_joint_3": 1.0}),
    ],
)
def test_locked_joint_stands_where_it_is_told(
    name: str, locks: dict[str, float]
) -> None:
    """Bodies stand as in the whole robot, and M is the rest of the whole M."""
    if name not in BUNDLED:
        pytest.importorskip("example_robot_data")
    robot = Robot.load(name, locked=locks)
    whole = pin.buildModelFromUrdf(str(robot.source.urdf))
    rest = [joint for joint in robot.joint_names if joint not in locks]
    assert rest == list(robot.joint_names)
    rng = np.random.default_rng(0)
    values = dict(zip(rest, rng.uniform(-1.0, 1.0, robot.nv), strict=True))
    q = robot.integrate(robot.neutral(), np.array(list(values.values())))
    q_whole = full_configuration(whole, locks | values)
    assert_same_placements(placements(robot.model, q), placements(whole, q_whole))

    kept = [whole.joints[whole.getJointId(joint)].idx_v for joint in rest]
    M = pin.crba(whole, whole.createData(), q_whole)[np.ix_(kept, kept)]
    # 1e-12 of 1 to 10 kg m²: inertias of locked links are merged in another order.
    actual = pin.crba(robot.model, robot.model.createData(), q)
    np.testing.assert_allclose(actual, M, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("value", [0.0, 0.9])
def test_locking_a_leader_locks_its_follower(
    kind: str, value: float, write: Callable[..., Path]
) -> None:
    path = write(gripper(kind))
    robot = Robot.load(path, locked={"shoulder": value})
    free = Robot.load(path, mimic=False)
    assert robot.joint_names == ("elbow",)
    assert not robot.mimics
    values = {"shoulder": value, "elbow": -0.7, "follower": -1.5 * value + 0.3}
    assert_same_placements(
        placements(robot.model, np.array([-0.7])),
        placements(free.model, full_configuration(free.model, values)),
    )


def test_locking_another_joint_leaves_mimic_joints_at_work(
    write: Callable[..., Path],
) -> None:
    path = write(gripper())
    robot = Robot.load(path, locked={"elbow": 0.8})
    free = Robot.load(path, mimic=False)
    assert robot.joint_names == ("shoulder",)
    assert robot.mimics
    values = {"shoulder": 0.4, "elbow": 0.8, "follower": -1.5 * 0.4 + 0.3}
    assert_same_placements(
        placements(robot.model, np.array([0.4])),
        placements(free.model, full_configuration(free.model, values)),
    )


def test_followers_may_be_named_if_they_agree_with_their_leader(
    write: Callable[..., Path],
) -> None:
    """So that one list of locks serves with and without mimic, as the Panda's does."""
    path = write(gripper())
    locks = {"shoulder": 0.4, "follower": -1.5 * 0.4 + 0.3}
    assert Robot.load(path, locked=locks).joint_names == ("elbow",)
    assert Robot.load(path, locked=locks, mimic=False).joint_names == ("elbow",)
    with pytest.raises(
        ModelError, match=r"cannot lock 'follower' at 0\.4: it mimics 'shoulder', "
        r"which puts it at -0\.3"
    ):  # fmt: skip
        Robot.load(path, locked={"shoulder": 0.4, "follower": 0.4})
    with pytest.raises(ModelError, match="it mimics 'shoulder'; lock that"):
        Robot.load(path, locked={"follower": 0.4})


def test_an_empty_list_of_locks_unlocks() -> None:
    assert Robot.load("panda", locked={}).nv == 8
    assert Robot.load("panda", locked={"panda_joint1": 0.0}).nv == 7


# --- tool frames and gravity ---------------------------------------------------------


def test_tool_frames_are_fixed_to_their_parents() -> None:
    tools = {
        "pen": ToolFrame("panda_hand", (0.01, -0.02, 0.3), (0.1, 0.2, -0.3)),
        "tip": ToolFrame("pen", (0.0, 0.0, 0.05)),  # a tool on a tool
        "camera": ToolFrame("universe", (1.0, 2.0, 3.0)),
    }
    robot = Robot.load("panda", tool_frames=tools)
    assert robot.frame_names[-3:] == ("pen", "tip", "camera")
    rng = np.random.default_rng(1)
    state = robot.state(0.0, robot.random_configuration(rng), rng.standard_normal(7))

    def placement(name: str) -> pin.SE3:
        frame = state.frame(name)
        return pin.SE3(frame.rotation, frame.position)

    # URDF's rpy: Rz(yaw) Ry(pitch) Rx(roll).
    turn = (
        pin.utils.rotate("z", -0.3) @ pin.utils.rotate("y", 0.2)
        @ pin.utils.rotate("x", 0.1)
    )  # fmt: skip
    pen = placement("panda_hand") * pin.SE3(turn, np.array([0.01, -0.02, 0.3]))
    tip = pen * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.05]))
    for expected, name in ((pen, "pen"), (tip, "tip")):
        actual = placement(name)
        np.testing.assert_allclose(
            actual.homogeneous, expected.homogeneous, rtol=0, atol=1e-14
        )
        # It moves with its parent: v_tool = v_parent + w × (p_tool - p_parent).
        hand = state.frame("panda_hand")
        arm = actual.translation - hand.position
        v, w = hand.velocity[:3], hand.velocity[3:]
        np.testing.assert_allclose(
            state.frame(name).velocity,
            np.concatenate([v + np.cross(w, arm), w]),
            rtol=0,
            atol=1e-13,
        )
    np.testing.assert_array_equal(state.frame("camera").position, [1.0, 2.0, 3.0])
    assert not state.frame("camera").jacobian.any()


def test_gravity() -> None:
    """At rest N is the weight: N_i = -Σ_k m_k gᵀ ∂c_k/∂q_i, by the centre of mass."""
    q, rest = Robot.load("panda").home(), np.zeros(7)
    for gravity in (None, (0.0, 0.0, -9.81), (1.0, -2.0, 3.0), (0.0, 0.0, 0.0)):
        robot = Robot.load("panda", gravity=gravity)
        g = np.array((0.0, 0.0, -9.81) if gravity is None else gravity)
        data = robot.model.createData()
        J_com = pin.jacobianCenterOfMass(robot.model, data, q)
        weight = -data.mass[0] * g @ J_com
        effects = robot.state(0.0, q, rest).nonlinear_effects
        np.testing.assert_allclose(effects, weight, rtol=0, atol=1e-12)


def test_gravity_with_locked_joints_and_tools() -> None:
    robot = Robot.load(
        "panda",
        locked={"panda_joint1": 0.3},
        gravity=(0.0, 1.0, 0.0),
        tool_frames={"pen": ToolFrame("panda_hand")},
    )
    np.testing.assert_array_equal(robot.model.gravity.linear, [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(robot.model.gravity.angular, [0.0, 0.0, 0.0])


# --- the likely hand -----------------------------------------------------------------


def chain(*names: str) -> str:
    """Return links and joints of a serial chain; the first link must exist."""
    pairs = pairwise(names)
    return "".join(link(b) + joint(f"{a}-{b}", a, b) for a, b in pairs)


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        # A chain ends at its last link, be it welded to the last that moves.
        ([chain("base", "a", "b")], "b"),
        ([chain("base", "a", "b"), link("tool"), joint("weld", "b", "tool", "fixed")],
         "tool"),
        # The longest chain, and the last of equals.
        ([chain("base", "a", "b"), chain("base", "x", "y", "z")], "z"),
        ([chain("base", "x", "y", "z"), chain("base", "a", "b", "c")], "z"),
        # A fork in the second half is a hand with fingers; one in the first is not.
        ([chain("base", "a", "b", "c", "d", "e"), chain("d", "f")], "d"),
        ([chain("base", "a", "b", "c", "d", "e"), chain("a", "f")], "e"),
        # A finger that is welded on is none to track.
        ([chain("base", "a", "b"), link("left_finger"),
          joint("weld", "b", "left_finger", "fixed")], "b"),
    ],
)  # fmt: skip
def test_end_effector_frame(
    parts: list[str], expected: str, write: Callable[..., Path]
) -> None:
    path = write(robot_xml(link("base", ""), *parts))
    assert end_effector_frame(Robot.load(path).model) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("planar3r", "tip"),
        ("panda", "panda_tcp"),
        ("iiwa14", "iiwa_link_ee"),
        ("ur5", "tool0"),
        ("xarm7", "link_eef"),
        ("kinova", "j2s6s200_end_effector"),
    ],
)
def test_end_effector_frame_of_known_arms(name: str, expected: str) -> None:
    if name not in BUNDLED:
        pytest.importorskip("example_robot_data")
    robot = Robot.load(name)
    assert end_effector_frame(robot.model) == expected
    if name in BUNDLED:  # what the bundle says, found by itself
        assert robot.source.end_effector == expected


# --- errors --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("pnada", "no robot 'pnada'; did you mean 'panda'?"),
        ("PANDA", "did you mean 'panda'?"),
        ("planar", "did you mean 'planar3r'?"),
        ("xyzzy", "no robot 'xyzzy' (a path to a .urdf file, or one of: "),
        ("robots/panda/", "is a folder; name the .urdf file in it"),
        ("/nowhere/arm.urdf", "/nowhere/arm.urdf: no such file"),
        ("arm_without_folder.urdf", "arm_without_folder.urdf: no such file"),
    ],
)
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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<robot name="r">\n  <link name="a">\n</robot>', r":3:3: malformed XML: mism"),
        ("", r"arm\.urdf:1:1: malformed XML: no element found"),
        (b"\xff\xfe\x00\x00binary", r"arm\.urdf:1:\d+: malformed XML"),
        (
            '<?xml version="1.0" encoding="no-such"?>' + ARM,
            "malformed XML: unknown enc",
        ),
        ("<mujoco/>", "the top element is <mujoco>, a URDF's is <robot>"),
        ("<sdf version='1.6'/>", "the top element is <sdf>"),
        ("<robot/>", "not a robot that can be built: No name given for the robot"),
        ("<robot name='r'/>", "not a robot that can be built"),
        (
            ARM.replace('lower="-3" upper="3"', 'lower="3" upper="-3"', 1),
            "joint 'shoulder': its lower limit 3 is above its upper limit -3",
        ),
        (robot_xml(link("a")), "the robot has no moving joint"),
        (
            robot_xml(link("a"), link("b"), joint("j", "a", "b", "fixed")),
            "the robot has no moving joint",
        ),
        (robot_xml(link("a"), joint("j", "a", "b")), "not a robot that can be built"),
        (robot_xml(link("b"), joint("j", "a", "b")), "not a robot that can be built"),
        (robot_xml(link("a"), link("b")), "not a robot that can be built"),
        (robot_xml(link("a"), link("a")), "not a robot that can be built"),
        (
            ARM.replace('type="revolute"', 'type="bent"'),
            "not a robot that can be built",
        ),
        (ARM.replace("<limit", "<limits"), "not a robot that can be built"),
        (
            robot_xml(ARM, joint("loop", "lower", "base")),
            "not a robot that can be built",
        ),
        (
            ARM.replace("</joint>", '<mimic joint="ghost"/></joint>', 1),
            "joint 'shoulder' mimics 'ghost', which is no moving joint; load its mimic",
        ),
        (
            gripper().replace(
                '"follower" type="revolute"', '"follower" type="continuous"'
            ),
            "can be built: Mimicking and .* different sizes; load .*mimic=False",
        ),
    ],
)
def test_file_that_is_no_robot(
    text: str | bytes, message: str, write: Callable[..., Path]
) -> None:
    path = write(text)
    with pytest.raises(ModelError, match=message) as caught:
        Robot.load(path)
    assert str(path) in str(caught.value)


def test_hint_to_load_mimic_joints_as_free_ones_helps(
    write: Callable[..., Path],
) -> None:
    path = write(ARM.replace("</joint>", '<mimic joint="elbow"/></joint>', 1))
    message = "'shoulder' mimics 'elbow', which comes after it in the tree.*mimic=False"
    with pytest.raises(ModelError, match=message):
        Robot.load(path)
    assert Robot.load(path, mimic=False).nv == 2


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("bravo7_gripper", {}),
        ("falcon_bravo7_gripper", {}),
        ("bluevolta_bravo7_gripper", {}),
        ("romeo", {"mimic": False}),
    ],
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


@pytest.mark.parametrize("last", ["wrist", "a_joint"])
def test_joint_that_moves_no_mass_is_named(
    last: str, write: Callable[..., Path]
) -> None:
    """A last joint with a massless link; the cure that is named helps."""
    path = write(
        robot_xml(
            link("base", ""),
            link("upper"),
            link("hand", ""),
            joint("shoulder", "base", "upper"),
            joint(last, "upper", "hand"),
        )
    )
    message = rf"no mass moves with {last}, .*, or lock .*: locked: {{{last}: 0\.0}}"
    with pytest.raises(ModelError, match=message):
        Robot.load(path)
    assert Robot.load(path, locked={last: 0.0}).joint_names == ("shoulder",)


def test_massless_link_between_heavy_ones_is_no_error(
    write: Callable[..., Path],
) -> None:
    assert Robot.load(write(ARM.replace(INERTIA, "", 1))).nv == 2


def test_root_that_moves_no_mass(write: Callable[..., Path]) -> None:
    """Two point masses on one line: to roll about it takes no effort."""
    point = '<inertial><mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" '
    point += 'iyz="0" izz="0"/></inertial>'
    slide = joint("slide", "base", "slider", "prismatic").replace("0 0 1", "1 0 0")
    slide = slide.replace('xyz="0.5 0.1 0.2" rpy="0.3 0.2 0.1"', 'xyz="1 0 0"')
    path = write(robot_xml(link("base", point), link("slider", point), slide))
    assert Robot.load(path).nv == 1
    message = r"no mass moves with root_joint, .* an inertia, or root: fixed$"
    with pytest.raises(ModelError, match=message):
        Robot.load(path, root="free_flyer")


def test_root_and_joint_that_do_the_same(write: Callable[..., Path]) -> None:
    """A massless base that yaws about its first joint's axis: two joints for one."""
    text = robot_xml(
        link("base", ""), link("upper"), joint("shoulder", "base", "upper")
    )
    path = write(text.replace(' rpy="0.3 0.2 0.1"', ""))
    assert Robot.load(path).nv == 1
    with pytest.raises(ModelError, match=r"no mass moves with (root_joint|shoulder),"):
        Robot.load(path, root="planar")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"root": "free_flier"},
            ModelError,
            "root 'free_flier' is not one of fixed, planar, free_flyer; "
            "did you mean 'free_flyer'?",
        ),
        (
            {"locked": {"sholder": 0.0}},
            JointNotFoundError,
            "cannot lock 'sholder': no such joint; did you mean 'shoulder'? "
            "(the model has shoulder, elbow)",
        ),
        (
            {"locked": {"universe": 0.0}},
            JointNotFoundError,
            "cannot lock 'universe': no such joint",
        ),
        (
            {"locked": {"shoulder": 0.0, "elbow": 1.0}},
            ModelError,
            "every joint is locked: no freedom is left to control",
        ),
        (
            {"locked": {"elbow": float("nan")}},
            NonFiniteError,
            "cannot lock joint 'elbow' at nan",
        ),
        (
            {"root": "free_flyer", "locked": {"root_joint": 0.0}},
            ModelError,
            "cannot lock 'root_joint': it has 6 freedoms; choose root: fixed",
        ),
        (
            {"tool_frames": {"pen": ToolFrame("lowr")}},
            FrameNotFoundError,
            "tool frame 'pen': no parent frame 'lowr'; did you mean 'lower'? "
            "(the model has universe, ",
        ),
        (
            {"tool_frames": {"lower": ToolFrame("lower")}},
            ModelError,
            "cannot add tool frame 'lower': a frame has that name",
        ),
        (
            {"tool_frames": {"elbow": ToolFrame("lower")}},  # joints are frames, too
            ModelError,
            "cannot add tool frame 'elbow': a frame has that name",
        ),
        (
            {"tool_frames": {"pen": ToolFrame("lower", (1.0, 2.0))}},
            ShapeError,
            "translation of 'pen' has shape (2,); needs 3 numbers",
        ),
        (
            {"tool_frames": {"pen": ToolFrame("lower", rpy=(0.0, np.inf, 0.0))}},
            NonFiniteError,
            "rpy of 'pen' is [0.0, inf, 0.0]; needs finite numbers",
        ),
        (
            {"gravity": (0.0, -9.81)},
            ShapeError,
            "gravity has shape (2,); needs 3 numbers",
        ),
        (
            {"gravity": (0.0, 0.0, float("nan"))},
            NonFiniteError,
            "gravity is [0.0, 0.0, nan]; needs finite numbers",
        ),
    ],
)
def test_option_that_does_not_fit(
    options: dict[str, Any],
    error: type[Exception],
    message: str,
    write: Callable[..., Path],
) -> None:
    with pytest.raises(error, match=re.escape(message)) as caught:
        Robot.load(write(ARM), **options)
    assert isinstance(caught.value, HspControlError)
