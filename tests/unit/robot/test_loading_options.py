"""Options of loading, the likely hand, and robots from Pinocchio models."""

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from robot_cases import by_pickle
from robot_texts import (
    BUNDLED,
    assert_same_placements,
    gripper,
    joint,
    link,
    placements,
    robot_xml,
)
from wording import wording

import hsp_control as hsp
from hsp_control import Robot
from hsp_control.common.errors import ModelError
from hsp_control.geometry.links import link_shapes
from hsp_control.robot import ToolFrame
from hsp_control.robot.description.hand import find_hand
from hsp_control.robot.description.urdf import read_urdf


def full_configuration(model: pin.Model, values: dict[str, float]) -> np.ndarray:
    """Return q of an unreduced model of single-DOF joints, others at zero."""
    displacement = np.zeros(model.nv)
    for name, value in values.items():
        displacement[model.joints[model.getJointId(name)].idx_v] = value
    return pin.integrate(model, pin.neutral(model), displacement)


# --- mimic joints --------------------------------------------------------------------


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


@pytest.mark.parametrize(("name", "locks"), [
    (
        "panda",
        {"panda_joint3": 0.7, "panda_joint5": -1.1, "panda_finger_joint1": 0.0},
    ),
    ("planar3r", {"joint2": 2.5}),  # continuous
    ("planar3r", {"joint1": -1.5, "joint3": 4.0}),  # beyond half a turn
    ("kinova", {"j2s6s200_joint_1": -2.0, "j2s6s200_joint_3": 1.0}),
])  # fmt: skip
def test_locked_joint_is_at_its_given_position(
    name: str, locks: dict[str, float]
) -> None:
    """Poses are those of the whole robot, and M is the submatrix of its M."""
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


def test_followers_may_be_named_if_they_agree_with_their_leader(
    write: Callable[..., Path],
) -> None:
    """So the same list of locked joints works with and without mimic, as the
    Panda's."""
    path = write(gripper())
    locks = {"shoulder": 0.4, "follower": -1.5 * 0.4 + 0.3}
    assert Robot.load(path, locked=locks).joint_names == ("elbow",)
    assert Robot.load(path, locked=locks, mimic=False).joint_names == ("elbow",)
    reported = "... lock 'follower' at 0.4: ... 'shoulder' ... -0.3"
    with pytest.raises(ModelError, match=wording(reported)):
        Robot.load(path, locked={"shoulder": 0.4, "follower": 0.4})
    with pytest.raises(ModelError, match="it mimics 'shoulder'; lock 'shoulder'"):
        Robot.load(path, locked={"follower": 0.4})


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


def welded(parent: str, name: str) -> list[str]:
    """Return a link that is fixed to another one."""
    return [link(name), joint(f"to {name}", parent, name, "fixed")]


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        # A chain ends at its last link, also if that is fixed to the last moving one.
        ([chain("base", "a", "b")], "b"),
        ([chain("base", "a", "b"), link("tool"), joint("weld", "b", "tool", "fixed")],
         "tool"),
        # The longest chain; among equals the last.
        ([chain("base", "a", "b"), chain("base", "x", "y", "z")], "z"),
        ([chain("base", "x", "y", "z"), chain("base", "a", "b", "c")], "z"),
        # A fork in the second half is a hand with fingers; one in the first is not.
        ([chain("base", "a", "b", "c", "d", "e"), chain("d", "f")], "d"),
        ([chain("base", "a", "b", "c", "d", "e"), chain("a", "f")], "e"),
        # A single short branch belongs to the arm's mechanism; an elbow is no hand.
        ([chain("base", "a", "b", "c", "d", "e", "f"), chain("c", "rod")], "f"),
        ([chain("base", "a", "b", "c", "d", "e", "f"), chain("c", "rod"),
          chain("c", "bar")], "c"),
        # Neither a fixed finger nor a sensor is the hand.
        ([chain("base", "a", "b"), link("hand_camera"),
          joint("weld", "b", "hand_camera", "fixed")], "b"),
        ([chain("base", "a", "b"), link("left_finger"),
          joint("weld", "b", "left_finger", "fixed")], "b"),
        # A body fixed as the hand precedes those fixed later.
        ([chain("base", "a", "b"), *welded("b", "my_tcp"), *welded("b", "cover")],
         "my_tcp"),
        ([chain("base", "a", "b"), *welded("b", "ee_link"), *welded("b", "tool0"),
          *welded("b", "plate")], "tool0"),
        ([chain("base", "a", "b"), *welded("b", "grasp"), *welded("b", "cover")],
         "grasp"),
        ([chain("base", "a", "b"), *welded("b", "gripper_frame_link"),
          *welded("b", "cover")], "gripper_frame_link"),
        # A jaw is no hand, also if it is a further joint of the chain.
        ([chain("base", "a", "b"), link("c"), joint("gripper", "b", "c")], "b"),
        ([chain("base", "a", "b"), link("c"), joint("moving_jaw", "b", "c")], "b"),
        ([chain("base", "a", "b"), link("c"), joint("finger", "b", "c"), link("d"),
          joint("finger_tip", "c", "d")], "b"),
        ([chain("base", "a", "b"), link("c_jaw"), joint("c", "b", "c_jaw"),
          *welded("b", "tcp")], "tcp"),
        ([chain("base", "a", "b"), link("c"), joint("gripper", "b", "c"),
          *welded("b", "gripper_frame")], "gripper_frame"),
        # Digits that are longer than the arm are no hand, either.
        ([chain("base", "a", "b", "palm"),
          *(chain("palm", *(f"digit_{k}{n}" for n in range(4))) for k in range(3))],
         "palm"),
        # The wrist of a gripper belongs to the arm; a single finger is a gripper.
        ([chain("base", "a", "b"), link("c"), joint("gripper_roll", "b", "c")], "c"),
        ([chain("base", "a", "b"), link("c_gripper"), joint("c", "b", "c_gripper")],
         "c_gripper"),
        ([link("c"), joint("finger", "base", "c"), link("d"),
          joint("finger_tip", "c", "d")], "d"),
    ],
)  # fmt: skip
def test_the_hand(parts: list[str], expected: str, write: Callable[..., Path]) -> None:
    path = write(robot_xml(link("base", ""), *parts))
    assert find_hand(Robot.load(path).model).frame == expected


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ([], "the longest chain of joints ends with 'a-b'"),
        (welded("b", "tcp"), "ends with 'a-b', and this link is called a TCP"),
        (welded("b", "cover"), "ends with 'a-b', and this is its last link"),
        ([link("c"), joint("jaw", "b", "c")], "'a-b': 'jaw' after it is a gripper's"),
        ([chain("b", "c", "d"), chain("b", "e", "f"), chain("b", "g", "h")],
         "ends with 'a-b', where fingers branch off"),
    ],
)  # fmt: skip
def test_the_reason_for_the_choice_of_hand_is_reported(
    parts: list[str], why: str, write: Callable[..., Path]
) -> None:
    text = robot_xml(link("base", ""), chain("base", "z", "a", "b"), *parts)
    assert why in Robot.load(write(text)).hand.why
    assert Robot.load("panda").hand.why == "the robot's source names it"


# --- Pinocchio's own models ----------------------------------------------------------


def of_panda() -> tuple[Robot, list[object]]:
    """Return the bundled Panda, and Pinocchio's model of its files."""
    robot = Robot.load("panda", locked={}, mimic=False)
    source = robot.source
    folders = [str(folder) for folder in source.package_dirs]
    model, collision, visual = pin.buildModelsFromUrdf(str(source.urdf), folders)
    collision.addAllCollisionPairs()
    pin.removeCollisionPairs(model, collision, str(source.srdf))
    return robot, [model, collision, visual]


def test_a_robot_of_a_pinocchio_model_is_that_of_its_urdf() -> None:
    loaded, models = of_panda()
    robot = by_pickle(Robot.from_pinocchio(*models, home=loaded.home()))
    assert robot.end_effector == loaded.end_effector
    for proxy in ("capsules", "hulls", "meshes"):
        for ours, theirs in zip(
            link_shapes(robot, proxy), link_shapes(loaded, proxy), strict=True
        ):
            assert (ours.link, ours.joint) == (theirs.link, theirs.joint)
            assert type(ours.geometry) is type(theirs.geometry)
            assert ours.placement.isApprox(theirs.placement, 1e-9)
    tau = [
        hsp.Controller(each, [hsp.FramePose()], hsp.SelfClearance())
        .compute(0.0, each.home(), np.full(each.nv, 0.1))
        .tau
        for each in (loaded, robot)
    ]
    np.testing.assert_allclose(tau[1], tau[0], atol=1e-9)


def test_objects_that_are_no_pinocchio_model_are_refused() -> None:
    _, (model, collision, visual) = of_panda()
    less = pin.buildReducedModel(model, [8, 9], pin.neutral(model))
    for arguments, message in (
        (("panda.urdf",), "model is of type str; needs a pinocchio.Model"),
        ((pin.RobotWrapper(model),), "give robot.model, robot.collision_model and"),
        ((model, model), "collision is of type Model; needs a pinocchio.GeometryM"),
        ((less, collision, visual), "if joints were locked, give all that pin.build"),
    ):
        with pytest.raises(ModelError, match=re.escape(message)):
            Robot.from_pinocchio(*arguments)
    with pytest.raises(ModelError, match="its URDF is needed: load it with"):
        read_urdf(Robot.from_pinocchio(model).source)
