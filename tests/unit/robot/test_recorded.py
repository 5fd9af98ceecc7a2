"""A log contains its robot: another computer, or an edited file, changes nothing."""

import base64
import json
import logging
import shutil
from hashlib import sha256
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mesh_texts import tetrahedron
from robot_texts import INERTIA, joint, robot_xml

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.companions.viewer.robot_drawing import read_visuals
from hsp_control.companions.viewer.threejs import collada_object
from hsp_control.geometry.links import link_shapes
from hsp_control.robot.description import recorded_meshes
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.recorded_model import packed
from hsp_control.robot.description.robot_description import (
    PlacedRobot,
    RobotDescription,
    ToolFrame,
)
from hsp_control.robot.recorded import OtherRobotWarning, recorded_robot, robot_record

TWO = RobotDescription(
    parts={
        "left": PlacedRobot("ur5", position=(0.0, 0.5, 0.0)),
        "right": PlacedRobot("panda", rotation=(0.0, 0.0, 1.0)),
    }
)
TOOL = RobotDescription(
    "panda",
    locked={"panda_joint7": 0.3},
    tool_frames={"tip": ToolFrame("panda_hand", translation=(0.0, 0.0, 0.1))},
    gravity=(0.0, 1.0, -9.0),
)


def all_joints() -> hsp.Robot:
    model = pin.Model()
    kinds = [
        pin.JointModelFreeFlyer(), pin.JointModelRX(), pin.JointModelRUBY(),
        pin.JointModelPZ(), pin.JointModelSpherical(), pin.JointModelTranslation(),
        pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8])),
        pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])),
    ]  # fmt: skip
    for k, kind in enumerate(kinds):
        pose = pin.exp6(pin.Motion(0.1 * np.arange(6.0)))
        model.addJoint(k, kind, pose, f"j{k}")
        model.appendBodyToJoint(k + 1, pin.Inertia.Random(), pose)
        frame = pin.Frame(f"b{k}", k + 1, 0, pose, pin.FrameType.BODY)
        model.addFrame(frame, False)
    model.armature[:] = 0.3
    model.effortLimit[:] = 7.0
    model.gravity.linear = np.array([1.0, 0.0, -9.0])
    return hsp.Robot.from_pinocchio(model)


def followers() -> hsp.Robot:
    """A chain with mimic joints of several types, also of a multi-turn leader."""
    rng = np.random.default_rng(2)
    kinds = [
        (pin.JointModelRX(), None),
        (pin.JointModelRUBY(), None),
        (pin.JointModelPZ(), None),
        (pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8])), (1, -0.5, 0.1)),
        (pin.JointModelRUBZ(), (2, 1.0, 0.3)),
        (pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])), (1, 0.2, 0.0)),
        (pin.JointModelRZ(), (3, 4.0, 0.0)),
        (pin.JointModelPX(), (3, 2.0, -0.2)),
        (pin.JointModelPY(), None),
    ]  # fmt: skip
    model, last = pin.Model(), 0
    for k, (kind, _) in enumerate(kinds):
        pose = pin.exp6(pin.Motion(rng.normal(size=6)))
        last = model.addJoint(last, kind, pose, f"j{k}")
        model.appendBodyToJoint(last, pin.Inertia.Random(), pose)
        model.addFrame(pin.Frame(f"b{k}", last, 0, pose, pin.FrameType.BODY), False)
    for k, (_, follows) in enumerate(kinds, start=1):
        if follows is not None:
            leader, scaling, offset = follows
            model = pin.transformJointIntoMimic(model, leader, k, scaling, offset)
    model.effortLimit[:] = 5.0
    return hsp.Robot.from_pinocchio(model)


def one_of_many() -> hsp.Robot:
    """A joint of three slides in series, next to a revolute one."""
    table = pin.JointModelComposite()
    pose = pin.exp6(pin.Motion(0.2 * np.arange(6.0)))
    for kind in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()):
        table.addJoint(kind, pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3])))
    model = pin.Model()
    for k, kind in enumerate((table, pin.JointModelRY())):
        model.addJoint(k, kind, pose, f"j{k}")
        model.appendBodyToJoint(k + 1, pin.Inertia.Random(), pose)
        frame = pin.Frame(f"b{k}", k + 1, 0, pose, pin.FrameType.BODY)
        model.addFrame(frame, False)
    return hsp.Robot.from_pinocchio(model)


def tilted() -> hsp.Robot:
    """A multi-turn joint about a general axis, and its follower."""
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/><axis xyz="{axis}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/></joint>'
        for k, axis in enumerate(("0 0.6 0.8", "0.6 0 -0.8"))
    )
    inertia = '<inertia ixx="1" iyy="1" izz="1.5" ixy="0.1" ixz="0" iyz="0.2"/>'
    inertial = f'<inertial><mass value="2"/><origin xyz="1 2 3"/>{inertia}</inertial>'
    links = "".join(f'<link name="l{k}">{inertial}</link>' for k in range(3))
    model = pin.buildModelFromXML(f'<robot name="tilted">{links}{joints}</robot>')
    return hsp.Robot.from_pinocchio(pin.transformJointIntoMimic(model, 1, 2, 1.0, 0.2))


ROBOTS = {
    "tilted": tilted,
    "followers": followers,
    "slides of one joint": one_of_many,
    "panda": lambda: hsp.Robot.load("panda"),
    "a tool, a lock, gravity": lambda: hsp.Robot.load(TOOL),
    "two": lambda: hsp.Robot.load(TWO),
    "free": lambda: hsp.Robot.load("panda", root="free_flyer"),
    "combined": lambda: hsp.Robot.combine(
        {name: (hsp.Robot.load("ur5"), pin.SE3.Identity()) for name in "ab"}
    ),
    "pinocchio": all_joints,
    "reduced": lambda: hsp.Robot.from_pinocchio(hsp.Robot.load("panda").model),
}


def equal(one: hsp.Robot, other: hsp.Robot) -> None:
    """The same motion of the same frames, bit for bit."""
    assert one.frame_names == other.frame_names
    assert one.dof_names == other.dof_names
    assert one.end_effector == other.end_effector
    np.testing.assert_array_equal(one.home(), other.home())
    rng = np.random.default_rng(0)
    q, v = one.random_configuration(rng), rng.standard_normal(one.nv)
    np.testing.assert_allclose(
        one.inverse_dynamics(q, v, v), other.inverse_dynamics(q, v, v), atol=1e-12
    )
    for name in ("effortLimit", "velocityLimit", "armature", "lowerPositionLimit"):
        np.testing.assert_array_equal(
            getattr(one.model, name), getattr(other.model, name)
        )
    a, b = one.state(0.0, q, v), other.state(0.0, q, v)
    for name in one.frame_names:
        np.testing.assert_allclose(a.position(name), b.position(name), atol=1e-15)


@pytest.mark.parametrize("kind", ROBOTS)
def test_a_record_is_the_robot(kind: str) -> None:
    robot = ROBOTS[kind]()
    equal(recorded_robot(robot_record(robot)), robot)


def copied(folder: Path) -> Path:
    """Return a user's URDF: a bundled one in another folder."""
    source = hsp.Robot.load("planar3r").source.urdf
    folder.mkdir(exist_ok=True)
    return Path(shutil.copy(source, folder / "mine.urdf"))


def log_of(robot: hsp.Robot, path: Path) -> hsp.Rollout:
    task = hsp.FramePosition(robot.end_effector)
    controller = hsp.Controller(robot, [task], hsp.Rest(), null_space_gain=1.0)
    run = hsp.simulate(controller, robot.home(), duration=0.02, control_period=0.01)
    run.save(path)
    return run


def test_an_edited_urdf_is_named_and_the_log_s_robot_is_used(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    urdf = copied(tmp_path / "robots")
    robot = hsp.Robot.load(urdf)
    record = robot_record(robot)
    with caplog.at_level(logging.WARNING):
        equal(recorded_robot(record), robot)
    assert not caplog.records
    urdf.write_text(urdf.read_text().replace('mass value="', 'mass value="1'))
    with caplog.at_level(logging.WARNING):
        equal(recorded_robot(record), robot)
    assert f"{urdf} has changed since the log was made" in caplog.text
    rest = np.zeros((1, robot.nv))
    run = hsp.Rollout(
        {
            "t": np.zeros(1),
            "q": robot.home()[None],
            **dict.fromkeys(["v", "tau"], rest),
        },
        {"robot": {"record": record}},
    )
    with pytest.warns(OtherRobotWarning, match=r"is not the robot of the log"):
        run.measure(hsp.Robot.load(urdf), lambda state: state.t)
    shutil.rmtree(urdf.parent)
    equal(recorded_robot(record), robot)


@pytest.mark.parametrize("kind", ["urdf", "pinocchio"])
def test_a_log_from_python_is_shown_without_its_files(
    kind: str, tmp_path: Path
) -> None:
    urdf = copied(tmp_path / "robots")
    robot = hsp.Robot.load(urdf)
    if kind == "pinocchio":
        robot = hsp.Robot.from_pinocchio(robot.model)
    log_of(robot, tmp_path / "a.npz")
    shutil.rmtree(urdf.parent)
    page = tmp_path / "a.html"
    from hsp_control.cli import main

    assert main(["export", str(tmp_path / "a.npz"), "--html", str(page)]) == 0
    assert page.stat().st_size > 10_000


def test_a_recorded_run_is_repeated_without_its_files(tmp_path: Path) -> None:
    urdf = copied(tmp_path / "robots")
    robot = hsp.Robot.load(urdf)
    task = hsp.FramePosition(robot.end_effector)
    controller = hsp.Controller(robot, [task], hsp.Rest(), null_space_gain=1.0)
    q, v = robot.home(), np.zeros(robot.nv)
    with hsp.Recorder(controller, tmp_path / "b.npz") as recorder:
        for k in range(30):
            recorder.record(controller.compute(0.01 * k, q, v))
    shutil.rmtree(urdf.parent)
    again = hsp.load_experiment(tmp_path / "b.npz")
    equal(again.robot, robot)
    with pytest.raises(hsp.HspControlError):
        hsp.load_experiment(tmp_path / "b.npz", f"robot.name={urdf}")


@pytest.mark.parametrize(
    "record",
    [None, {}, {"missing": "why"}, {"model": {}}, {"model": {"joints": 3}},
     {"description": {"name": "panda"}, "parts": [], "home": []},
     {"description": {"name": "panda"}, "home": [],
      "parts": [{"urdf": "no", "file": "", "name": ""}]}],
)  # fmt: skip
def test_a_damaged_record_is_one_message(record: object) -> None:
    with pytest.raises(ModelError, match=r"the (log|recorded)|recorded robot"):
        recorded_robot(record)


PYRAMID = (
    "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
)


def with_meshes(folder: Path) -> Path:
    """Return a URDF of two links whose shapes are meshes, named in three ways."""
    package = folder / "mine"
    (package / "meshes").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>mine</name></package>")
    for name in ("a.obj", "b.obj", "c.obj"):
        (package / "meshes" / name).write_text(PYRAMID + f"# {name}\n")
    text = robot_xml(
        *(
            f'<link name="{name}">{INERTIA}'
            f'<visual><geometry><mesh filename="{seen}"/></geometry></visual>'
            f'<collision><geometry><mesh filename="{felt}"/></geometry></collision>'
            "</link>"
            for name, seen, felt in (
                ("one", "meshes/a.obj", "meshes/b.obj"),
                ("two", f"{package}/meshes/c.obj", "package://mine/meshes/b.obj"),
            )
        ),
        joint("j", "one", "two"),
    )
    urdf = package / "arm.urdf"
    urdf.write_text(text)
    return urdf


def vertices(robot: hsp.Robot) -> list[Array]:
    """Return the vertices of the shapes that distances are measured to."""
    shapes = link_shapes(robot, "meshes")
    return [np.array(shape.geometry.vertices()) for shape in shapes]


def test_a_log_contains_the_meshes_of_a_user_s_robot(tmp_path: Path) -> None:
    """Without its files, its shapes are drawn and distances measured."""
    urdf = with_meshes(tmp_path)
    robot = hsp.Robot.load(urdf)
    record = json.loads(json.dumps(robot_record(robot)))
    assert len(record["parts"][0]["meshes"]) == 4
    before = vertices(robot)
    shutil.rmtree(urdf.parent)
    again = recorded_robot(record)
    assert len(before) == 2
    np.testing.assert_array_equal(vertices(again), before)
    assert not any(visual.missing for visual in read_visuals(again))
    # A log of the replayed run contains them, too.
    assert robot_record(again)["parts"][0]["meshes"] == record["parts"][0]["meshes"]


def test_packages_are_no_part_of_a_log_and_large_meshes_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    panda = robot_record(hsp.Robot.load("panda"))
    assert panda["parts"][0]["meshes"] == {}
    robot = hsp.Robot.load(with_meshes(tmp_path))
    (whole,) = robot_record(robot)["parts"]
    felt = ["meshes/b.obj", "package://mine/meshes/b.obj"]
    room = sum(len(whole["meshes"][name]) for name in felt)
    monkeypatch.setattr(recorded_meshes, "MOST", room)
    (part,) = robot_record(robot)["parts"]
    assert [*part["meshes"]] == felt
    (reported,) = messages(caplog, "no room")
    left_out = [name for name in whole["meshes"] if name not in felt]
    for name in left_out:
        assert f"{name} (0.0 MB)" in reported
    assert part["left_out"] == dict.fromkeys(left_out, "0.0 MB")
    caplog.clear()
    record = robot_record(robot)
    recorded_robot(record)
    assert not caplog.records  # the files are there
    shutil.rmtree(robot.source.urdf.parent)
    recorded_robot(record)
    (reported,) = messages(caplog, "does not contain")
    assert all(name in reported for name in left_out)


def messages(caplog: pytest.LogCaptureFixture, what: str) -> list[str]:
    return [r.getMessage() for r in caplog.records if what in r.getMessage()]


RED = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108020000009077"
    "53de0000000c49444154789c63f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
)
"""A picture of one red point, in PNG."""


def test_a_mesh_is_recorded_with_the_files_that_are_drawn_of_it(tmp_path: Path) -> None:
    """A Collada file's texture and a glTF file's buffer are separate files."""
    urdf = with_meshes(tmp_path)
    folder = urdf.parent / "meshes"
    (urdf.parent / "pictures").mkdir()
    (urdf.parent / "pictures" / "red one.png").write_bytes(RED)
    dae = tetrahedron(folder / "a.dae").read_text()
    image = (
        '<library_images><image id="i"><init_from>../pictures/red one.png</init_from>'
        "</image></library_images><library_geometries>"
    )
    (folder / "a.dae").write_text(dae.replace("<library_geometries>", image))
    scene = json.loads(tetrahedron(folder / "c.gltf").read_text())
    uri = scene["buffers"][0]["uri"]
    (folder / "c.bin").write_bytes(base64.b64decode(uri.partition(",")[2]))
    scene["buffers"][0]["uri"] = "c.bin"
    (folder / "c.gltf").write_text(json.dumps(scene))
    text = urdf.read_text().replace("a.obj", "a.dae").replace("c.obj", "c.gltf")
    urdf.write_text(text.replace("package://mine/meshes/b.obj", "meshes/c.gltf"))

    robot = hsp.Robot.load(urdf)
    seen, felt = read_visuals(robot), vertices(robot)
    record = json.loads(json.dumps(robot_record(robot)))
    shutil.rmtree(urdf.parent)
    again = recorded_robot(record)
    dae_again, gltf_again = read_visuals(again)
    assert dae_again.file is not None
    pictures = collada_object(dae_again.file)["object"]["resources"]
    assert [text.partition(",")[2] for text in pictures.values()] == [
        base64.b64encode(RED).decode()
    ]
    assert gltf_again.mesh is not None
    assert seen[1].mesh is not None
    np.testing.assert_array_equal(gltf_again.mesh[0], seen[1].mesh[0])
    np.testing.assert_array_equal(vertices(again), felt)
    # A log of the replayed run is the same.
    assert robot_record(again)["parts"][0] == record["parts"][0]


def test_where_there_is_no_room_the_most_links_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    urdf = with_meshes(tmp_path)
    large = "".join(f"# {k} {k**7}\n" for k in range(200))
    (urdf.parent / "meshes" / "a.obj").write_text(PYRAMID + large)
    robot = hsp.Robot.load(urdf)
    (whole,) = robot_record(robot)["parts"]
    (first,) = (name for name in whole["meshes"] if name.endswith("a.obj"))
    room = sum(map(len, whole["meshes"].values())) - 1
    monkeypatch.setattr(recorded_meshes, "MOST", room)
    (part,) = robot_record(robot)["parts"]
    assert {*whole["meshes"]} - {*part["meshes"]} == {first}


def test_a_mesh_that_was_edited_since_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The robot is that of the log, with its shapes."""
    urdf = with_meshes(tmp_path)
    robot = hsp.Robot.load(urdf)
    record = robot_record(robot)
    before = vertices(robot)
    recorded_robot(record)
    assert not caplog.records
    file = urdf.parent / "meshes" / "b.obj"
    file.write_text(PYRAMID.replace("0.3", "0.6"))
    again = recorded_robot(record)
    (reported,) = messages(caplog, "have changed")
    assert "meshes/b.obj" in reported
    assert "a.obj" not in reported
    np.testing.assert_array_equal(vertices(again), before)


@pytest.mark.parametrize(
    "meshes",
    [[], 5, {"a.obj": "x"}, {"a.obj": 5}, {"a.sh": packed(b"x")}, {"a": packed(b"x")},
     {"a.obj": packed(bytes(101_000_000))}],
    ids=lambda meshes: str(meshes)[:20],
)  # fmt: skip
def test_damaged_meshes_are_named(meshes: object, tmp_path: Path) -> None:
    record = robot_record(hsp.Robot.load(with_meshes(tmp_path)))
    record["parts"][0]["meshes"] = meshes
    with pytest.raises(ModelError, match=r"damaged|not whole"):
        recorded_robot(record)


@pytest.mark.parametrize(
    "beside",
    [[], 5, {"../a.png": packed(b"x")}, {f"{'0' * 32}.png": packed(b"x")},
     {f"{sha256(b'x').hexdigest()[:32]}.sh": packed(b"x")}],
    ids=lambda beside: str(beside)[:20],
)  # fmt: skip
def test_files_beside_recorded_meshes_match_their_names(
    beside: object, tmp_path: Path
) -> None:
    record = robot_record(hsp.Robot.load(with_meshes(tmp_path)))
    record["parts"][0]["beside"] = beside
    with pytest.raises(ModelError, match="damaged"):
        recorded_robot(record)


def test_an_untrusted_log_writes_no_mesh(tmp_path: Path) -> None:
    record = robot_record(hsp.Robot.load(with_meshes(tmp_path)))
    robot = recorded_robot(record, only_within([tmp_path]))
    assert robot.source.meshes == ()
