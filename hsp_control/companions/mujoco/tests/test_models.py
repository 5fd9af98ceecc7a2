"""Robots from MuJoCo models: the same mechanics as in MuJoCo."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mjcf_texts import ARM, CELL, trees
from wording import wording

from hsp_control import Robot
from hsp_control.common.errors import (
    FrameNotFoundError,
    HspControlError,
    JointNotFoundError,
    ModelError,
)
from hsp_control.companions.mujoco import MujocoCoordinates, loading
from hsp_control.companions.mujoco.scene import Names
from hsp_control.robot import JointFriction, ToolFrame

mujoco = pytest.importorskip("mujoco")
from mujoco_oracle import differences, velocity_map  # noqa: E402

TOLERANCE = 1e-12


def compiled(text: str) -> Any:
    return mujoco.MjModel.from_xml_string(text)


def body(joints: str = "<joint name='a' axis='0 1 0'/>", rest: str = "") -> str:
    """Return a scene of a moving body, ``bar``, with a site at its tip."""
    return f"""<mujoco><worldbody><body name="bar">{joints}
      <geom type="capsule" fromto="0 0 0 .4 0 .1" size=".05" mass="1"/>
      <site name="end" pos=".4 0 .1"/></body></worldbody>{rest}</mujoco>"""


# --- mechanics -----------------------------------------------------------------------


@given(trees())
def test_a_random_scene_is_the_one_of_mujoco(text: str) -> None:
    """M, N, poses and Jacobians of joints of all kinds, anchors and references."""
    model = compiled(text)
    robot = Robot.from_mujoco(model)
    assert robot.source.omitted == ()
    assert differences(robot, model, model.qpos0, 2).largest < TOLERANCE


@given(trees(), st.randoms(use_true_random=False))
def test_a_part_of_a_random_scene_is_that_part(text: str, random: Any) -> None:
    """Joints that are not named, above and below the root, are fixed at any
    position."""
    model = compiled(text)
    names = Names(model)
    rng = np.random.default_rng(random.randrange(2**32))
    top = names.bodies[int(model.jnt_bodyid[random.randrange(model.njnt)])]
    whole = Robot.from_mujoco(model, top)
    count = random.randint(1, len(whole.joint_names))
    joints = random.sample(whole.joint_names, count)
    qpos = rng.normal(size=model.nq)
    mujoco.mj_normalizeQuat(model, qpos)
    robot = Robot.from_mujoco(model, top, joints, qpos=qpos)
    assert set(robot.joint_names) == set(joints)
    assert differences(robot, model, qpos, 2).largest < TOLERANCE


@given(trees())
def test_a_robot_that_lacks_nothing_accelerates_like_mujocos(text: str) -> None:
    """M v' + N = tau - damping v, in MuJoCo's coordinates, within no limits."""
    model = compiled(text)
    model.jnt_limited[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    robot = Robot.from_mujoco(model)
    rng = np.random.default_rng(0)
    q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
    tau = rng.normal(size=robot.nv)
    coordinates, data = MujocoCoordinates.of(robot, model), mujoco.MjData(model)
    coordinates.to_mujoco(q, v, data.qpos, data.qvel)
    coordinates.effort_to_mujoco(q, tau, data.qfrc_applied)
    mujoco.mj_forward(model, data)
    friction = JointFriction.of_model(robot).viscous * v
    ours = robot.forward_dynamics(q, v, tau - friction)
    ahead, back = (
        velocity_map(coordinates, robot.integrate(q, sign * 1e-6 * v), model.nv)
        for sign in (1.0, -1.0)
    )
    T, T_rate = velocity_map(coordinates, q, model.nv), (ahead - back) / 2e-6
    theirs = data.qacc
    scale = max(1.0, float(np.abs(theirs).max()))
    np.testing.assert_allclose(T @ ours + T_rate @ v, theirs, atol=1e-6 * scale, rtol=0)


def test_a_model_that_mujoco_ships() -> None:
    file = Path(mujoco.__file__).parent / "testdata" / "model.xml"
    if not file.is_file():
        pytest.skip("this MuJoCo ships no models")
    model = mujoco.MjModel.from_xml_path(str(file))
    robot = Robot.from_mujoco(model)
    assert differences(robot, model, model.qpos0).largest < TOLERANCE


def test_coordinates_leave_the_rest_of_the_scene_alone() -> None:
    model = compiled(CELL)
    robot = Robot.from_mujoco(model, "base", ARM)
    coordinates = MujocoCoordinates.of(robot, model)
    qpos, qvel, qfrc = np.full(model.nq, 7.0), np.full(model.nv, 8.0), np.ones(model.nv)
    q, v = np.arange(4.0), -np.arange(4.0)
    coordinates.to_mujoco(q, v, qpos, qvel)
    coordinates.effort_to_mujoco(q, v, qfrc)
    np.testing.assert_array_equal(qpos, [0.0, 1.0, 2.0, 3.0, *[7.0] * 8])
    np.testing.assert_array_equal(qvel, [0.0, -1.0, -2.0, -3.0, *[8.0] * 7])
    np.testing.assert_array_equal(qfrc, [0.0, -1.0, -2.0, -3.0, *[1.0] * 7])
    back = coordinates.from_mujoco(qpos, qvel)
    np.testing.assert_array_equal(np.concatenate(back), [*q, *v])


def test_home_is_the_configuration_that_was_chosen() -> None:
    model = compiled(CELL)
    robot = Robot.from_mujoco(model, "base", ARM, keyframe="home")
    np.testing.assert_allclose(robot.home(), [0.0, 0.5, 0.0, 1.0], atol=1e-15)
    assert robot.source.locked == {"f": 0.02}
    before = model.key_qpos.copy()
    qpos = before[0].copy()
    qpos[:4] += 0.01
    moved = Robot.from_mujoco(model, "base", ARM, qpos=qpos, locked={"f": 0.03})
    np.testing.assert_allclose(moved.home(), robot.home() + 0.01, atol=1e-15)
    assert moved.source.locked == {"f": 0.03}
    np.testing.assert_array_equal(model.key_qpos, before)


# --- names, postures, limits ---------------------------------------------------------


MOTORS = [
    ("<motor joint='a' gear='3' ctrllimited='true' ctrlrange='-1 1'/>", 3.0),
    ("<motor joint='a' gear='-3' ctrllimited='true' ctrlrange='-2 2'/>", 6.0),
    ("<motor joint='a' ctrllimited='true' ctrlrange='-9 9' forcelimited='true' "
     "forcerange='-4 4'/>", 4.0),
    ("<general joint='a' gainprm='5' gear='2' ctrllimited='true' ctrlrange='-1 1'/>",
     10.0),
    ("<motor joint='a' ctrllimited='true' ctrlrange='-1 1'/>"
     "<motor joint='a' gear='2' ctrllimited='true' ctrlrange='-1 1'/>", 3.0),
    ("<position joint='a' forcelimited='true' forcerange='-7 7' gear='2'/>", 14.0),
    ("<motor joint='a' gear='3'/>", np.inf),
    ("", np.inf),
]  # fmt: skip


@pytest.mark.parametrize(("actuators", "limit"), MOTORS)
def test_effort_limits_are_those_of_the_actuators(actuators: str, limit: float) -> None:
    model = compiled(body(rest=f"<actuator>{actuators}</actuator>"))
    robot = Robot.from_mujoco(model)
    assert robot.model.upperEffortLimit[0] == limit
    if np.isfinite(limit):  # MuJoCo itself, with the largest controls
        data = mujoco.MjData(model)
        data.ctrl[:] = 1e6 * np.sign(model.actuator_gear[:, 0])
        mujoco.mj_forward(model, data)
        assert data.qfrc_actuator[0] == pytest.approx(limit, rel=1e-12)


def test_a_joint_may_limit_the_sum_of_its_actuators() -> None:
    joint = (
        "<joint name='a' axis='0 1 0' actuatorfrclimited='true' "
        "actuatorfrcrange='-2 2'/>"
    )
    motor = (
        "<actuator><motor joint='a' ctrllimited='true' ctrlrange='-9 9'/></actuator>"
    )
    robot = Robot.from_mujoco(compiled(body(joint, motor)))
    assert robot.model.upperEffortLimit[0] == 2.0
    assert robot.source.omitted == ()


def test_actuators_may_have_an_armature_and_a_damping() -> None:
    """In MuJoCo 4, after the gear; M and the damping force are MuJoCo's."""
    motor = "<motor joint='a' gear='3' armature='2' damping='4'/>"
    try:
        model = compiled(body(rest=f"<actuator>{motor}</actuator>"))
    except ValueError:
        pytest.skip("this MuJoCo's actuators have none")
    robot = Robot.from_mujoco(model)
    assert robot.model.armature[0] == 18.0
    assert differences(robot, model, model.qpos0).largest < TOLERANCE
    data = mujoco.MjData(model)
    data.qvel[0] = 0.5
    mujoco.mj_forward(model, data)
    viscous = JointFriction.of_model(robot).viscous
    assert data.qfrc_passive[0] == pytest.approx(-0.5 * viscous[0], rel=1e-12)


# --- omitted parts -------------------------------------------------------------------

SERVO = "<actuator><position joint='a'/></actuator>"
TENDON = "<tendon><fixed name='t' {}><joint joint='a' coef='2'/></fixed></tendon>"
OMISSIONS = [
    (body("<joint name='a' axis='0 1 0' stiffness='3'/>"), "springs at joints a: no f"),
    (body("<joint type='ball' name='n' limited='true' range='0 30'/>"),
     "ball joints n: no limit"),
    (body("<joint type='free' name='f' armature='1'/>"),
     "free joints f: the armature of their translation is in M, but not in the Cor"),
    (body(rest="<actuator><motor joint='a' ctrllimited='true' ctrlrange='-1 2'/>"
          "</actuator>"), "joints a: their effort has different limits in both dir"),
    (body().replace('name="bar"', 'name="bar" gravcomp="1"'),
     "bodies bar: no compensation of their gravity"),
    (body(rest="<option density='1'/>"), "the fluid around it: no force"),
    (body(rest=SERVO), "actuators actuator_0: they are not torque motors"),
    (body(rest=TENDON.format("") + "<actuator><motor tendon='t'/></actuator>"),
     "actuators actuator_0: they act through a tendon"),
    (body("<joint name='a' axis='0 1 0'/><joint name='b'/>",
          "<actuator><motor joint='a'/></actuator>"),
     "joints b: no actuator acts on them"),
    (body(rest=TENDON.format("stiffness='1'")), "tendons t: no stiffness"),
    (body("<joint name='a' axis='0 1 0'/><joint name='b'/>",
          "<equality><joint joint1='a' joint2='b'/></equality>"),
     "equality constraints equality_0: no constraint"),
    (body(rest="<equality><weld name='w' body1='bar'/></equality>"),
     "equality constraints w: no constraint"),
    (body(rest="<worldbody><body><geom type='plane' size='1 1 1' name='p'/></body>"
          "</worldbody>"), "geoms p: no distance to them is known"),
]  # fmt: skip


@pytest.fixture
def _nothing_said() -> None:
    loading._warn.cache_clear()


@pytest.mark.usefixtures("_nothing_said")
@pytest.mark.parametrize(("text", "sentence"), OMISSIONS)
def test_missing_features_of_the_robot_are_named(
    text: str, sentence: str, caplog: pytest.LogCaptureFixture
) -> None:
    robot = Robot.from_mujoco(compiled(text))
    assert len(robot.source.omitted) == 1
    assert robot.source.omitted[0].startswith(sentence)
    assert sentence in caplog.text
    caplog.clear()
    assert Robot.from_mujoco(compiled(text)).source.omitted == robot.source.omitted
    assert not caplog.records  # once suffices


def test_a_servo_of_an_orientation_acts_on_its_ball_joint() -> None:
    """In MuJoCo 4: three controls on the joint, or a torque between two sites."""
    ball = "<joint name='n' type='ball'/><site name='base'/>"
    for target, kind in (
        ("joint='n'", "torque motors"),
        ("site='end' refsite='base'", "tendon"),
    ):
        servo = f"<actuator><orientation name='o' {target} kp='1'/></actuator>"
        try:
            model = compiled(body(ball, servo))
        except ValueError:
            pytest.skip("this MuJoCo has no such actuator")
        (sentence,) = Robot.from_mujoco(model).source.omitted[:1]
        assert sentence.startswith("actuators o: they ")
        assert kind in sentence


def test_parts_without_an_effect_on_the_robot_are_not_named() -> None:
    text = CELL.replace(
        "</mujoco>", "<equality><weld body1='ball' active='false'/></equality></mujoco>"
    )
    assert Robot.from_mujoco(compiled(text), "base", ARM).source.omitted == ()


def test_a_mocap_body_stands_still() -> None:
    mocap = "<worldbody><body name='target' mocap='true'/></worldbody>"
    robot = Robot.from_mujoco(compiled(body(rest=mocap)))
    assert robot.source.omitted == ("mocap bodies target: they stand still",)
    assert "target" in robot.frame_names


# --- mistakes ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"root": "bse"}, FrameNotFoundError, "root: no ... 'bse' ... 'base'"),
        ({"joints": ["j5"]}, JointNotFoundError, "joints: no joint 'j5' ... j1, j2,"),
        ({"joints": ["ball"], "root": "base"}, JointNotFoundError,
         "joints: 'ball' ... not below the root"),
        ({"joints": "j1"}, ModelError, "joints: 'j1' is text; needs a list of names"),
        ({"joints": []}, ModelError, "no joint of 'world' moves"),
        ({"root": "finger", "locked": {"f": 0.0}}, ModelError,
         "no joint of 'finger' moves"),
        ({"keyframe": "hom"}, ModelError, "keyframe: no ... 'hom' ... 'home'"),
        ({"keyframe": "home", "qpos": [0.0]}, ModelError, "... qpos and keyframe"),
        ({"qpos": [0.0]}, ModelError, "qpos ... (1,)"),
        ({"qpos": [np.nan] * 12}, ModelError, "qpos ... (12,)"),
        ({"locked": {"f": np.inf}}, ModelError, "locked: 'f' ... inf ... finite"),
        ({"locked": {"g": 0.0}}, JointNotFoundError, "locked: no joint 'g'"),
        ({"locked": {"ball": 0.0}}, ModelError, "locked: 'ball' is neither a hinge"),
        ({"locked": {"f": 0.0}, "joints": ["j1", "f"]}, ModelError,
         "locked: 'f' ... joints that move"),
        ({"tool_frames": {"pen": ToolFrame("tp")}}, FrameNotFoundError,
         "tool frame 'pen': no ... 'tp' ... 'tip'"),
    ],
)  # fmt: skip
def test_mistakes(options: dict[str, Any], error: type, message: str) -> None:
    with pytest.raises(error, match=wording(message)) as caught:
        Robot.from_mujoco(compiled(CELL), **options)
    assert isinstance(caught.value, HspControlError)
